"""`multidrop run SCRIPT.py`: a Python program with a session, its report, its exit code, the stop of what it started.

The program runs in the main thread, the session in a thread of its own. A signal and the stop key raise in the program.
"""

from __future__ import annotations

import contextlib
import io
import linecache
import os
import signal
import sys
import traceback
from collections.abc import Callable, Coroutine, Iterator
from datetime import datetime
from functools import partial
from importlib.util import decode_source
from itertools import dropwhile, takewhile
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any, TypeVar

import multidrop
from multidrop import script
from multidrop.api.blocking import Session
from multidrop.api.sessions import Notice
from multidrop.base.errors import Diagnostic, Stopped
from multidrop.base.files import bytes_of
from multidrop.shell.batch.report import BatchReport
from multidrop.shell.channel import Front
from multidrop.shell.events import FAILURES, Entered, Output, Printed, SessionEvent
from multidrop.shell.exit_codes import INTERRUPTED, exit_code
from multidrop.shell.operations.argument_types import Agreeing, Opening
from multidrop.shell.prompt.keyboard import on_stop_key, terminal
from multidrop.shell.scripts.model import LineResult, ScriptLine
from multidrop.shell.signals import SIGNALS, early_ends
from multidrop.shell.streams.stdout import fail, lost_reader, why_interrupted, work_done, write

T = TypeVar("T")


def result_of(end: BaseException, file: str, number: int) -> LineResult:
    line = ScriptLine(file, number, linecache.getline(file, number).strip() or file)
    error = str(end) if isinstance(end, FAILURES) else f"{type(end).__name__}: {end}".removesuffix(": ")
    failed = isinstance(end, AssertionError)
    return LineResult(line, line.text, datetime.now().astimezone(), 0.0, error=error, failed_check=failed)


