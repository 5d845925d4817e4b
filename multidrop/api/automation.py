"""The drives that the calls of one session have started, and their stop.

The calls run in tasks of their own. They share one automation of the session, which another task holds open. So a call
from any task or thread counts, and any of them can end it.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine
from contextvars import Context, ContextVar, copy_context
from typing import TYPE_CHECKING, Any, TypeVar

from multidrop.dialects import Stopped
from multidrop.shell.automation import ENDING, outcome, settled
from multidrop.shell.events import Output, Printed, SessionEvent

if TYPE_CHECKING:
    from multidrop.shell.session import Session

T = TypeVar("T")
_printed: ContextVar[list[str] | None] = ContextVar("printed", default=None)
"""The lines that the current call has printed."""


class Calls:
    """The calls of a session: one automation, until it is interrupted; then another one."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._context = Context()
        self._holder: asyncio.Task[None] | None = None
        self._over = asyncio.Event()
        self._going = False
        """Calls are accepted."""
        self._reported = 0
        """The number of stops by interruptions whose outcome was returned."""
        self._tasks: set[asyncio.Task[Any]] = set()
        session.subscribe(_collect)

    async def begin(self) -> None:
        """Begin an automation."""
        self._over.clear()
        begun = asyncio.get_running_loop().create_future()
        self._holder = asyncio.get_running_loop().create_task(self._hold(begun), context=Context())
        self._context = await begun
        self._going = True

    async def _hold(self, begun: asyncio.Future[Context]) -> None:
        async with self._session.automations.run():
            begun.set_result(copy_context())
            try:
                await self._over.wait()
            except asyncio.CancelledError:  # the loop ends, and cancels all tasks
                self._session.automations.interrupt()
                raise

    async def run(self, work: Callable[[], Coroutine[Any, Any, T]], printed: list[str] | None = None) -> T:
        """Run a call as a part of the automation; `printed` gets the lines that it prints. A stop ends it.

        Raises Stopped while an interruption ends the calls before.
        """
        if not self._going:
            raise Stopped("the session is being interrupted; nothing was sent")
        context = self._context.copy()
        context.run(_printed.set, printed)
        task = asyncio.get_running_loop().create_task(self._session.tasks.run(work()), context=context)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        try:
            return await task
        except asyncio.CancelledError:
            caller = asyncio.current_task()
            if caller is not None and caller.cancelling():
                raise
            raise Stopped("the session was interrupted; what it had started was stopped") from None

    async def interrupt(self) -> list[str]:
        """End all calls, and stop what they started; return the outcome in lines. The session can go on."""
        self._going = False
        self._session.interrupt()
        if self._tasks:  # a macro executes its `on_stop` lines
            await asyncio.wait([*self._tasks], timeout=ENDING)
        await self._end(early=True)
        every = self._session.automations.interrupted
        halts, self._reported = every[self._reported :], len(every)
        if halts:
            await settled(self._session)
        return outcome(self._session, halts)

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


def _collect(event: SessionEvent) -> None:
    """Take what the current call prints: events are published in its context."""
    lines = _printed.get()
    if lines is not None and isinstance(event, Printed | Output):
        lines.append(event.text)
