"""Pipes of the event loop: deliver bytes, break once, close once.

A pipe is open, then broken or closed. A read or a caller's `write` may break it. The pipe calls `lost` in a later turn
of the event loop, so no caller is re-entered from its own call. It first delivers what arrived before the break.
Closing lingers over bytes that were written and have not left yet, because the last of them may be a stop. A stuck pipe
delays closing by no more than that.

`DescriptorPipe` is over a non-blocking descriptor that the loop watches. Bytes that the system does not take at once
wait in it, not in a stream's buffer, so that they can be taken back. A stop must not wait for the event loop, which may
be painting or collecting garbage. So another thread may preempt the loop: under the lock it drops what is unsent and
writes the stop. The loop then writes nothing until it has taken note of the stop (`yielded`).
"""

from __future__ import annotations

import asyncio
import sys
import threading
import time
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from typing import TypeVar

from multidrop.base.errors import TransportLost
from multidrop.transports import Descriptor, Lost, PortControl, Received, Transport

LINGER = 1.0
"""Seconds that closing waits for bytes that were written and have not left: 960 bytes at 9600 baud."""
CLOSE_POLL = 0.005
"""Time between two looks, while closing, at whether all bytes have been sent, s."""

T = TypeVar("T")


def running_loop() -> asyncio.AbstractEventLoop:
    """Return the running event loop, whose clock is finer than the pauses on a wire.

    Before Python 3.13 the clock of Windows' loops goes in steps of 15.6 ms. Here it goes on with a finer one.
    """
    loop = asyncio.get_running_loop()
    if sys.platform == "win32" and sys.version_info < (3, 13):
        if type(loop).time is asyncio.BaseEventLoop.time and "time" not in vars(loop):
            ahead = loop.time() - time.perf_counter()
            vars(loop).update(time=lambda: time.perf_counter() + ahead, _clock_resolution=1e-6)
    return loop


class Pipe(Transport):
    """The common half of a transport. Created and used in the loop's thread."""

    def __init__(self, name: str, control: PortControl | None = None) -> None:
        self.name = name
        self.control = control
        self._loop = running_loop()
        self._received: Received | None = None
        self._lost: Lost | None = None
        self._broken: TransportLost | None = None
        self._told = False
        self._closing: asyncio.Task[None] | None = None
        self._released: asyncio.Future[None] | None = None

    def start(self, received: Received, lost: Lost) -> None:
        """Begin to deliver bytes. A pipe that is already broken reports it now."""
        if self._received is not None:
            raise RuntimeError(f"{self.name} was started before")
        self._received, self._lost = received, lost
        if self._broken is not None:
            self._loop.call_soon(self._tell)
        elif self._usable:
            self._begin()

    async def close(self) -> None:
        """Close the pipe. Every caller waits until it is closed; cancelling one of them stops nothing."""
        if self._closing is None:
            self._closing = self._loop.create_task(self._shut())
        await asyncio.shield(self._closing)

    @property
    def _usable(self) -> bool:
        return self._broken is None and self._closing is None

    def _deliver(self, data: bytes) -> None:
        if self._received is not None and self._closing is None and not self._told:
            self._received(data)

    def _break(self, error: OSError | None, kind: type[TransportLost] = TransportLost) -> None:
        """Mark the pipe as broken by `error`, or (None) as closed by the other end. May be called repeatedly."""
        self._halt()
        if self._broken is None:
            self._broken = kind(f"{self.name} was lost: {self._explain(error)}")
            self._loop.call_soon(self._tell)

    def _tell(self) -> None:
        if self._lost is None or self._broken is None:
            return
        self._drain()
        if self._told or self._closing is not None:
            return
        self._told = True
        self._let_go()
        self._lost(self._broken)

    async def _shut(self) -> None:
        try:
            deadline = self._loop.time() + LINGER
            while self._broken is None and not self._idle() and self._loop.time() < deadline:
                await asyncio.sleep(CLOSE_POLL)
        finally:
            self._halt()
            await asyncio.shield(self._let_go())

    def _let_go(self) -> asyncio.Future[None]:
        """Release the system's resources once, in a thread, because closing a serial port may block."""
        if self._released is None:
            self._released = self._loop.run_in_executor(None, self._release)
        return self._released

    @abstractmethod
    def _begin(self) -> None:
        """Start reading."""

    @abstractmethod
    def _halt(self) -> None:
        """Stop reading and writing, and drop what is queued. May be called repeatedly."""

    @abstractmethod
    def _drain(self) -> None:
        """Deliver what arrived before the break."""

    @abstractmethod
    def _idle(self) -> bool:
        """True if all that was written has left."""

    @abstractmethod
    def _release(self) -> None:
        """Close the descriptor or device; called once, from another thread."""

    @abstractmethod
    def _explain(self, error: OSError | None) -> str:
        """Reason of a break, and the remedy; None: the other end closed the pipe."""


async def in_thread(make: Callable[[], T], undo: Callable[[T], None]) -> T:
    """Call `make` in a thread and return its result; if the caller is cancelled meanwhile, `undo` the result."""

    def forget(late: asyncio.Future[T]) -> None:
        if not late.cancelled() and late.exception() is None:
            undo(late.result())

    made = asyncio.get_running_loop().run_in_executor(None, make)
    try:
        return await asyncio.shield(made)
    except asyncio.CancelledError:
        made.add_done_callback(forget)
        raise


