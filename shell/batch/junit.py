"""Results as JUnit XML: a test suite for each script, a test case for each checked line."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import LARGEST_PROGRAM, bytes_of, why
from multidrop.dialects.text import visible
from multidrop.macros.atomic import write_atomically
from multidrop.shell import new_file

if TYPE_CHECKING:
    from multidrop.shell.scripts.model import Result


@dataclass(frozen=True)
class Case:
    """A test case: a check, or a line that ended the script."""

    name: str
    file: str
    seconds: float = 0.0
    failure: str = ""
    """A failed check."""
    error: str = ""
    """Any other failure."""
    printed: tuple[str, ...] = ()

    @classmethod
    def of(cls, result: Result) -> Case:
        """The case of a line."""
        failure, error = (result.error, "") if result.failed_check else ("", result.error)
        name = f"{result.where}: {result.reported}"
        suite = f"macro {result.line.macro}" if result.line.macro else result.line.file
        return cls(name, suite, result.seconds, failure, error, result.printed)


def junit(name: str, cases: Sequence[Case], begun: datetime, seconds: float) -> bytes:
    """The XML of the suites: the script's own first, then one for each called file that has cases."""
    root = ElementTree.Element("testsuites")
    for file in dict.fromkeys([name, *(case.file for case in cases)]):
        own = [case for case in cases if case.file == file]
        taken = seconds if file == name else sum(case.seconds for case in own)
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            name=_shown(file),
            tests=str(len(own)),
            failures=str(sum(bool(case.failure) for case in own)),
            errors=str(sum(bool(case.error) for case in own)),
            skipped="0",
            time=f"{taken:.3f}",
            timestamp=begun.isoformat(timespec="seconds"),
        )
        for case in own:
            _add(suite, case)
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _add(suite: ElementTree.Element, case: Case) -> None:
    found = ElementTree.SubElement(
        suite, "testcase", name=_shown(case.name), classname=_shown(case.file), time=f"{case.seconds:.3f}"
    )
    for kind in ("failure", "error"):
        if text := _shown(getattr(case, kind)):
            ElementTree.SubElement(found, kind, message=text).text = text
    if case.printed:
        ElementTree.SubElement(found, "system-out").text = "\n".join(map(_shown, case.printed))


def _shown(text: str) -> str:
    """The text without the characters that XML cannot have."""
    return visible(text).translate({0xFFFE: "\\ufffe", 0xFFFF: "\\uffff"})


class JUnitFile:
    """A report of `name` at a path; `text` empty: no report is written."""

    def __init__(self, text: str, name: str, begun: datetime) -> None:
        self._path = Path(text) if text else None
        self._name, self._begun = name, begun

    @property
    def wanted(self) -> bool:
        """Whether a report is written."""
        return self._path is not None

    def begin(self) -> None:
        """Write a report of a run without an end, lest an older one is taken for this run's.

        Raises Diagnostic where it cannot be written, and for another file in its place, which stays: then and later.
        """
        if self._path is None:
            return
        try:
            _check_place(self._path)
            self.write([Case(self._name, self._name, error="the run did not end")])
        except Diagnostic:
            self._path = None
            raise

    def write(self, cases: Sequence[Case], seconds: float = 0.0) -> None:
        """Write the report. Raises Diagnostic."""
        if self._path is None:
            return
        try:
            write_atomically(self._path, junit(self._name, cases, self._begun, seconds))
        except OSError as error:
            raise Diagnostic(f"the report cannot be written: {why(error)}", str(self._path)) from None


def _check_place(path: Path) -> None:
    """Check that a report may be written to a path: it replaces a report only. Raises Diagnostic."""
    if str(path) == new_file.STANDARD_OUTPUT:
        raise Diagnostic("standard output has the replies", "--junit -", "name a file for the report")
    new_file.check_folder(path)
    if not os.path.exists(path):  # Path's own methods raise for a name that is too long
        return
    if not os.path.isfile(path):
        raise Diagnostic("is not a file", str(path), "name a new file for the report")
    begin = bytes_of(path, LARGEST_PROGRAM)[:400]
    if begin and b"<testsuite" not in begin:
        raise Diagnostic("exists already and is not a JUnit report", str(path), "name a new file for the report")
