"""The calls of a program's session: what they have started, and its stop.

The calls run in tasks of their own. They share one automation of the session, which another task holds open. So a call
from any task or thread counts, and any of them can end it.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar
from weakref import WeakKeyDictionary, WeakSet

from multidrop.api.returns import Returns
from multidrop.api.streams import AsyncStream
from multidrop.api.telemetry import AsyncTelemetry
from multidrop.base.errors import Diagnostic, Stopped, TransportLost
from multidrop.drives.conversations import refuse_stranger
from multidrop.drives.drive import Drive
from multidrop.shell import stop_report
from multidrop.shell.automation import END_TIMEOUT, outcome, settled
from multidrop.shell.events import FAILURES, By
from multidrop.shell.origin import Origin
from multidrop.shell.session import Session
from multidrop.transports import Unreachable

T = TypeVar("T")
S = TypeVar("S", bound="AsyncStream[Any]")
CLOSED = ("the session is closed", "session", "connect(URL) opens one")


class Lost(TransportLost):
    """The connection is lost. The text says what is known of the call; nothing of it is sent again.

    `unproven`: the command of which it is not known whether it was executed; empty: none is in doubt.
    """

    __module__ = "multidrop"


def lost(error: TransportLost) -> TransportLost:
    """What a call raises for a loss."""
    if isinstance(error, Unreachable | Lost):
        return error
    known = error.unproven or error.executed
    lost = Lost(str(error) if known else f"{error}; no command of this call is in doubt")
    lost.unproven, lost.executed = error.unproven, error.executed
    for note in getattr(error, "__notes__", ()):
        lost.add_note(note)
    return lost


class Calls:
    """The calls of a session: one automation, until it is interrupted; then another one."""

    def __init__(self) -> None:
        self._shell: Session | None = None
        self._holder: asyncio.Task[None] | None = None
        self._over = asyncio.Event()
        self._going = self._closing = False
        """Calls are accepted; the session is being closed."""
        self._reported = 0
        """The number of stops by interruptions whose outcome was returned."""
        self._tasks: set[asyncio.Task[Any]] = set()
        self._moves: WeakKeyDictionary[Drive, asyncio.Lock] = WeakKeyDictionary()
        self._streams: WeakSet[AsyncStream[Any]] = WeakSet()
        self.returns: Returns | None = None
        """What compares the drives after a lost connection; None: no connection comes back."""

    @property
    def opened(self) -> bool:
        """True if the session is open."""
        return self._shell is not None

    @property
    def accepted(self) -> bool:
        """True if the session is open, and not being closed."""
        return self._shell is not None and not self._closing

    @property
    def shell(self) -> Session:
        """The session of the house, with its events and everything else. Raises Diagnostic where none is open."""
        if self._shell is None:
            raise Diagnostic(*CLOSED)
        return self._shell

    def open(self, shell: Session) -> None:
        """Take the session that the calls are for; `begin` follows."""
        self._shell, self._closing = shell, False

    def closing(self) -> bool:
        """Refuse further calls, as the session is being closed; return False where it was before."""
        if not self.accepted:
            return False
        self._closing = True
        return True

    def closed(self) -> Session:
        """End all telemetry, and give the session up."""
        shell, self._shell = self.shell, None
        for stream in self._streams:
            stream.close()
        if self.returns is not None:
            self.returns.close()
        return shell

    def moves(self, drive: Drive) -> asyncio.Lock:
        """The lock of a drive for moves of several lines."""
        return self._moves.setdefault(drive, asyncio.Lock())

    def telemetry(self, drives: Sequence[Drive], rate: float) -> AsyncTelemetry:
        """Begin to read drives until the session is closed. Raises Diagnostic; Inexpressible for a stranger."""
        if not rate > 0:
            raise Diagnostic(f"no rate {rate:g}", "telemetry", "valid: above 0, samples a second; math.inf")
        for drive in drives:
            refuse_stranger(drive.state, self.shell.display_name(drive))
        return self.kept(AsyncTelemetry(self.shell, drives, rate))

    def kept(self, stream: S) -> S:
        """Close a stream with the session."""
        self._streams.add(stream)
        return stream

    async def begin(self) -> None:
        """Begin an automation."""
        self._over.clear()
        begun = asyncio.get_running_loop().create_future()
        self._holder = asyncio.get_running_loop().create_task(self._hold(begun))
        self.shell.origin = await begun
        self._going = True

    async def _hold(self, begun: asyncio.Future[Origin]) -> None:
        async with self.shell.automations.run(Origin(By.SCRIPT)) as origin:
            begun.set_result(origin)
            try:
                await self._over.wait()
            except asyncio.CancelledError:  # the loop ends, and cancels all tasks
                self.shell.automations.interrupt()
                raise

    async def run(self, work: Callable[[Origin], Coroutine[Any, Any, T]], printed: list[str] | None = None) -> T:
        """Run a call as a part of the automation; `printed` gets the lines that it prints. A stop ends it.

        `work` takes the origin of the lines of the call.

        Raises Stopped while an interruption ends the calls before, Diagnostic where the session is closed.
        """
        if not self.accepted:
            raise Diagnostic(*CLOSED)
        if self.returns is not None:
            await self.returns.compared()
        if not self._going:
            raise Stopped("the session is being interrupted; nothing was sent")
        origin = replace(self.shell.origin, printed=printed)
        task = asyncio.get_running_loop().create_task(self.shell.tasks.run(work(origin)))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        try:
            return await task
        except FAILURES as error:  # without the way that it came: a person reads the line
            raise (lost(error) if isinstance(error, TransportLost) else error).with_traceback(None) from None
        except asyncio.CancelledError:
            caller = asyncio.current_task()
            if caller is not None and caller.cancelling():
                raise
            raise Stopped("the session was interrupted; what it had started was stopped") from None

    async def interrupt(self) -> list[str]:
        """End all calls, and stop what they started; return the outcome in lines. The session can go on."""
        self._going = False
        self.shell.interrupt()
        if self._tasks:  # a macro executes its `on_early_end` lines
            await asyncio.wait([*self._tasks], timeout=END_TIMEOUT)
        await self._end(early=True)
        every = self.shell.automations.interrupted
        halts, self._reported = every[self._reported :], len(every)
        if halts:
            await settled(self.shell)
        return outcome(self.shell, halts)

    async def end(self) -> None:
        """End the automation as a success: what it started goes on."""
        self._going = False
        await self._end(early=False)

    async def _end(self, early: bool) -> None:
        holder, self._holder = self._holder, None
        if holder is None:
            return
        if early:
            holder.cancel()
        self._over.set()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.wait([holder])


@dataclass(frozen=True)
class StopReport:
    """The state of the drives after a stop, as far as it is known. It reads as one line."""

    at_rest: bool
    """Every drive that it was for was read at velocity 0 since."""
    text: str

    def __str__(self) -> str:
        return self.text


class WrittenStop:
    """A stop that is written. Await it for its report; it works without that, too."""

    def __init__(self, shell: Session, tally: Callable[[], stop_report.FateTally]) -> None:
        self._shell, self._tally = shell, tally

    def __await__(self) -> Generator[Any, None, StopReport]:
        """Wait until the stop is confirmed or not, 3 s at most."""
        return self._report().__await__()

    async def _report(self) -> StopReport:
        await settled(self._shell)
        tally = self._tally()
        return StopReport(tally.stand, stop_report.words(tally))
