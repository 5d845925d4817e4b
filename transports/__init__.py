"""Byte pipes: serial, TCP, UDP, RFC 2217, ssh. They carry bytes and interpret none. Here is their interface.

A transport never buffers more than it can take back. `discard` drops what was written and has not left this machine,
because a stop must not queue after the command that it is to stop.
"""

from __future__ import annotations

import struct
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Protocol

from multidrop.base.errors import TransportLost


class Descriptor(Protocol):
    """A descriptor that never blocks: `read` and `write` raise BlockingIOError instead."""

    @property
    def name(self) -> str:
        """The name for a person."""

    def fileno(self) -> int:
        """The descriptor."""

    def read(self) -> bytes | None:
        """Bytes that arrived; empty: only bytes for the endpoint itself; None: the end."""

    def write(self, data: bytes | memoryview) -> int:
        """Write, and return how many bytes the system took."""

    def unsent(self) -> int:
        """Number of bytes that the system reports as held and not sent."""

    def drop(self) -> int:
        """Take back what the system holds, if possible; return how many bytes that was."""

    def explain(self, error: OSError | None) -> str:
        """Reason of a break, and the remedy; None: the other end closed the pipe."""

    def close(self) -> None:
        """Close the descriptor; may block."""


if sys.platform != "win32":
    import fcntl
    import termios


class Unreachable(TransportLost):
    """The pipe could not be opened: no such port, in use, refused, no such host."""

    __module__ = "multidrop"


class Undelivered(TransportLost):
    """The pipe broke because the far end did not take a stop."""


Received = Callable[[bytes], None]
Lost = Callable[[TransportLost], None]


class PortControl(ABC):
    """The settings of a serial port that change while it is open.

    A call may block, so it is made in a thread. It raises OSError for a setting that the port does not have or refuses.
    """

    baud: int
    """The baud rate, bits/s, also of a port that is closed by now."""

    @abstractmethod
    def set_baud(self, baud: int) -> None:
        """Change the baud rate, bits/s; a refused one leaves the present one."""

    @abstractmethod
    def _switch(self, line: str, on: bool) -> None:
        """Switch `DTR`, `RTS` or the `break`."""

    def set_dtr(self, on: bool) -> None:
        self._switch("DTR", on)

    def set_rts(self, on: bool) -> None:
        self._switch("RTS", on)

    def set_break(self, on: bool) -> None:
        """Begin or end a break."""
        self._switch("break", on)


class Transport(ABC):
    """An open byte pipe. All of its methods but `preempt` are called from the event loop's thread."""

    name: str
    """The name for a person: `/dev/ttyUSB0`, `tcp://10.0.0.5:503`."""
    control: PortControl | None = None
    """The settings of the port; None: it is not a serial port."""
    limits = ""
    """What a person who opens it must know: promises of others that it cannot keep, another program on its port."""
    network = False
    """It leads to a network port, which may be a drive's own."""
    preemptible = False
    """Other threads can write a stop to it: `preempt` and `follow`."""
    may_invalidate = False
    """At a stop its server drops unsent bytes, too, and may make a half-sent line harmless by itself."""
    identity = ""
    """What tells the device from another one that comes to its place; empty: nothing does."""
    round_trip: float | None = None
    """The time to the far side and back, s; None: not measured."""

    @abstractmethod
    def start(self, received: Received, lost: Lost) -> None:
        """Begin to deliver bytes. The pipe calls `lost` once, and delivers nothing after that."""

    @abstractmethod
    def write(self, data: bytes) -> bool:
        """Queue bytes without blocking; return False where they were dropped.

        A broken pipe drops them and calls `lost`; a preempted one drops them silently.
        """

    @property
    def pending(self) -> int:
        """Number of bytes that were written and wait in this program."""
        return 0

    @abstractmethod
    def discard(self, whole: bool = False) -> int:
        """Drop what has not left this machine yet; return the number of bytes that are known of.

        With `whole`, a write that has begun to leave continues to its end, and the system keeps what it holds.
        """

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        """Drop what is unsent and write `make(bytes dropped)` at once, from any thread.

        `write` drops everything until `yielded` is called as often. `make` must not call the pipe. The result is False,
        and `make` is not called, where the pipe is broken or cannot do this.
        """
        return False

    def follow(self, make: Callable[[int], bytes | None], key: bool = False) -> bool:
        """Write `make(bytes that wait)` behind what was written, from any thread, and drop nothing.

        `key`: a press of the stop key. It counts as a `preempt`: `yielded` must be called for it, too. Without it, this
        works only while a `preempt` waits for its `yielded`. `make` may return no bytes, so that only what waits is
        passed on, or None. The result is False for None, and where the pipe is broken or cannot do this.
        """
        return False

    def other_user(self) -> str:
        """Name a program of this machine that has the port open, too, and the remedy; empty: none is known."""
        return ""

    def suspects(self) -> str:
        """Name the services that may have the port open, where nobody may look, and their remedies; empty: none."""
        return ""

    def yielded(self, note: Callable[[bool], None] = lambda last: None) -> bool:
        """Take note of one `preempt`; return whether it was the last, so that the loop writes again.

        `note` is called with that first, while no other thread can write.
        """
        note(True)
        return True

    @abstractmethod
    async def close(self) -> None:
        """Close the pipe without a call of `lost`. A second close has no effect."""


class NotOpen(Transport):
    """The place of a pipe that could not be opened; it breaks as it is started."""

    def __init__(self, name: str, failure: TransportLost) -> None:
        self.name, self._failure = name, failure

    def start(self, received: Received, lost: Lost) -> None:
        lost(self._failure)

    def write(self, data: bytes) -> bool:
        return False

    def discard(self, whole: bool = False) -> int:
        return 0

    async def close(self) -> None:
        """Close nothing."""


if sys.platform != "win32":

    def output_queue(descriptor: int) -> int:
        """Bytes of a tty that have not left the kernel, or of a stream socket that are not confirmed."""
        try:
            return int(struct.unpack("i", fcntl.ioctl(descriptor, termios.TIOCOUTQ, bytes(4)))[0])
        except OSError:
            return 0
