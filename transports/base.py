"""The interface of a byte pipe to the bus that owns it.

A transport never buffers more than it can take back. `discard` drops what was written and has not left this machine,
because a stop must not queue after the command that it is to stop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable


class TransportLost(Exception):
    """The pipe broke, or could not be opened. The text names the pipe and the reason."""


class Unreachable(TransportLost):
    """The pipe could not be opened: no such port, in use, refused, no such host."""


Received = Callable[[bytes], None]
Lost = Callable[[TransportLost], None]


class Transport(Protocol):
    """An open byte pipe. All of its methods are called from the event loop's thread."""

    @property
    def name(self) -> str:
        """The name for a person: `/dev/ttyUSB0`, `tcp://10.0.0.5:503`."""

    def start(self, received: Received, lost: Lost) -> None:
        """Begin to deliver bytes. The pipe calls `lost` once, and delivers nothing after that."""

    def write(self, data: bytes) -> bool:
        """Queue bytes without blocking; return False where they were dropped.

        A broken pipe drops them and calls `lost`; a preempted one (see `Preemptible`) drops them silently.
        """

    def discard(self, whole: bool = False) -> int:
        """Drop what has not left this machine yet; return the number of bytes, as far as it is known.

        With `whole`, a write that has begun to leave continues to its end, and the system keeps what it holds.
        """

    async def close(self) -> None:
        """Close the pipe without a call of `lost`. A second close has no effect."""


@runtime_checkable
class Preemptible(Protocol):
    """A transport to which another thread may write a stop, ahead of the event loop."""

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        """Drop what is unsent and write `make(bytes dropped)` at once, from any thread; False on a broken pipe.

        `write` drops everything until `yielded` is called. `make` must not call the pipe.
        """

    def yielded(self) -> None:
        """Let the loop write again, once it has taken note of what preempted it."""
