"""The one clock: an event loop whose time goes on only where nothing is ready, without descriptors and without threads.

What the product does in a thread runs in the loop's thread here, after a time that the seed draws. A descriptor is a
number that an object of the simulation has; that object says when it can be read or written.
"""

from __future__ import annotations

import asyncio
import heapq
import socket
from collections.abc import Callable
from concurrent.futures import Executor
from contextvars import copy_context
from random import Random
from typing import Any, Protocol

from soak.simulation.system.process import PROCESS, Killed, Process, gone

MOST_TURNS = 5_000_000
"""Turns of the loop that no seed takes."""
LATE = 10.0
"""The longest delay of a timer, s."""


WORLD = ("soak.", "multidrop.simulator.")
"""The modules whose timers are not the loop's work: they stand for drives, the kernel, threads and the person."""

STOPS = "soak.simulation.system.pacer"


class Deadlock(AssertionError):
    """Nothing is ready and no timer is set: something waits for ever."""


class Network(Protocol):
    """What a loop asks of the network: see `network.Network`."""

    async def connect(self, made: Any, address: Any) -> None:
        """Connect a socket."""

    def listen(self, make: Callable[[], Any], host: str, port: int) -> Any:
        """Accept connections."""

    def datagrams(self, make: Callable[[], Any], address: tuple[str, int]) -> Any:
        """Take datagrams."""


