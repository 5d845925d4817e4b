"""A pipe over a blocking device, with one thread that reads and one that writes.

It serves what the event loop cannot watch: RFC 2217 through pyserial, and every port and socket on Windows. Writes wait
in a queue here and go out in small pieces, so that most of them can be taken back.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from multidrop.transports.base import PortControl
from multidrop.transports.pipe import Pipe

_JOIN = 2.0
"""Seconds that closing waits for a thread that a driver holds up; then the thread is abandoned."""


class Device(Protocol):
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

    def purge(self) -> None:
        """Tell the other end to drop what it has not sent. Called in the writing thread, before the next write."""

    def abort(self) -> int:
        """Drop what this machine holds; return how many bytes are known of. Never blocks; any thread."""

    def cancel(self) -> None:
        """End a `read` and a `write` that wait. Any thread; both may be called again before `close`."""

    def explain(self, error: OSError | None) -> str:
        """Reason of a break, and the remedy; None: the other end closed the pipe."""

    def close(self) -> None:
        """Close the device, once no other thread uses it."""


class ThreadedPipe(Pipe):
    """A transport over a `Device`."""

    def __init__(self, device: Device, control: PortControl | None = None) -> None:
        super().__init__(device.name, control)
        self._device = device
        self._turn = threading.Condition()
        self._queue: deque[bytes] = deque()
        self._purge = self._busy = self._ending = False
        self._begun = False
        """The head of the queue is the rest of a write."""
        self._threads: list[threading.Thread] = []
        self._spawn(self._write_all, "writer")

    def write(self, data: bytes) -> bool:
        """Queue bytes for the writing thread; False on a broken pipe."""
        if not data or not self._usable:
            return not data
        with self._turn:
            self._queue.append(bytes(data))
            self._turn.notify()
        return True

    @property
    def pending(self) -> int:
        """Number of bytes that the writing thread has not taken yet."""
        with self._turn:
            return sum(map(len, self._queue))

    def discard(self, whole: bool = False) -> int:
        """Drop what is queued and what this machine holds, and ask the other end to do the same if it can.

        With `whole`, drop only what has not begun to leave.
        """
        if not self._usable:
            return 0
        with self._turn:
            begun = [self._queue[0]] if whole and self._begun else []
            dropped = sum(map(len, self._queue)) - sum(map(len, begun))
            self._queue = deque(begun)
            self._purge = self._purge or not whole
            self._turn.notify()
        return dropped + (0 if whole else self._device.abort())

    def _spawn(self, work: Callable[[], None], what: str) -> None:
        thread = threading.Thread(target=work, name=f"{self._name} {what}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _post(self, function: Callable[[Any], None], value: bytes | OSError | None) -> None:
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
                self._post(self._deliver, data)

    def _write_all(self) -> None:
        while True:
            with self._turn:
                self._busy = False
                self._turn.wait_for(lambda: self._queue or self._purge or self._ending)
                if self._ending:
                    return
                purge, self._purge, self._busy = self._purge, False, True
                piece = self._take() if self._queue else b""
            try:
                if purge:
                    self._device.purge()
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
            self._turn.notify()

    def _drain(self) -> None:
        """Do nothing: earlier reads are ahead in the loop's queue."""

    def _idle(self) -> bool:
        with self._turn:
            return not self._queue and not self._busy

    def _release(self) -> None:
        self._device.cancel()
        for thread in self._threads:
            thread.join(_JOIN)
        self._device.close()

    def _explain(self, error: OSError | None) -> str:
        return self._device.explain(error)