_READS = 64
"""Greatest number of reads of a broken pipe, for what arrived before the break."""


class DescriptorPipe(Pipe):
    """A transport over an `Descriptor`. Each `write` is first offered to the endpoint as a whole."""

    preemptible = True

    def __init__(self, endpoint: Descriptor, control: PortControl | None = None) -> None:
        super().__init__(endpoint.name, control)
        self._endpoint = endpoint
        self._pending: deque[memoryview] = deque()
        self._reading = self._writing = False
        self._preempted = 0
        """The number of writes of other threads that the loop has not taken note of."""
        self._guard = threading.Lock()
        """Held for `_pending`, `_preempted` and each write to the endpoint; never during a callback."""

    def write(self, data: bytes) -> bool:
        """Pass bytes to the system, and keep what it does not take now; False where they were dropped."""
        if not data or not self._usable:
            return not data
        with self._guard:
            if self._preempted:
                return False
            self._pending.append(memoryview(bytes(data)))
            problem = None if self._writing else self._push()
        if problem is not None or self._wants_room():
            self._after_push(problem)
        return True

    @property
    def pending(self) -> int:
        with self._guard:
            return sum(map(len, self._pending))

    def discard(self, whole: bool = False) -> int:
        """Drop what waits here and what the system can give back; `whole`: only writes that have not begun."""
        if not self._usable:
            return 0
        with self._guard:
            dropped = self._drop(whole)
        self._watch_writable(self._wants_room())
        return dropped

    def _drop(self, whole: bool) -> int:
        rest = self._pending[0] if whole and self._pending and begun(self._pending[0]) else None
        dropped = sum(map(len, self._pending)) - len(rest or b"")
        self._pending.clear()
        if rest:
            self._pending.append(rest)
        return dropped + (0 if whole else self._endpoint.drop())

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        with self._guard:
            if not self._usable:
                return False
            self._preempted += 1
            self._pending.append(memoryview(make(self._drop(whole))))
            problem = self._push()
        self._loop.call_soon_threadsafe(self._after_push, problem)
        return True

    def follow(self, make: Callable[[int], bytes | None], key: bool = False) -> bool:
        with self._guard:
            if not self._usable or not (key or self._preempted):
                return False
            problem = self._push() if self._preempted else None  # else a line may wait that the next stop drops
            data = make(sum(map(len, self._pending))) if problem is None else None
            if data is not None:
                self._preempted += key
                self._pending += [memoryview(data)] if data else ()
                problem = self._push()
        if data is not None or problem is not None:
            self._loop.call_soon_threadsafe(self._after_push, problem)
        return data is not None

    def yielded(self, note: Callable[[bool], None] = lambda last: None) -> bool:
        with self._guard:
            self._preempted = max(0, self._preempted - 1)
            note(not self._preempted)
            return not self._preempted

    def _begin(self) -> None:
        self._reading = True
        self._loop.add_reader(self._endpoint.fileno(), self._read)

    def _read(self) -> bool:
        """Read once; return whether there may be more."""
        try:
            data = self._endpoint.read()
        except (BlockingIOError, InterruptedError):
            return False
        except OSError as error:
            self._break(error)
            return False
        if data is None:
            self._break(None)
            return False
        if data:
            self._deliver(data)
        return True

    def _send(self) -> None:
        with self._guard:
            problem = self._push()
        self._after_push(problem)

    def _push(self) -> OSError | None:
        """Pass on the waiting bytes that the system takes; return the error of a broken pipe."""
        while self._pending:
            chunk = self._pending[0]
            try:
                taken = self._endpoint.write(chunk)
            except (BlockingIOError, InterruptedError):
                return None
            except OSError as error:
                return error
            if taken < len(chunk):
                self._pending[0] = chunk[taken:]
                return None
            self._pending.popleft()
        return None

    def _after_push(self, problem: OSError | None) -> None:
        if problem is not None:
            self._break(problem)
        elif self._broken is None and self._released is None:  # also while it closes, which waits for what has not left
            self._watch_writable(self._wants_room())

    def _wants_room(self) -> bool:
        """True if the rest can leave once the descriptor is writable."""
        return bool(self._pending)

    def _watch_writable(self, wanted: bool) -> None:
        if wanted and not self._writing:
            self._loop.add_writer(self._endpoint.fileno(), self._send)
        elif self._writing and not wanted:
            self._loop.remove_writer(self._endpoint.fileno())
        self._writing = wanted

    def _halt(self) -> None:
        with self._guard:
            self._pending.clear()
        self._watch_writable(False)
        if self._reading:
            self._loop.remove_reader(self._endpoint.fileno())
            self._reading = False

    def _drain(self) -> None:
        for _ in range(_READS):
            if self._told or self._closing is not None or not self._read():
                return

    def _idle(self) -> bool:
        return not self._pending and self._endpoint.unsent() == 0

    def _release(self) -> None:
        self._endpoint.close()

    def _explain(self, error: OSError | None) -> str:
        return self._endpoint.explain(error)


def begun(chunk: memoryview) -> bool:
    """True if the system has taken the beginning of the write that this chunk is the rest of."""
    return chunk.nbytes < memoryview(chunk.obj).nbytes
