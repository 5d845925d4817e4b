"""The ports of this machine: descriptors of the simulated kernel between the product's pipes and simulated wires.

`transports.pipe.DescriptorPipe` runs on them as on a tty or a socket: a write is taken in part or not at all, a read
brings what has come so far, a flush takes back what has not left, a hang-up is an error of a read or a write.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from random import Random

from multidrop.simulator.serving.running import Listener, RunningFloor
from soak.simulation.records.climate import Climate
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.process import Process

FEW = 3
"""Bytes that an empty buffer of a socket takes whole."""
GATHER = 0.7
"""How many ports gather the bytes of a reply, as hardware mostly does; the others bring each byte by itself."""
ROOM = 4095
"""Bytes that a tty takes before a write has to wait."""


# A write takes a part, or nothing now; a read brings a part of what is there, or comes up to 20 ms late with what came
# meanwhile: the kinds "part", "full", "split" and "late read" of the climate.


Trace = Callable[[str, bytes], None]
"""Notes the bytes that were written (">") or read ("<"), and a write of which nothing was taken ("=")."""


class Descriptor:
    """An open descriptor: what is common to a tty and a socket."""

    def __init__(self, loop: SimulatedLoop, rng: Random, climate: Climate, trace: Trace) -> None:
        self.loop, self.rng, self.climate, self.trace = loop, rng, climate, trace
        self.closed = False
        self.owner: Process | None = None
        """The process whose it is; None: the world's."""
        self.rest = 0
        """Bytes of a write that has begun and that the kernel has not taken."""
        self._descriptor = loop.descriptor()
        self._waiting = False

    def fileno(self) -> int:
        """The descriptor."""
        return self._descriptor

    def piece(self, arrived: bytearray, most: int) -> bytes:
        """Take a piece of the bytes that have come."""
        size = min(len(arrived), most)
        if size > 1 and self.climate.happens("split", self.rng):
            size = self.rng.randrange(1, size)
        data = bytes(arrived[:size])
        del arrived[:size]
        self.trace("<", data)
        return data

    def taken(self, data: bytes | memoryview, room: int, busy: bool = True) -> int:
        """The number of bytes of a write that are taken now; all or a part unless `busy`. Raises BlockingIOError."""
        if room <= 0 or (busy and self.climate.happens("full", self.rng)):
            self.loop.call_later(0.001 + self.rng.random() * 0.01, self.loop.writable, self._descriptor)
            self.trace("=", b"")
            raise BlockingIOError(errno.EAGAIN, "no room")
        size = min(len(data), room)
        if size > (1 if busy else FEW) and self.climate.happens("part", self.rng):
            size = self.rng.randrange(1, size)
        if size < len(data):
            self.loop.call_later(0.001 + self.rng.random() * 0.01, self.loop.writable, self._descriptor)
        self.trace(">", bytes(data[:size]))
        self.rest = len(data) - size
        return size

    def wake(self) -> None:
        """Let the reader read, perhaps late."""
        if self._waiting:
            return
        self._waiting = True
        if self.climate.happens("late read", self.rng):
            self.loop.call_later(self.rng.random() * 0.02, self._readable)
        else:
            self.loop.call_soon(self._readable)

    def _readable(self) -> None:
        self._waiting = False
        self.loop.readable(self._descriptor)


class Port(Descriptor, Listener):
    """An open tty on the wire of a bus. What has not left can be taken back."""

    def __init__(
        self,
        loop: SimulatedLoop,
        floor: RunningFloor,
        bus: str,
        rng: Random,
        climate: Climate,
        trace: Trace,
        baud: int | None = None,
    ) -> None:
        super().__init__(loop, rng, climate, trace)
        self.baud = baud
        self._floor, self._bus = floor, bus
        self._received = bytearray()
        self._source = floor.source()
        self._gone = False
        self.gathers = rng.random() < GATHER
        self._detach = floor.attach(bus, self)

    # The kernel's side of a descriptor

    def recv(self, most: int) -> bytes:
        """Bytes that have come."""
        if not self._received:
            if self._gone:
                raise OSError(errno.EIO, "Input/output error")
            raise BlockingIOError(errno.EAGAIN, "no bytes")
        data = self.piece(self._received, most)
        if self._received or self._gone:
            self.wake()
        return data

    def send(self, data: bytes | memoryview) -> int:
        """Take bytes, as many as there is room for."""
        if self._gone or self.closed:
            raise OSError(errno.EIO, "Input/output error")
        size = self.taken(data, ROOM - self.unsent())
        self._floor.write(self._bus, bytes(data[:size]), self._source, self.baud)
        return size

    @property
    def readable(self) -> bool:
        """Whether a read does not wait."""
        return bool(self._received or self._gone)

    @property
    def writable(self) -> bool:
        """Whether a write does not wait."""
        return self._gone or self.unsent() < ROOM

    def unsent(self) -> int:
        """Bytes that the kernel holds."""
        return self._floor.floor.wires[self._bus].queued(self._source)

    def drop(self) -> None:
        """Take back what the kernel holds."""
        if not self._gone:
            self._floor.retract(self._bus, self._source)

    def close(self) -> None:
        """Close the descriptor."""
        if not self.closed:
            self.closed = True
            self._detach()

    # The wire's side

    def receive(self, data: bytes) -> None:
        """Take bytes from the wire."""
        if not self._gone and not self.closed:
            self._received += data
            self.wake()

    def unplugged(self) -> None:
        """The adapter is pulled: reads and writes fail from now on."""
        self._gone = True
        self.wake()

    def disconnected(self) -> None:
        """The other end has gone."""
        self.unplugged()
