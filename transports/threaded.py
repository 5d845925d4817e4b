"""A pipe over a device whose calls block, with one thread that reads and one that writes.

It serves what the loop cannot watch: every port and socket on Windows. What was read waits for the loop, and where that
is much, the reading thread waits, so a flood stays in the port. Writes wait in a queue and go out in small pieces, so
that most of them can be taken back. A stop of another thread takes the place of the queue, and the writing thread
writes it. A close that the driver holds up is given up, in a thread of its own: neither the loop nor the end of the
process waits for it.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from multidrop.transports import PortControl
from multidrop.transports.pipe import Pipe

_JOIN = 0.9
"""Seconds that closing waits for the threads that a driver holds up; then they are abandoned."""
_GIVEN_UP = 1.0
"""Seconds after which a close that a driver holds up is given up."""
_UNREAD = 32 * 1024
"""The number of received bytes that wait for the loop before the reading thread waits, too: 2.8 s at 115,200 baud."""
closing: set[str] = set()
"""The names of the devices whose close has not returned."""


class BlockingDevice(Protocol):
    """A blocking device. Raises OSError (pyserial's errors are that, too) when it is broken."""

    @property
    def name(self) -> str:
        """The name for a person."""

    @property
    def piece(self) -> int:
        """Number of bytes per write; 0: each write as a whole."""

    def read(self) -> bytes | None:
        """Wait for bytes; empty: none arrived for a while; None: the end. Called in the reading thread."""

    def write(self, data: bytes) -> None:
        """Write all bytes. Called in the writing thread."""

    def abort(self) -> int:
        """Drop what this machine holds; return how many bytes are known of. Never blocks; any thread."""

    def cancel(self) -> None:
        """End a `read` and a `write` that wait. Any thread; both may be called again before `close`."""

    def explain(self, error: OSError | None) -> str:
        """Reason of a break, and the remedy; None: the other end closed the pipe."""

    def close(self) -> None:
        """Close the device, once no other thread uses it."""


class ThreadedPipe(Pipe):
    """A transport over a `BlockingDevice`."""

    preemptible = True

    def __init__(self, device: BlockingDevice, control: PortControl | None = None) -> None:
        super().__init__(device.name, control)
        self._device = device
        self._turn = threading.Condition()
        self._queue: deque[bytes] = deque()
        self._arrived = bytearray()
        """What was received and waits for the loop."""
        self._busy = self._ending = False
        self._begun = False
        """The head of the queue is the rest of a write."""
        self._preempted = 0
        """The number of stops of other threads that the loop has not taken note of."""
        self._threads: list[threading.Thread] = []
        self._spawn(self._write_all, "writer")

    def write(self, data: bytes) -> bool:
        if not data or not self._usable:
            return not data
        with self._turn:
            if self._preempted:
                return False
            self._queue.append(bytes(data))
            self._turn.notify_all()
        return True

    @property
    def pending(self) -> int:
        with self._turn:
            return sum(map(len, self._queue))

    def discard(self, whole: bool = False) -> int:
        """Drop what is queued and what is held here; `whole`: what has not begun."""
        if not self._usable:
            return 0
        with self._turn:
            return self._drop(whole)

    def _drop(self, whole: bool) -> int:
        begun = [self._queue[0]] if whole and self._begun and self._queue else []
        dropped = sum(map(len, self._queue)) - sum(map(len, begun))
        self._queue, self._begun = deque(begun), bool(begun)
        self._turn.notify_all()
        return dropped + (0 if whole else self._device.abort())

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        with self._turn:
            if not self._usable or self._ending:
                return False
            self._preempted += 1
            dropped = self._drop(whole)
            self._queue.append(bytes(make(dropped)))
        return True

    def follow(self, make: Callable[[int], bytes | None], key: bool = False) -> bool:
        with self._turn:
            if not self._usable or self._ending or not (key or self._preempted):
                return False
            if (data := make(sum(map(len, self._queue)) + self._busy)) is None:
                return False
            self._preempted += key
            if data:
                self._queue.append(bytes(data))
                self._turn.notify_all()
        return True

    def yielded(self, note: Callable[[bool], None] = lambda last: None) -> bool:
        with self._turn:
            self._preempted = max(0, self._preempted - 1)
            note(not self._preempted)
            return not self._preempted

    def _spawn(self, work: Callable[[], None], what: str) -> None:
        thread = threading.Thread(target=work, name=f"{self.name} {what}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _post(self, function: Callable[[Any], None], value: OSError | None) -> None:
        """Call a function in the loop's thread; end if the loop has ended."""
        try:
            self._loop.call_soon_threadsafe(function, value)
        except RuntimeError:
            self._ending = True

    def _read_all(self) -> None:
        while not self._ending:
            try:
                data = self._device.read()
            except OSError as error:
                self._post(self._break, error)
                return
            if data is None:
                self._post(self._break, None)
                return
            if data:
                with self._turn:
                    self._turn.wait_for(lambda: len(self._arrived) < _UNREAD or self._ending)
                    known = bool(self._arrived)
                    self._arrived += data
                if not known:
                    self._post(self._hand_over, None)

    def _hand_over(self, _: None) -> None:
        with self._turn:
            data = bytes(self._arrived)
            self._arrived.clear()
            self._turn.notify_all()
        self._deliver(data)

    def _write_all(self) -> None:
        while True:
            with self._turn:
                self._busy = False
                self._turn.wait_for(lambda: self._queue or self._ending)
                if self._ending:
                    return
                self._busy, piece = True, self._take()
            try:
                if piece:
                    self._device.write(piece)
            except OSError as error:
                self._post(self._break, error)
                return

    def _take(self) -> bytes:
        whole = self._queue.popleft()
        piece = self._device.piece or len(whole)
        self._begun = len(whole) > piece
        if self._begun:
            self._queue.appendleft(whole[piece:])
        return whole[:piece]

    def _begin(self) -> None:
        self._spawn(self._read_all, "reader")

    def _halt(self) -> None:
        with self._turn:
            self._queue.clear()
            self._ending = True
            self._turn.notify_all()

    def _drain(self) -> None:
        """Do nothing: earlier reads are ahead in the loop's queue."""

    def _idle(self) -> bool:
        with self._turn:
            return not self._queue and not self._busy

    def _let_go(self) -> asyncio.Future[None]:
        """Release the device once, in a thread that nothing waits for: a driver may hold up the close for ever."""
        if self._released is None:
            self._released = released = self._loop.create_future()

            def settle(_: None) -> None:
                if not released.done():
                    released.set_result(None)

            def release() -> None:
                self._release()
                self._post(settle, None)

            closing.add(self.name)
            self._spawn(release, "close")
            self._loop.call_later(_GIVEN_UP, settle, None)
        return self._released

    def _release(self) -> None:
        until = time.monotonic() + _JOIN
        self._device.cancel()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(max(0.0, until - time.monotonic()))
        self._device.close()
        closing.discard(self.name)

    def _explain(self, error: OSError | None) -> str:
        return self._device.explain(error)