class SimulatedLoop(asyncio.BaseEventLoop):
    """An event loop in virtual time. `late`: the probability that a turn of the loop begins late."""

    def __init__(self, rng: Random, late: float = 0.0) -> None:
        super().__init__()
        self.now = 0.0
        self.turns = 0
        self.late = late
        self.defects: list[dict[str, Any]] = []
        """Exceptions that nobody took."""
        self._rng = rng
        self._selector = self
        """`BaseEventLoop` asks it what is ready, and how long to wait."""
        self._readers: dict[int, asyncio.Handle] = {}
        self._writers: dict[int, asyncio.Handle] = {}
        self.descriptors = 1000
        """The number of the last one."""
        self.network: Network
        self._starved = False
        self._made = 0
        """The number of tasks so far."""
        self.set_exception_handler(self._defect)

    def _defect(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        process = getattr(context.get("future"), "process", None)
        if not isinstance(context.get("exception"), Killed) and (process is None or not process.dead):
            self.defects.append(context)

    # What asyncio asks of a loop

    def time(self) -> float:
        """Virtual seconds, from 0."""
        return self.now

    def select(self, timeout: float | None) -> list[Any]:
        """Let the time pass until the next timer; a starved loop sees it late."""
        self.turns += 1
        if timeout is None:
            raise Deadlock("nothing is ready, and no timer is set")
        if self.turns > MOST_TURNS:
            raise Deadlock(f"the loop turns for ever, at {self.now:.1f} s")
        self.now += max(0.0, timeout)
        if self.late and self._rng.random() < self.late:
            self.starve(self._rng.random() ** 4 * LATE)
        return []

    def starve(self, seconds: float) -> None:
        """Let the loop do nothing for so long, while drives, the kernel, threads and the person go on."""
        self._pass(seconds, _of_the_world)

    def hold(self, seconds: float) -> None:
        """Let the work under way take so long. The thread that writes stops goes on; all others are late."""
        self._pass(seconds, _writes_stops)

    def _pass(self, seconds: float, goes_on: Callable[[asyncio.TimerHandle], bool]) -> None:
        until = self.now + seconds
        before, self._starved = self._starved, True
        timers: list[asyncio.TimerHandle] = self._scheduled  # type: ignore[attr-defined]
        later: list[asyncio.TimerHandle] = []
        while timers and timers[0]._when <= until:  # type: ignore[attr-defined]
            timer = heapq.heappop(timers)
            if not goes_on(timer):
                later.append(timer)
                continue
            timer._scheduled = False  # type: ignore[attr-defined]
            self.now = max(self.now, timer._when)  # type: ignore[attr-defined]
            if timer.cancelled():
                self._timer_cancelled_count -= 1  # type: ignore[attr-defined]
            else:
                timer._run()
        for timer in later:
            heapq.heappush(timers, timer)
        self._starved = before
        self.now = max(self.now, until)

    def close(self) -> None:
        """Close the loop."""
        self._readers.clear()
        self._writers.clear()
        super().close()

    def _process_events(self, event_list: list[Any]) -> None:
        """Do nothing: what becomes readable or writable calls back by itself."""

    def _write_to_self(self) -> None:
        """Do nothing: there is one thread."""

    def run_in_executor(  # type: ignore[override]
        self, executor: Executor | None, func: Callable[..., Any], *arguments: Any
    ) -> asyncio.Future[Any]:
        """Run blocking work in the loop's thread, after a short time."""
        future = self.create_future()

        def work() -> None:
            if future.cancelled():
                return  # the thread would run on, and nobody would see what it does: see `world`
            try:
                result = func(*arguments)
            except Exception as error:  # of any kind: whoever awaits it takes it
                future.set_exception(error)
            else:
                future.set_result(result)

        self.call_later(self._rng.random() * 0.002, work)
        return future

    # The network

    async def getaddrinfo(  # type: ignore[override]
        self, host: str, port: int, *, type: int = 0, **how: Any
    ) -> list[tuple[Any, ...]]:
        """Look up a host: each has one address, which is its name."""
        await asyncio.sleep(self._rng.random() * 0.001)
        return [(socket.AF_INET, type, 0, "", (host, port))]

    async def sock_connect(self, sock: Any, address: Any) -> None:
        """Connect a socket of the simulation."""
        await self.network.connect(sock, address)

    async def create_server(  # type: ignore[override]
        self, protocol_factory: Any, host: str, port: int
    ) -> Any:
        """Listen."""
        return self.network.listen(protocol_factory, host, port)

    async def create_datagram_endpoint(  # type: ignore[override]
        self, protocol_factory: Any, local_addr: tuple[str, int]
    ) -> Any:
        """Take datagrams."""
        return self.network.datagrams(protocol_factory, local_addr)

    # Processes

    def _call_soon(self, callback: Any, args: Any, context: Any) -> asyncio.Handle:
        handle: asyncio.Handle = super()._call_soon(callback, args, context)  # type: ignore[misc]
        if gone(handle._context):  # type: ignore[attr-defined]
            handle.cancel()
        return handle

    def call_at(  # type: ignore[override]
        self, when: float, callback: Any, *args: Any, context: Any = None
    ) -> asyncio.TimerHandle:
        """Call at a time, unless the process that wants it is dead then."""
        timer = super().call_at(when, callback, *args, context=context)
        if gone(timer._context):  # type: ignore[attr-defined]
            timer.cancel()
        return timer

    def create_task(self, coro: Any, *, name: Any = None, context: Any = None) -> asyncio.Task[Any]:
        """Make a task; one of a dead process never begins."""
        task = super().create_task(coro, name=name, context=context)
        process = (copy_context() if context is None else context).get(PROCESS)
        if process is not None:
            self._made += 1
            task.of = (process, self._made)  # type: ignore[attr-defined]
            if process.dead:
                process.bury(task)
        return task

    def create_future(self) -> asyncio.Future[Any]:
        """Make a future that knows its process: nobody takes what one of a dead process holds."""
        future = super().create_future()
        future.process = PROCESS.get()  # type: ignore[attr-defined]
        return future

    def tasks_of(self, process: Process) -> list[asyncio.Task[Any]]:
        """The tasks of a process that are not done, in the order in which they began."""
        found = [each for each in asyncio.all_tasks(self) if getattr(each, "of", (None, 0))[0] is process]
        return sorted(found, key=lambda each: each.of[1])  # type: ignore[attr-defined]

    def forget(self, process: Process) -> None:
        """Call back nothing of a process any more."""
        of = [*self._ready, *self._scheduled, *self._readers.values(), *self._writers.values()]  # type: ignore[attr-defined]
        for handle in of:
            if not handle.cancelled() and handle._context.get(PROCESS) is process:
                handle.cancel()
        for watched in (self._readers, self._writers):
            for fd in [fd for fd, handle in watched.items() if handle.cancelled()]:
                del watched[fd]

    # Descriptors

    def descriptor(self) -> int:
        """A number for a new simulated descriptor."""
        self.descriptors += 1
        return self.descriptors

    def add_reader(self, fd: int, callback: Callable[..., Any], *arguments: Any) -> None:  # type: ignore[override]
        """Call back while a descriptor can be read."""
        if gone(copy_context()):
            return
        self._readers[fd] = asyncio.Handle(callback, arguments, self, None)
        self.call_soon(self.readable, fd)

    def remove_reader(self, fd: int) -> bool:  # type: ignore[override]
        """Call back no longer."""
        return self._removed(self._readers, fd)

    def add_writer(self, fd: int, callback: Callable[..., Any], *arguments: Any) -> None:  # type: ignore[override]
        """Call back while a descriptor can be written."""
        if gone(copy_context()):
            return
        self._writers[fd] = asyncio.Handle(callback, arguments, self, None)
        self.call_soon(self.writable, fd)

    def remove_writer(self, fd: int) -> bool:  # type: ignore[override]
        """Call back no longer."""
        return self._removed(self._writers, fd)

    def readable(self, fd: int) -> None:
        """Call the reader of a descriptor, if there is one."""
        if self._starved:
            self.call_soon(self.readable, fd)
        elif (handle := self._readers.get(fd)) is not None:
            handle._run()

    def writable(self, fd: int) -> None:
        """Call the writer of a descriptor, if there is one."""
        if self._starved:
            self.call_soon(self.writable, fd)
        elif (handle := self._writers.get(fd)) is not None:
            handle._run()

    @staticmethod
    def _removed(handles: dict[int, asyncio.Handle], fd: int) -> bool:
        handle = handles.pop(fd, None)
        if handle is not None:
            handle.cancel()
        return handle is not None


def _of_the_world(timer: asyncio.TimerHandle) -> bool:
    """Whether a timer goes on while the loop is starved."""
    return _module(timer).startswith(WORLD)


def _writes_stops(timer: asyncio.TimerHandle) -> bool:
    """Whether a timer is of the thread that writes the pieces of stops."""
    return _module(timer) == STOPS


def _module(timer: asyncio.TimerHandle) -> str:
    called = timer._callback  # type: ignore[attr-defined]
    owner = type(called.__self__) if hasattr(called, "__self__") else called
    return str(getattr(owner, "__module__", ""))
