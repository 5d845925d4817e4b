"""A pipe over a non-blocking descriptor, watched by the event loop.

What the system does not take at once waits here, not in a stream's buffer, so that it can be taken back.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

from transports.pipe import Pipe

_READS = 64
"""How often a broken pipe is read for what had come before it broke."""


class Endpoint(Protocol):
    """A descriptor that never blocks: `read` and `write` raise BlockingIOError when they cannot do it now."""

    @property
    def name(self) -> str:
        """What a person calls it."""

    def fileno(self) -> int:
        """The descriptor."""

    def read(self) -> bytes | None:
        """What has come; empty: nothing of interest; None: the end."""

    def write(self, data: bytes | memoryview) -> int:
        """How much of it the system took."""

    def unsent(self) -> int:
        """How many bytes the system holds that have not left, as far as it says."""

    def drop(self) -> int:
        """Take back what the system holds, where that is possible; how much that was, as far as it says."""

    def explain(self, error: OSError | None) -> str:
        """Why it broke and what to do about it; None: it came to its end."""

    def close(self) -> None:
        """Close it; may take its time."""


class DescriptorPipe(Pipe):
    """A transport over an `Endpoint`. Each `write` is handed to the endpoint as a whole first."""

    def __init__(self, endpoint: Endpoint) -> None:
        super().__init__(endpoint.name)
        self._endpoint = endpoint
        self._pending: deque[memoryview] = deque()
        self._reading = self._writing = False

    def write(self, data: bytes) -> None:
        """Hand bytes to the system, or keep what it does not take now."""
        if not data or not self._usable:
            return
        self._pending.append(memoryview(bytes(data)))
        if not self._writing:
            self._send()

    def discard(self, whole: bool = False) -> int:
        """Drop what waits here, and what the system holds and can give back; `whole`: only what has not begun."""
        if not self._usable:
            return 0
        begun = self._pending[0] if whole and self._pending and _begun(self._pending[0]) else None
        dropped = sum(map(len, self._pending)) - len(begun or b"")
        self._pending.clear()
        if begun:
            self._pending.append(begun)
        self._watch_writable(bool(self._pending))
        return dropped + (0 if whole else self._endpoint.drop())

    def _begin(self) -> None:
        self._reading = True
        self._loop.add_reader(self._endpoint.fileno(), self._read)

    def _read(self) -> bool:
        """Read once; whether there may be more."""
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
        while self._pending:
            chunk = self._pending[0]
            try:
                taken = self._endpoint.write(chunk)
            except (BlockingIOError, InterruptedError):
                break
            except OSError as error:
                self._break(error)
                return
            if taken < len(chunk):
                self._pending[0] = chunk[taken:]
                break
            self._pending.popleft()
        self._watch_writable(bool(self._pending))

    def _watch_writable(self, wanted: bool) -> None:
        if wanted and not self._writing:
            self._loop.add_writer(self._endpoint.fileno(), self._send)
        elif self._writing and not wanted:
            self._loop.remove_writer(self._endpoint.fileno())
        self._writing = wanted

    def _halt(self) -> None:
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
    """Whether the system has taken the head of what was one write."""
    return chunk.nbytes < memoryview(chunk.obj).nbytes
