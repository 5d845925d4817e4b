"""The file of a JUnit report: it replaces a report only, and an older one never counts for a run that did not end."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import LARGEST_PROGRAM, bytes_of, why
from multidrop.macros.atomic import write_atomically
from multidrop.shell import new_file
from multidrop.shell.front.junit import Case, junit


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
