"""The process of one life of the session: it may be killed at an operation, and nothing of it takes effect any more.

A context variable names the process in each of its tasks, callbacks and threads. The loop skips what a dead process has
left there, the kernel closes its ports and its files, and an operation that it still tries raises `Killed` again. Its
coroutines are unwound in the next turn, so that no `finally` of them is left for the garbage collection.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextvars import Context, ContextVar, copy_context
from typing import Any, Protocol, TypeVar

T = TypeVar("T")
MOST = 100
"""The largest number of awaits in the clean-up of one coroutine."""


class Killed(BaseException):
    """The process is dead."""


class Loop(Protocol):
    """What a process asks of the loop that runs it: see `clock.SimulatedLoop`."""

    def create_future(self) -> asyncio.Future[Any]:
        """Make a future."""

    def create_task(self, coro: Any, *, context: Context | None = None) -> asyncio.Task[Any]:
        """Make a task."""

    def call_soon(self, callback: Callable[..., object], *args: Any, context: Context | None = None) -> object:
        """Call in the next turn."""

    def tasks_of(self, process: Process) -> list[asyncio.Task[Any]]:
        """The tasks of a process that are not done, in the order in which they began."""

    def forget(self, process: Process) -> None:
        """Call back nothing of a process any more."""


class Process:
    """A process: its number, and its death. `at_death` holds what the kernel and the world do then, in order."""

    def __init__(self, number: int, loop: Loop) -> None:
        self.number = number
        self.dead = False
        self.death: asyncio.Future[None] = loop.create_future()
        self.context = copy_context()
        self.context.run(PROCESS.set, self)
        self.at_death: list[Callable[[], None]] = []
        self.tasks: list[asyncio.Task[Any]] = []
        """The tasks that its death has left in the middle."""
        self.routines: Callable[[], list[Any]] = list
        """Gives the generators that are in the middle of something."""
        self._loop = loop
        self._left = 0
        """The number of operations until the kill that is armed; 0: none is."""
        self._moment = self._of = ""

    def run(self, work: Callable[..., T], *arguments: Any) -> T:
        """Call something as this process."""
        return self.context.copy().run(work, *arguments)

    def start(self, work: Any) -> asyncio.Task[Any]:
        """Begin a task of this process."""
        return self._loop.create_task(work, context=self.context.copy())

    def arm(self, operations: int, moment: str, of: str = "") -> None:
        """Kill it `before`, `within` or `after` an operation, the first one being 1. 0: never.

        `of`: only operations on the `disk` count; empty: all.
        """
        self._left, self._moment, self._of = operations, moment, of

    def operate(self, work: Callable[[], T], part: Callable[[], object] | None = None, of: str = "") -> T:
        """Do one operation on a disk or a wire, unless it is dead. `part`: does a part of it, as a kill within does."""
        if self.dead:
            raise Killed
        if not self._left or (self._of and of != self._of):
            return work()
        self._left -= 1
        if self._left:
            return work()
        if self._moment == "after":
            work()
        elif self._moment == "within" and part is not None:
            part()
        self.die()
        raise Killed

    def die(self) -> None:
        """End at once: nothing that it has begun goes on."""
        if self.dead:
            return
        self.tasks = self._loop.tasks_of(self)
        self.dead, self._left = True, 0
        self._loop.forget(self)
        for each in self.at_death:
            each()
        self._loop.call_soon(self._unwind, context=Context())
        if not self.death.done():
            self.death.set_result(None)

    def bury(self, task: asyncio.Task[Any]) -> None:
        """Unwind a task that never runs again."""
        self.unwind(task.get_coro())
        task._log_destroy_pending = False  # type: ignore[attr-defined]
        asyncio.tasks._unregister_task(task)

    def unwind(self, routine: Any) -> None:
        """End a coroutine or a generator: each operation of its clean-up raises again, and none of its awaits ends."""
        for _ in range(MOST):
            try:
                self.run(routine.throw, Killed())
            except BaseException:  # whatever a clean-up raises in a dead process
                return
        raise AssertionError(f"{routine} goes on after its process")

    def _unwind(self) -> None:
        for task in self.tasks:
            if not task.done():
                self.bury(task)
        for routine in self.routines():
            self.unwind(routine)


PROCESS: ContextVar[Process | None] = ContextVar("process", default=None)
"""The process that runs now; None: the world around it."""


def gone(context: Context) -> bool:
    """Whether a callback of this context belongs to a dead process."""
    process = context.get(PROCESS)
    return process is not None and process.dead


def operate(work: Callable[[], T], part: Callable[[], object] | None = None, of: str = "") -> T:
    """Do an operation of the process that runs now."""
    process = PROCESS.get()
    return work() if process is None else process.operate(work, part, of)


def outside(work: Callable[..., T], *arguments: Any) -> T:
    """Call something as the world, which no kill ends: what it plans happens."""
    token = PROCESS.set(None)
    try:
        return work(*arguments)
    finally:
        PROCESS.reset(token)
