"""The blocking session: the awaited one in a thread of its own. It works in a notebook, whose own loop runs already."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Coroutine
from types import TracebackType
from typing import Any, TypeVar

from multidrop.api import endings
from multidrop.api.blocking_drive import Drive
from multidrop.api.blocking_telemetry import Telemetry
from multidrop.api.drives import AsyncDrive
from multidrop.api.runs import Run
from multidrop.api.sessions import CLOSED, AsyncSession, Notice, log
from multidrop.api.stopping import StopReport
from multidrop.api.telemetry import RATE, AsyncTelemetry
from multidrop.api.threads import LoopThread, Notices
from multidrop.dialects import Diagnostic

T = TypeVar("T")


class Session:
    """Open connections and their drives: `with connect(URL) as session`. Any thread may use it.

    Leaving the block by an exception stops every drive that it has set in motion. So do an interruption (Ctrl+C) of a
    call, and the end of the process while it is open.
    """

    def __init__(self, *urls: str, yes: bool = False, notice: Notice = log) -> None:
        """Open the connections; see `connect`."""
        self._notices = Notices(notice)
        self.awaited = AsyncSession(urls, yes=yes, notice=self._notices)
        self.thread = LoopThread()
        self.leaving = contextlib.ExitStack()
        """What ends after everything is closed, and before the thread does."""
        try:
            self.call(self.awaited.open)
        except BaseException:
            self.thread.end()
            self._notices.end()
            raise
        endings.opened(self)

    # Beginning and end

    def __enter__(self) -> Session:
        """Return it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it; after an exception stop what was started, and say what the stop did not reach."""
        self._close(stop=failure is not None)

    def add(self, /, *urls: str, **named: str) -> None:
        """Open further connections; those with a name become buses of that name. Moves nothing."""
        self.call(lambda: self.awaited.add(*urls, **named))

    def close(self) -> None:
        """Close everything. Drives go on as they are. May be called again."""
        self._close(stop=False)

    def end_early(self) -> None:
        """Stop what was started, and close."""
        self._close(stop=True)

    def _close(self, stop: bool) -> None:
        endings.closing(self)
        if self.thread.alive:
            try:
                self.call(lambda: self.awaited.close(stop=stop))
            finally:
                self.leaving.close()
            self.thread.end()
            self._notices.end()
        endings.closed(self)

    def call(self, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Await work in the session's thread. An interruption while waiting stops what the session started."""
        if not self.thread.alive:
            raise Diagnostic(*CLOSED)
        future = None
        try:
            future = self.thread.begin(work())
            return future.result()
        except (KeyboardInterrupt, SystemExit):  # of this thread: no call raises them
            if future is None or not future.done():
                self._interrupted()
            raise

    def _interrupted(self) -> None:
        with contextlib.suppress(Diagnostic):
            self.thread.begin(self.awaited.interrupt()).result()

    # Drives

    @property
    def drives(self) -> list[Drive]:
        """Every drive that was found."""

        async def found() -> list[AsyncDrive]:
            return self.awaited.drives

        return [Drive(self, each) for each in self.call(found)]

    def drive(self, address: str = "", axis: str = "") -> Drive:
        """The drive at an address: `a`, `press:a`, a name of the saved connection; without one the selected drive.

        `axis`: for a drive with several, such as `y`; by default the first. Raises Diagnostic, NoAnswer.
        """

        async def found() -> AsyncDrive:
            return self.awaited.drive(address, axis)

        return Drive(self, self.call(found))

    # Lines, scripts, samples

    def send(self, line: str) -> list[str]:
        """Run a line as typed at the prompt (`PR P`, `@b MR 100`, `/drives`); return the lines that it prints."""
        return self.call(lambda: self.awaited.send(line))

    def run(self, file: str, /, **values: object) -> Run:
        """Execute a script of lines. It is checked whole before; `values` are those of `--set`. Raises its failure."""
        return self.call(lambda: self.awaited.run(file, **values))

    def telemetry(self, *addresses: str, rate: float = RATE) -> Telemetry:
        """Read position and velocity of drives (all without an address), each `rate` times a second at most.

        A rate of `math.inf` is as fast as the line allows.
        """

        async def begin() -> AsyncTelemetry:
            return self.awaited.telemetry(*addresses, rate=rate)

        return Telemetry(self, self.call(begin))

    # Stop

    def stop(self) -> StopReport:
        """Stop every drive on every connection now, ahead of everything; return what is known of them then.

        It ends calls of other threads with Stopped, and refuses calls that send commands until `resume`.
        """
        shell = self.awaited.shell

        async def stop() -> StopReport:
            return await self.awaited.stop()

        shell.stop_ahead()
        try:
            return self.call(stop)
        except (KeyboardInterrupt, SystemExit):
            self.thread.soon(shell.stop)  # which must follow what was written ahead
            raise

    def resume(self) -> None:
        """Let commands be sent again after a stop."""
        self.call(self.awaited.resume)

    def _repr_html_(self) -> str:
        """Return a table of the drives, for a notebook."""
        return self.awaited._repr_html_()


def connect(*urls: str, yes: bool = False) -> Session:
    """Open connections as on the command line: ports, URLs, saved connections, `sim:`. Moves nothing.

    `yes`: questions, such as that of a restore, are answered with yes beforehand. Raises Diagnostic for a wrong URL,
    Unreachable where there is no connection, NoAnswer where no drive replies.
    """
    return Session(*urls, yes=yes)
