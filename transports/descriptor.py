"""A pipe over a non-blocking descriptor that the event loop watches.

Bytes that the system does not take at once wait here, not in a stream's buffer, so that they can be taken back.

A stop must not wait for the event loop, which may be painting or collecting garbage. So another thread may preempt the
loop: under the lock it drops what is unsent and writes the stop. The loop then writes nothing until it has taken note
of the stop (`yielded`).
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from multidrop.transports.base import PortControl
from multidrop.transports.endpoint import Endpoint
from multidrop.transports.pipe import Pipe

_READS = 64
"""Greatest number of reads of a broken pipe, for what arrived before the break."""


class DescriptorPipe(Pipe):
    """A transport over an `Endpoint`. Each `write` is first offered to the endpoint as a whole."""

    def __init__(self, endpoint: Endpoint, control: PortControl | None = None) -> None:
        super().__init__(endpoint.name, control)
        self._endpoint = endpoint
        self._pending: deque[memoryview] = deque()
        self._reading = self._writing = self._preempted = False
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
        """Number of bytes that the system has not taken yet."""
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
        begun = self._pending[0] if whole and self._pending and _begun(self._pending[0]) else None
        dropped = sum(map(len, self._pending)) - len(begun or b"")
        self._pending.clear()
        if begun:
            self._pending.append(begun)
        return dropped + (0 if whole else self._endpoint.drop())

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        """Drop what is unsent and write `make(bytes dropped)` at once, from any thread; False on a broken pipe.

        `write` drops everything until `yielded` is called. `make` must not call the pipe.
        """
        with self._guard:
            if not self._usable:
                return False
            self._preempted = True
            self._pending.append(memoryview(make(self._drop(whole))))
            problem = self._push()
        self._loop.call_soon_threadsafe(self._after_push, problem)
        return True

    def yielded(self) -> None:
        """Let the loop write again, once it has taken note of what preempted it."""
        with self._guard:
            self._preempted = False

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
        elif self._usable:
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


def _begun(chunk: memoryview) -> bool:
    """True if the system has taken the beginning of the write that this chunk is the rest of."""
    return chunk.nbytes < memoryview(chunk.obj).nbytes
