"""Collisions: the transmissions of several drives merged on one wire.

A drive's transmitter sends one byte after another, whatever the others do. On the wire, bytes that overlap become one.
Equal bytes give that byte, so a global ESC, to which all drives reply with the same characters, looks like one reply.
Different bytes give their AND, since a 0 wins over a 1. A byte that begins in the middle of another one is lost in it:
the receiver is busy with the first.

On a paced wire, transmissions overlap in time. On an unpaced one bytes take no time, so two drives collide only if the
same byte from the host, or the same moment, made them send.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Protocol


class Merger(Protocol):
    """Takes transmissions, and gives the bytes that receivers get."""

    def send(self, who: int, at: float, data: bytes) -> float:
        """Send bytes by a transmitter, at `at` or after what it sends already. Return the time of their end."""

    def busy(self, who: int, at: float) -> bool:
        """Whether a transmitter still sends at that time."""

    def new_cause(self) -> None:
        """Take note of a byte from the host: what is sent from now on has another cause."""

    def take(self, now: float) -> bytes:
        """Take the bytes that have arrived in full by `now`."""

    @property
    def backlog(self) -> int:
        """How many bytes are sent and not taken yet."""

    @property
    def deadline(self) -> float | None:
        """When the next byte will have arrived."""

    def clear(self) -> None:
        """Drop everything on the wire."""


class Paced:
    """A wire on which each byte takes `byte_time` seconds."""

    def __init__(self, byte_time: float) -> None:
        self._time = byte_time
        self._free: dict[int, float] = {}
        self._pending: list[tuple[float, int, int]] = []

    def send(self, who: int, at: float, data: bytes) -> float:
        """See Merger."""
        start = max(at, self._free.get(who, at))
        for n, byte in enumerate(data):
            heappush(self._pending, (start + n * self._time, who, byte))
        self._free[who] = start + len(data) * self._time
        return self._free[who]

    def busy(self, who: int, at: float) -> bool:
        """See Merger."""
        return at < self._free.get(who, at)

    def new_cause(self) -> None:
        """See Merger; where bytes take time, causes do not matter."""

    def take(self, now: float) -> bytes:
        """See Merger."""
        pending, slack = self._pending, self._time / 16
        out = bytearray()
        while pending and pending[0][0] + self._time <= now:
            start, _, value = heappop(pending)
            while pending and pending[0][0] < start + self._time - slack:
                value &= heappop(pending)[2]
            out.append(value)
        return bytes(out)

    @property
    def backlog(self) -> int:
        """See Merger."""
        return len(self._pending)

    @property
    def deadline(self) -> float | None:
        """See Merger."""
        return self._pending[0][0] + self._time if self._pending else None

    def clear(self) -> None:
        """See Merger."""
        self._pending.clear()
        self._free.clear()


class Unpaced:
    """A wire on which bytes take no time."""

    def __init__(self) -> None:
        self._cause = 0
        self._last: dict[int, tuple[float, int, int]] = {}
        self._pending: list[tuple[float, int, int, bytes]] = []
        self._waiting = 0

    def send(self, who: int, at: float, data: bytes) -> float:
        """See Merger."""
        before, cause, n = self._last.get(who, (at, self._cause, 0))
        at = max(at, before)
        if (at, self._cause) != (before, cause):
            n = 0
        heappush(self._pending, (at, self._cause, n, data))
        self._waiting += len(data)
        self._last[who] = (at, self._cause, n + len(data))
        return at

    def busy(self, who: int, at: float) -> bool:
        """See Merger."""
        return who in self._last and at <= self._last[who][0]

    def new_cause(self) -> None:
        """See Merger."""
        self._cause += 1

    def take(self, now: float) -> bytes:
        """See Merger."""
        heard, moment = bytearray(), (0.0, -1)
        begun = 0
        while self._pending and self._pending[0][0] <= now:
            at, cause, n, data = heappop(self._pending)
            self._waiting -= len(data)
            if moment != (at, cause):
                moment, begun = (at, cause), len(heard) - n
            start = begun + n
            both = max(0, min(len(heard) - start, len(data)))
            for k in range(both):
                heard[start + k] &= data[k]
            heard += data[both:]
        return bytes(heard)

    @property
    def backlog(self) -> int:
        """See Merger."""
        return self._waiting

    @property
    def deadline(self) -> float | None:
        """See Merger."""
        return self._pending[0][0] if self._pending else None

    def clear(self) -> None:
        """See Merger."""
        self._waiting = 0
        self._pending.clear()
        self._last.clear()
