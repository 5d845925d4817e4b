"""The report of a Python program under `multidrop run`: the lines that it sends, and the place of its failure."""

from __future__ import annotations

import contextlib
import sys
import traceback
from collections.abc import Callable, Coroutine, Iterator
from datetime import datetime
from itertools import dropwhile, takewhile
from linecache import getline
from types import FrameType
from typing import Any, TypeVar

import multidrop
from multidrop.api.blocking import Session
from multidrop.api.sessions import Notice
from multidrop.dialects import Stopped
from multidrop.shell.events import FAILURES, Entered, Output, Printed, SessionEvent
from multidrop.shell.front.report import Report
from multidrop.shell.scripts.model import Result, ScriptLine

T = TypeVar("T")


def result_of(end: BaseException, file: str, number: int) -> Result:
    """The result of the line at which a program ended."""
    line = ScriptLine(file, number, getline(file, number).strip() or file)
    error = str(end) if isinstance(end, FAILURES) else f"{type(end).__name__}: {end}".removesuffix(": ")
    failed = isinstance(end, AssertionError)
    return Result(line, line.text, datetime.now().astimezone(), 0.0, error=error, failed_check=failed)


class ReportedSession(Session):
    """A session that reports what each call of a program sends and prints."""

    def __init__(self, file: str, report: Report | None, *, yes: bool, notice: Notice) -> None:
        self._file = file
        self._report = report
        self._out = sys.stdout
        self.stopped_by_person = False
        self._sent: list[Entered] = []
        self._printed: list[str] = []
        self._failed: tuple[BaseException, Result] | None = None
        """The last call, if it failed, and its result: the program may end with it, or go on."""
        super().__init__(yes=yes, notice=notice)
        self.awaited.shell.subscribe(self._take)

    def _take(self, event: SessionEvent) -> None:
        if isinstance(event, Entered):
            self._sent.append(event)
        elif isinstance(event, Printed | Output):
            self._printed.append(event.text)

    def call(self, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Await work, and report it if it has sent a line."""
        self.went_on()
        self._sent, self._printed = [], []
        begun = datetime.now().astimezone()
        try:
            done = super().call(work)
        except FAILURES as failure:
            if self._sent:
                self._failed = failure, self._result(str(failure), begun)
            raise
        if self._sent:
            self._tell(self._result("", begun))
        return done

    def resume(self) -> None:
        """Let commands be sent again after a stop of the program's own. Raises Stopped after one of a person."""
        if self.stopped_by_person:
            raise Stopped("Ctrl+X stopped every drive; this program sends nothing more")
        super().resume()

    def went_on(self) -> None:
        """Report the failure of the call before: the program has caught it."""
        if self._failed is not None:
            self._tell(self._failed[1])
            self._failed = None

    def ended(self, end: BaseException) -> Result | None:
        """The result of the call with whose failure the program ended; None if it was none."""
        failed, self._failed = self._failed, None
        if failed is not None and failed[0] is end:
            return failed[1]
        if failed is not None:
            self._tell(failed[1])
        return None

    def _tell(self, result: Result) -> None:
        if self._report is not None:
            with replaced("stdout", self._out):
                self._report.executed(result, counts=False)

    def _result(self, error: str, begun: datetime) -> Result:
        first, text = self._sent[0], "; ".join(each.line for each in self._sent)
        seconds = (datetime.now().astimezone() - begun).total_seconds()
        line = ScriptLine(self._file, _called_at(self._file), text)
        return Result(line, text, begun, seconds, tuple(self._printed), first.bus, first.address, error)


def _called_at(file: str) -> int:
    """The line of the program that is being executed."""
    frame: FrameType | None = sys._getframe()
    while frame is not None and frame.f_code.co_filename != file:
        frame = frame.f_back
    return frame.f_lineno if frame is not None else 0


def place(end: BaseException, file: str) -> int:
    """The line of the program at which it ended; 0: none."""
    lines = [number for frame, number in traceback.walk_tb(end.__traceback__) if frame.f_code.co_filename == file]
    return lines[-1] if lines else 0


def traceback_of(end: BaseException) -> list[str]:
    """The traceback without the frames of multidrop."""
    found = traceback.TracebackException.from_exception(end)
    each: traceback.TracebackException | None = found
    ours = _ours()
    while each is not None:
        frames: list[traceback.FrameSummary] = list(each.stack)
        inside = dropwhile(lambda frame: frame.filename in ours, frames)
        kept: list[traceback.FrameSummary] = list(takewhile(lambda frame: frame.filename not in ours, inside))
        each.stack = traceback.StackSummary.from_list(kept)
        each = each.__cause__ or each.__context__
    return "".join(found.format()).rstrip().splitlines()


def _ours() -> set[str]:
    """The files of multidrop that run."""
    loaded = [module for name, module in sys.modules.items() if name.partition(".")[0] == multidrop.__name__]
    return {getattr(module, "__file__", None) or "" for module in loaded}


@contextlib.contextmanager
def replaced(name: str, stream: object) -> Iterator[None]:
    """Replace a standard stream while the body runs."""
    before = getattr(sys, name)
    setattr(sys, name, stream)
    try:
        yield
    finally:
        setattr(sys, name, before)