class ReportedSession(Session):
    """A session that reports what each call of a program sends and prints."""

    def __init__(self, file: str, report: BatchReport | None, *, yes: bool, beyond: bool, notice: Notice) -> None:
        self._file = file
        self._report = report
        self._out = sys.stdout
        self._stopped_by_person = False
        self._sent: list[Entered] = []
        self._printed: list[str] = []
        self._failed: tuple[BaseException, LineResult] | None = None
        """The last call, if it failed, and its result: the program may end with it, or go on."""
        super().__init__(yes=yes, beyond=beyond, notice=notice)
        self._awaited._shell.front = Front()  # a person agrees by the options of the command
        self._awaited._shell.subscribe(self._take, Entered, Printed, Output)

    def person_stopped(self) -> None:
        """Note that a person has pressed the stop key: what fails then is no failure of the program."""
        self._stopped_by_person = True

    def _take(self, event: SessionEvent) -> None:
        if isinstance(event, Entered):
            self._sent.append(event)
        elif isinstance(event, Printed | Output):
            self._printed.append(event.text)

    def _call(self, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Await work, and report it if it has sent a line."""
        self.went_on()
        self._sent, self._printed = [], []
        begun = datetime.now().astimezone()
        try:
            done = super()._call(work)
        except FAILURES as failure:
            if self._sent:
                self._failed = failure, self._result(str(failure), begun)
            raise
        if self._sent:
            self._tell(self._result("", begun))
        return done

    def resume(self) -> None:
        """Let commands be sent again after a stop of the program's own. Raises Stopped after one of a person."""
        if self._stopped_by_person:
            raise Stopped("Ctrl+X stopped every drive; this program sends nothing more")
        super().resume()

    def went_on(self) -> None:
        """Report the failure of the call before: the program has caught it."""
        if self._failed is not None:
            self._tell(self._failed[1])
            self._failed = None

    def ended(self, end: BaseException) -> LineResult | None:
        """The result of the call with whose failure the program ended; None if it was none."""
        failed, self._failed = self._failed, None
        if failed is not None and failed[0] is end:
            return failed[1]
        if failed is not None:
            self._tell(failed[1])
        return None

    def _tell(self, result: LineResult) -> None:
        if self._report is not None:
            with replaced("stdout", self._out):
                self._report.executed(result, counts=False)

    def _result(self, error: str, begun: datetime) -> LineResult:
        first, text = self._sent[0], "; ".join(entered.line for entered in self._sent)
        seconds = (datetime.now().astimezone() - begun).total_seconds()
        frame: FrameType | None = sys._getframe()
        while frame is not None and frame.f_code.co_filename != self._file:
            frame = frame.f_back
        line = ScriptLine(self._file, frame.f_lineno if frame is not None else 0, text)
        return LineResult(line, text, begun, seconds, tuple(self._printed), first.bus, first.address, error)


def place(end: BaseException, file: str) -> int:
    """The line of the program at which it ended; 0: none."""
    lines = [number for frame, number in traceback.walk_tb(end.__traceback__) if frame.f_code.co_filename == file]
    return lines[-1] if lines else 0


def traceback_of(end: BaseException) -> list[str]:
    trace = traceback.TracebackException.from_exception(end)
    cause: traceback.TracebackException | None = trace
    loaded = [module for name, module in sys.modules.items() if name.partition(".")[0] == multidrop.__name__]
    ours = {getattr(module, "__file__", None) or "" for module in loaded}
    while cause is not None:
        frames: list[traceback.FrameSummary] = list(cause.stack)
        inside = dropwhile(lambda frame: frame.filename in ours, frames)
        kept: list[traceback.FrameSummary] = list(takewhile(lambda frame: frame.filename not in ours, inside))
        cause.stack = traceback.StackSummary.from_list(kept)
        cause = cause.__cause__ or cause.__context__
    return "".join(trace.format()).rstrip().splitlines()


@contextlib.contextmanager
def replaced(name: str, stream: object) -> Iterator[None]:
    before = getattr(sys, name)
    setattr(sys, name, stream)
    try:
        yield
    finally:
        setattr(sys, name, before)


def run(file: str, opening: Opening, as_json: bool, agreeing: Agreeing, report: BatchReport) -> int:
    try:
        data = bytes_of(file)
        code = compile(data, file, "exec", dont_inherit=True)  # before anything is opened
    except SyntaxError as error:
        problem = Diagnostic(f"{error.msg}", f"{file}:{error.lineno or 1}")
    except ValueError as error:  # a NUL
        problem = Diagnostic(f"is not Python: {error}", file)
    except Diagnostic as error:
        problem = error
    else:
        # Reports quote the lines that run, whatever the file holds by then.
        linecache.cache[file] = (len(data), None, decode_source(data).splitlines(True), file)
        return report.finish(_Execution(file, opening, as_json, agreeing, report, code).run())
    return report.refused(problem)


class _Execution:
    """One program: its signals, its session, and how it ended."""

    def __init__(
        self, file: str, opening: Opening, as_json: bool, agreeing: Agreeing, report: BatchReport, code: CodeType
    ) -> None:
        self._opening, self._as_json, self._agreeing = opening, as_json, agreeing
        self._report = report
        self._code = code
        self._file = file
        self._stopped = self._interrupted = self._ending = False
        self._on_continue: list[Callable[[], None]] = []
        self._called: LineResult | None = None
        """The result of the call with whose failure the program ended."""

    def run(self) -> int:
        with contextlib.ExitStack() as around:
            around.enter_context(self._signals())
            try:
                with self._session() as session:
                    try:
                        self._execute(session)
                        if self._interrupted:  # the program caught it and went on to its end
                            raise KeyboardInterrupt
                    finally:
                        self._ending = True
                        work_done()
                code = 0
            except BaseException as end:
                self._ending = True
                code = self._ended(end)
        if self._stopped:
            return exit_code(Stopped())
        return INTERRUPTED if self._interrupted else code

    # Signals and the stop key

    @contextlib.contextmanager
    def _signals(self) -> Iterator[None]:
        with early_ends():
            for each in SIGNALS:
                signal.signal(each, self._signalled)
            if sys.platform == "win32":
                yield
                return
            before = signal.signal(signal.SIGCONT, self._continued)
            try:
                yield
            finally:
                signal.signal(signal.SIGCONT, before)

    def _signalled(self, number: int, frame: object) -> None:
        """Raise in the program; the end of it is not cut off."""
        if self._ending:
            return
        if self._stopped:
            raise Stopped("Ctrl+X stopped every drive")
        self._interrupted = True
        raise KeyboardInterrupt

    def _continued(self, number: int, frame: object) -> None:
        for callback in self._on_continue:
            callback()

    # The session

    @contextlib.contextmanager
    def _session(self) -> Iterator[Session]:
        report, agreeing = self._report if self._as_json else None, self._agreeing
        opened = ReportedSession(self._file, report, yes=agreeing.yes, beyond=agreeing.beyond, notice=_say)
        with opened:
            self._watch_keys(opened)
            opened.add(*self._opening.on, **dict(self._opening.role))
            try:
                yield opened
            except BaseException as end:
                self._called = opened.ended(end)
                raise
            opened.went_on()

    def _watch_keys(self, session: ReportedSession) -> None:
        """Watch for the stop key, to the end of the session, where standard input is a terminal: it belongs to it."""
        shell = session._awaited._shell

        def stop() -> None:
            self._stopped = True
            session.person_stopped()
            shell.stop("Ctrl+X")
            _interrupt()

        def after_continue(callback: Callable[[], None]) -> Callable[[], object]:
            self._on_continue.append(partial(session._thread.soon, callback))
            return self._on_continue.clear

        keys = on_stop_key(shell.stop_ahead, stop, _interrupt, after_continue)
        session._thread.enter(keys, session._leaving)
        if self._on_continue or (sys.platform == "win32" and terminal() is not None):
            session._leaving.enter_context(replaced("stdin", _NoInput()))

    # The program

    def _execute(self, session: Session) -> None:
        module = ModuleType("__main__")
        module.__file__ = self._file
        with contextlib.ExitStack() as around:
            around.enter_context(_main(module, self._file))
            if self._as_json:
                around.enter_context(replaced("stdout", sys.stderr))
            script.session, script.values = session, dict(self._opening.set)
            around.callback(lambda: [script.__dict__.pop(name) for name in ("session", "values")])
            exec(self._code, module.__dict__)

    def _ended(self, end: BaseException) -> int:
        """Say why a program ended; return its exit code."""
        if isinstance(end, SystemExit):
            if end.code is None or isinstance(end.code, int):
                return end.code or 0
            write(sys.stderr, str(end.code))
            return 1
        if isinstance(end, KeyboardInterrupt) or lost_reader(end):
            write(sys.stderr, why_interrupted())
            return INTERRUPTED
        line = place(end, self._file)
        if isinstance(end, FAILURES):
            if line:
                end.add_note(f"{self._file}:{line}")
            code = fail(end)
        else:
            write(sys.stderr, *traceback_of(end))
            code = 1
        self._report.executed(self._called or result_of(end, self._file, line))
        return code


def _say(text: str, warning: bool) -> None:
    write(sys.stderr, text)


def _interrupt() -> None:
    if sys.platform == "win32":
        signal.raise_signal(signal.SIGINT)  # `os.kill` there ends the process
    else:
        os.kill(os.getpid(), signal.SIGINT)


class _NoInput(io.TextIOBase):
    """Standard input while the terminal belongs to the stop key."""

    def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]
        raise Diagnostic("the terminal belongs to the stop key here", "input", "give values with --set NAME=VALUE")

    read = readline


@contextlib.contextmanager
def _main(module: ModuleType, file: str) -> Iterator[None]:
    """Make a program the main module, with its folder in the path."""
    main, arguments, path = sys.modules["__main__"], sys.argv, sys.path[:]
    sys.modules["__main__"], sys.argv = module, [file]
    sys.path.insert(0, str(Path(file).resolve().parent))
    try:
        yield
    finally:
        sys.modules["__main__"], sys.argv, sys.path[:] = main, arguments, path
