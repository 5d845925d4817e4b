"""Reports of executed lines: JSON objects on standard output, a line on standard error, a JUnit file.

A JUnit file has a test suite for each script, and a test case for each checked line. A sweep writes one, too.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from multidrop.base import new_file
from multidrop.base.atomic import write_atomically
from multidrop.base.errors import Diagnostic
from multidrop.base.files import LARGEST_PROGRAM, bytes_of, why
from multidrop.base.text import counted, visible
from multidrop.shell.streams.stdout import fail, write
from multidrop.shell.streams.stdout import report as described

if TYPE_CHECKING:
    from multidrop.shell.scripts.model import LineResult, MacroEnding
    from multidrop.shell.session import Session


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
    def of(cls, result: LineResult) -> Case:
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
            case_element = ElementTree.SubElement(
                suite, "testcase", name=_shown(case.name), classname=_shown(case.file), time=f"{case.seconds:.3f}"
            )
            for kind in ("failure", "error"):
                if text := _shown(getattr(case, kind)):
                    ElementTree.SubElement(case_element, kind, message=text).text = text
            if case.printed:
                ElementTree.SubElement(case_element, "system-out").text = "\n".join(map(_shown, case.printed))
    ElementTree.indent(root)
    whole: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return whole + b"\n"


def _shown(text: str) -> str:
    return visible(text).translate({0xFFFE: "\\ufffe", 0xFFFF: "\\uffff"})


class JUnitFile:
    """A report of `name` at a path; `text` empty: no report is written."""

    def __init__(self, text: str, name: str, begun: datetime) -> None:
        self._path = Path(text) if text else None
        self._name, self._begun = name, begun

    @property
    def wanted(self) -> bool:
        return self._path is not None

    def begin(self) -> None:
        """Write a report of a run without an end, lest an older one is taken for this run's.

        Raises Diagnostic where it cannot be written, and for another file in its place, which stays: then and later.
        """
        if self._path is None:
            return
        try:
            check_place(str(self._path), "--junit", b"<testsuite", "JUnit report")
            self.write([Case(self._name, self._name, error="the run did not end")])
        except Diagnostic:
            self._path = None
            raise

    def write(self, cases: Sequence[Case], seconds: float = 0.0) -> None:
        if self._path is None:
            return
        try:
            write_atomically(self._path, junit(self._name, cases, self._begun, seconds))
        except OSError as error:
            raise Diagnostic(f"the report cannot be written: {why(error)}", str(self._path)) from None


def check_place(path: str, option: str, sign: bytes, what: str) -> None:
    """Check that a report may be written to a path: it replaces a report only, with that sign. Raises Diagnostic."""
    if path == new_file.STANDARD_OUTPUT:
        raise Diagnostic("standard output has the replies", f"{option} -", "name a file for the report")
    new_file.check_folder(path)
    if not os.access(os.path.dirname(os.path.abspath(path)), os.W_OK):
        raise Diagnostic("its folder cannot be written", path, "name a file in another folder")
    if not os.path.exists(path):  # Path's own methods raise for a name that is too long
        return
    if not os.path.isfile(path):
        raise Diagnostic("is not a file", path, "name a new file for the report")
    begin = bytes_of(path, LARGEST_PROGRAM)[:400]
    if begin and sign not in begin:
        raise Diagnostic(f"exists already and is not a {what}", path, "name a new file for the report")


class BatchReport:
    """The reports of one run. `executed` takes each result; `finish` writes what is left at the end."""

    def __init__(self, name: str, *, as_json: bool = False, junit: str = "") -> None:
        self._name = name
        self._json = as_json
        self._begun = datetime.now().astimezone()
        self._junit = JUnitFile(junit, name, self._begun)
        self._cases: list[Case] = []
        self._lines = self._checks = self._failed = self._failed_checks = 0
        self._failure = ""
        self._ending: MacroEnding | None = None

    def begin(self) -> None:
        """See `JUnitFile.begin`. Raises Diagnostic."""
        self._junit.begin()

    def executed(self, result: LineResult, *, counts: bool = True) -> None:
        """Take the result of a line. `counts`: its failure is one of the script."""
        self._lines += 1
        self._checks += result.check
        self._failed += not result.ok
        self._failed_checks += result.check and not result.ok
        if self._json:
            write(sys.stdout, json.dumps(result.fact()))
        if counts and self._junit.wanted and (result.check or not result.ok):
            self._cases.append(Case.of(result))

    def ended(self, ending: MacroEnding) -> None:
        self._ending = ending

    def refused(self, failure: Diagnostic) -> int:
        """Report a script that is not executed, with each of its errors; return the exit code."""
        for problem in getattr(failure, "problems", (failure,)):
            self._cases.append(Case(problem.where or self._name, self._name, error=str(problem)))
        self.finish(2)
        return fail(failure)

    def finish(self, code: int) -> int:
        seconds = (datetime.now().astimezone() - self._begun).total_seconds()
        if self._json:
            summary = {"lines": self._lines, "failed": self._failed, "seconds": round(seconds, 3)}
            summary |= self._ending.fact() if self._ending is not None else {}
            write(sys.stdout, json.dumps({"summary": summary}))
        elif self._checks:
            words = f"{counted(self._lines, 'line')}, {counted(self._checks, 'check')}, {self._failed_checks} failed"
            others = self._failed - self._failed_checks
            words += f", {counted(others, 'other line')} failed" * bool(others) + f", {seconds:.1f} s"
            write(sys.stderr, f"{self._name}: {self._begun.isoformat(' ', 'seconds')}: {words}")
        if not self._junit.wanted:
            return code
        if code and not any(case.error or case.failure for case in self._cases):
            self._cases.append(Case(self._name, self._name, error=self._failure or f"exit code {code}"))
        try:
            self._junit.write(self._cases, seconds)
        except Diagnostic as problem:
            write(sys.stderr, str(problem))
            return code or 2
        return code

    async def watched(self, session: Session, urls: Sequence[str], roles: Sequence[tuple[str, str]]) -> None:
        """Open URLs, and those of roles under their names; keep the reason of a failure for the report."""
        with self.noting("ended while it was being opened"):
            await session.open_all(urls)
            for name, url in roles:
                await session.open(url, name)

    @contextlib.contextmanager
    def noting(self, cut: str = "ended before it was done") -> Iterator[None]:
        """Keep the reason of a failure, for a report without a line that failed. `cut`: that of an interruption."""
        import asyncio  # a sweep needs neither

        from multidrop.shell.events import FAILURES

        try:
            yield
        except FAILURES as failure:
            self._failure = described(failure)
            raise
        except asyncio.CancelledError:
            self._failure = cut
            raise
