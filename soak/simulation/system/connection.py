"""A connection of the network of a seed: its host, and its two ends, between which bytes are on their way."""

from __future__ import annotations

import errno
import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Protocol

from soak.simulation.system.clock import SimulatedLoop

WINDOW = 8192
"""Bytes that an end sends ahead of what the other end has read."""
CONFIRMED, PROBED = 5.0, 8.0
"""Seconds without a confirmation in which a system gives up a connection with bytes on their way, and a silent one."""
LATER = 2.0
"""The longest delay of a segment, a datagram or a reply, s."""
Address = tuple[str, int]


def error(number: int) -> OSError:
    """The error of a system call."""
    return OSError(number, os.strerror(number))


class Network(Protocol):
    """What the end of a connection asks of its network: see `network.Network`."""

    loop: SimulatedLoop
    rng: Random

    def delay(self, kind: str = ..., spared: bool = ...) -> float:
        """The time that something is on its way."""

    def drawn(self, kind: str) -> bool:
        """Whether a fault of this kind happens now."""


@dataclass
class Host:
    """A host as it can be reached: it refuses connections, and nothing passes, until these times (s)."""

    name: str
    refuses: float = 0.0
    dark: float = 0.0
    spared: bool = False
    """No fault of the climate meets it."""


class End:
    """One end of a connection: what has arrived at it, and what is on its way to the other end."""

    other: End

    def __init__(self, network: Network, host: Host) -> None:
        self.network, self.host = network, host
        self.received = bytearray()
        self.flying = 0
        """Bytes on their way to the other end."""
        self.failed = 0
        """The error of the connection here."""
        self.ended = False
        """The other end sends nothing more."""
        self.closed = False
        self.woken: Callable[[], None] = lambda: None
        """Called where something has changed."""
        self._way: deque[tuple[Callable[[], None], int]] = deque()
        self._arrives = 0.0

    @property
    def gone(self) -> bool:
        """Whether the connection is over for its owner."""
        return bool(self.failed or self.closed)

    @property
    def room(self) -> int:
        """Bytes that may be sent now."""
        return WINDOW - self.flying - len(self.other.received)

    def send(self, data: bytes) -> None:
        """Send bytes."""
        self.flying += len(data)
        self._pass(lambda: self.other.arrive(data), len(data))
        if self.host.dark > self.network.loop.now:
            self.network.loop.call_later(CONFIRMED, self.give_up)

    def finish(self) -> None:
        """Send the end of the stream."""
        self._pass(self.other.finished, 0)

    def close(self) -> None:
        """Close this end; what it has sent arrives."""
        self.finish()
        self.closed = True

    def arrive(self, data: bytes) -> None:
        """Bytes have come."""
        self.received += data
        self.woken()

    def finished(self) -> None:
        """The end of the stream has come."""
        self.ended = True
        self.woken()

    def fail(self, number: int) -> None:
        """The connection has ended here: what was on its way is lost."""
        if not self.gone:
            self.failed = number
            self._way.clear()
            self.flying = 0
            self.woken()

    def give_up(self) -> None:
        """Fail, if the host is still dark."""
        if self.host.dark > self.network.loop.now:
            self.fail(errno.ETIMEDOUT)

    def _pass(self, arrive: Callable[[], None], size: int) -> None:
        self._way.append((arrive, size))
        self._arrives = max(self._arrives + 1e-7, self.network.loop.now + self.network.delay(spared=self.host.spared))
        self.network.loop.call_at(self._arrives, self._deliver)

    def _deliver(self) -> None:
        loop = self.network.loop
        if not self._way:
            return
        if self.host.dark > loop.now:
            loop.call_at(self.host.dark + 0.01 + self.network.rng.random() * 0.2, self._deliver)
            return
        arrive, size = self._way.popleft()
        self.flying -= size
        if not self.other.gone:
            arrive()
        elif size:
            self.fail(errno.ECONNRESET)
        self.woken()
