"""What is heard when several drives talk: the merging of their transmissions on one wire.

A drive's transmitter keeps its own order: it sends one byte after another, whatever the others do. On the wire,
bytes that overlap become one: the same byte sent by two at once is heard as that byte (so a global ESC, answered by
all with the same characters, looks like one answer), and different bytes are heard as their AND, since a 0 wins over
a 1. A byte that begins in the middle of another one is swallowed into it: the receiver is busy with the first.

On a paced wire "at once" is a matter of time. On an unpaced one bytes take no time, so two drives talk at once only
when the same byte from the host, or the same moment, made them talk.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Protocol


class Merger(Protocol):
    """Transmissions in, what is heard out."""

    def say(self, who: int, at: float, data: bytes) -> float:
        """Transmitter `who` begins to send at `at`, or when it is done with what it sends already; when it is over."""

    def busy(self, who: int, at: float) -> bool:
        """Whether a transmitter is still sending at that time."""

    def turn(self) -> None:
        """Another byte of the host was heard: what is said from now on has another cause."""

    def heard(self, now: float) -> bytes:
        """What has been heard in full by `now`, since it was last asked."""

    @property
    def backlog(self) -> int:
        """How many bytes are said and not heard yet."""

    @property
    def deadline(self) -> float | None:
        """When the next byte will have been heard."""

    def clear(self) -> None:
        """Forget all that is on the wire."""


class Paced:
    """A wire on which each byte takes `byte_time` seconds."""

    def __init__(self, byte_time: float) -> None:
        self._time = byte_time
        self._free: dict[int, float] = {}
        self._pending: list[tuple[float, int, int]] = []

    def say(self, who: int, at: float, data: bytes) -> float:
        """See Merger."""
        start = max(at, self._free.get(who, at))
        for n, byte in enumerate(data):
            heappush(self._pending, (start + n * self._time, who, byte))
        self._free[who] = start + len(data) * self._time
        return self._free[who]

    def busy(self, who: int, at: float) -> bool:
        """See Merger."""
        return at < self._free.get(who, at)

    def turn(self) -> None:
        """Causes do not matter where there is time."""

    def heard(self, now: float) -> bytes:
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
        self._said = 0

    def say(self, who: int, at: float, data: bytes) -> float:
        """See Merger."""
        before, cause, n = self._last.get(who, (at, self._cause, 0))
        at = max(at, before)
        if (at, self._cause) != (before, cause):
            n = 0
        heappush(self._pending, (at, self._cause, n, data))
        self._said += len(data)
        self._last[who] = (at, self._cause, n + len(data))
        return at

    def busy(self, who: int, at: float) -> bool:
        """See Merger."""
        return who in self._last and at <= self._last[who][0]

    def turn(self) -> None:
        """See Merger."""
        self._cause += 1

    def heard(self, now: float) -> bytes:
        """See Merger."""
        heard, moment = bytearray(), (0.0, -1)
        begun = 0
        while self._pending and self._pending[0][0] <= now:
            at, cause, n, data = heappop(self._pending)
            self._said -= len(data)
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
        return self._said

    @property
    def deadline(self) -> float | None:
        """See Merger."""
        return self._pending[0][0] if self._pending else None

    def clear(self) -> None:
        """See Merger."""
        self._said = 0
        self._pending.clear()
        self._last.clear()
