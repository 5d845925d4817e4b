"""Results as JUnit XML: a test suite for each script, a test case for each checked line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from multidrop.dialects.visible import visible

if TYPE_CHECKING:
    from multidrop.shell.scripts.results import Result


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
