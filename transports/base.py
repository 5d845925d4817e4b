"""What every byte pipe offers to the bus that owns it.

A transport never buffers more than it can take back: what was written but has not left this machine can be
dropped with `discard`, because a stop must not stand in a queue behind the command that it is to stop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable


class TransportLost(Exception):
    """The pipe broke, or could not be opened. The text says which pipe and why."""


class Unreachable(TransportLost):
    """The pipe could not be opened: no such port, in use, refused, no such host."""


Received = Callable[[bytes], None]
Lost = Callable[[TransportLost], None]


class Transport(Protocol):
    """An open byte pipe. All of its methods are called from the event loop's thread."""

    @property
    def name(self) -> str:
        """What a person calls it: `/dev/ttyUSB0`, `tcp://10.0.0.5:503`."""

    def start(self, received: Received, lost: Lost) -> None:
        """Begin to deliver bytes. `lost` is called once, after which nothing more is delivered."""

    def write(self, data: bytes) -> None:
        """Queue bytes without blocking. On a broken pipe nothing is queued; `lost` tells of it."""

    def discard(self, whole: bool = False) -> int:
        """Drop what has not left this machine yet; how many bytes that was, as far as can be known.

        With `whole` a write that has begun to leave goes on to its end, and what the system holds is left to it.
        """

    async def close(self) -> None:
        """Close it. `lost` is not called. Closing twice does no harm."""


@runtime_checkable
class Preemptible(Protocol):
    """A transport that another thread may write a stop to, ahead of the event loop."""

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        """Drop what is unsent and write `make(bytes dropped)` at once, from any thread; False on a broken pipe.

        `write` drops everything from then until `yielded`. `make` must not call the pipe.
        """

    def yielded(self) -> None:
        """The loop has taken note of what preempted it: it may write again."""
