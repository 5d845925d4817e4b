"""The ports of this machine: descriptors of the simulated kernel between the product's pipes and simulated wires.

`transports.pipe.DescriptorPipe` runs on them as on a tty or a socket: a write is taken in part or not at all, a read
brings what has come so far, a flush takes back what has not left, a hang-up is an error of a read or a write.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from random import Random

from multidrop.simulator.serving.running import RunningFloor
from soak.simulation.climate import Climate
from soak.simulation.clock import SimulatedLoop

ROOM = 4095
"""Bytes that a tty takes before a write has to wait."""


# A write takes a part, or nothing now; a read brings a part of what is there, or comes up to 20 ms late with what came
# meanwhile: the kinds "part", "full", "split" and "late read" of the climate.


class Port:
    """An open descriptor of a simulated bus. `flushes`: what has not left can be taken back, as on a tty."""

    def __init__(
        self,
        name: str,
        loop: SimulatedLoop,
        floor: RunningFloor,
        bus: str,
        rng: Random,
        climate: Climate,
        trace: Callable[[str, bytes], None],
        flushes: bool = True,
    ) -> None:
        self._name, self._loop, self._floor, self._bus = name, loop, floor, bus
        self._rng, self.climate, self._trace, self._flushes = rng, climate, trace, flushes
        self._descriptor = loop.descriptor()
        self._received = bytearray()
        self._source = floor.source()
        self._gone = False
        self._waiting = False
        self.closed = False
        self._detach = floor.attach(bus, self)

    # The kernel's side of a descriptor

    @property
    def name(self) -> str:
        """The name for a person."""
        return self._name

    def fileno(self) -> int:
        """The descriptor."""
        return self._descriptor

    def read(self) -> bytes | None:
        """Bytes that have come."""
        if not self._received:
            if self._gone:
                raise OSError(errno.EIO, "Input/output error")
            raise BlockingIOError(errno.EAGAIN, "no bytes")
        size = len(self._received)
        if size > 1 and self._rng.random() < self.climate["split"]:
            size = self._rng.randrange(1, size)
        data = bytes(self._received[:size])
        del self._received[:size]
        if self._received or self._gone:
            self._wake()
        self._trace("<", data)
        return data

    def write(self, data: bytes | memoryview) -> int:
        """Take bytes, as many as there is room for."""
        if self._gone or self.closed:
            raise OSError(errno.EIO, "Input/output error")
        room = ROOM - self.unsent()
        if room <= 0 or self._rng.random() < self.climate["full"]:
            self._loop.call_later(0.001 + self._rng.random() * 0.01, self._loop.writable, self._descriptor)
            raise BlockingIOError(errno.EAGAIN, "no room")
        size = min(len(data), room)
        if size > 1 and self._rng.random() < self.climate["part"]:
            size = self._rng.randrange(1, size)
        if size < len(data):
            self._loop.call_later(0.001 + self._rng.random() * 0.01, self._loop.writable, self._descriptor)
        self._trace(">", bytes(data[:size]))
        self._floor.write(self._bus, bytes(data[:size]), self._source)
        return size

    def unsent(self) -> int:
        """Bytes that the kernel holds."""
        return self._floor.floor.wires[self._bus].queued(self._source)

    def drop(self) -> int:
        """Take back what the kernel holds."""
        return self._floor.retract(self._bus, self._source) if self._flushes and not self._gone else 0

    def explain(self, error: OSError | None) -> str:
        """The reason of a break."""
        return "unplugged" if error is not None else "closed by the other end"

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
            self._wake()

    def unplugged(self) -> None:
        """The adapter is pulled: reads and writes fail from now on."""
        self._gone = True
        self._wake()

    def plugged(self) -> None:
        """Do nothing: a descriptor of a pulled adapter stays dead."""

    def disconnected(self) -> None:
        """The other end has gone."""
        self.unplugged()

    def connectable(self) -> None:
        """Do nothing: somebody has to connect anew."""

    def _wake(self) -> None:
        if self._waiting:
            return
        self._waiting = True
        late = self._rng.random() * 0.02 if self._rng.random() < self.climate["late read"] else 0.0
        self._loop.call_later(late, self._readable)

    def _readable(self) -> None:
        self._waiting = False
        self._loop.readable(self._descriptor)
