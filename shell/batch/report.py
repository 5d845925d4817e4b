"""Reports of executed lines: JSON objects on standard output, a JUnit file, a line on standard error."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import Iterator
from datetime import datetime

from multidrop.dialects import Diagnostic
from multidrop.shell.batch.junit import Case, JUnitFile
from multidrop.shell.events import FAILURES
from multidrop.shell.scripts.model import Ending, Result
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import report as described
from multidrop.shell.streams.stdout import write


class Report:
    """The reports of one run. `executed` takes each result; `finish` writes what is left at the end."""

    def __init__(self, name: str, *, as_json: bool = False, junit: str = "") -> None:
        self._name = name
        self._json = as_json
        self._begun = datetime.now().astimezone()
        self._junit = JUnitFile(junit, name, self._begun)
        self._cases: list[Case] = []
        self._lines = self._checks = self._failed = 0
        self._failure = ""
        self._ending: Ending | None = None

    def begin(self) -> None:
        """Write a JUnit file that says that nothing has ended, lest an older one is taken for this run's.

        Raises Diagnostic where it cannot be written, and for another file in its place, which stays: then and later.
        """
        self._junit.begin()

    def executed(self, result: Result, *, counts: bool = True) -> None:
        """Take the result of a line. `counts`: its failure is one of the script."""
        self._lines += 1
        self._checks += result.check
        self._failed += not result.ok
        if self._json:
            write(sys.stdout, json.dumps(result.fact()))
        if counts and self._junit.wanted and (result.check or not result.ok):
            self._cases.append(Case.of(result))

    def ended(self, ending: Ending) -> None:
        self._ending = ending

    def wrong(self, problems: tuple[Diagnostic, ...]) -> None:
        """Report a script that was not executed."""
        for each in problems:
            self._cases.append(Case(each.where or self._name, self._name, error=str(each)))
        self.finish(2)

    def finish(self, code: int) -> int:
        """Write the summary and the JUnit file; return the exit code."""
        seconds = (datetime.now().astimezone() - self._begun).total_seconds()
        if self._json:
            summary = {"lines": self._lines, "failed": self._failed, "seconds": round(seconds, 3)}
            summary |= self._ending.fact() if self._ending is not None else {}
            write(sys.stdout, json.dumps({"summary": summary}))
        elif self._checks:
            words = f"{self._lines} lines, {self._checks} checks, {self._failed} failed, {seconds:.1f} s"
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

    async def watched(self, session: Session, urls: list[str], roles: list[tuple[str, str]]) -> None:
        """Open URLs, and those of roles under their names; keep the reason of a failure for the report."""
        with self.noting("ended while it was being opened"):
            await session.open_all(urls)
            for name, url in roles:
                await session.open(url, name)

    @contextlib.contextmanager
    def noting(self, cut: str = "ended before it was done") -> Iterator[None]:
        """Keep the reason of a failure, for a report without a line that failed. `cut`: that of an interruption."""
        try:
            yield
        except FAILURES as failure:
            self._failure = described(failure)
            raise
        except asyncio.CancelledError:
            self._failure = cut
            raise
