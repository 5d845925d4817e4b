"""Position and velocity of drives as they are read: an iterator of samples."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING

from multidrop.api.samples import Sample, Samples
from multidrop.drives.events import Lost
from multidrop.drives.events import Sample as Read
from multidrop.shell.events import OnBus, SessionEvent

if TYPE_CHECKING:
    from multidrop.api.owner import Owner
    from multidrop.drives.drive import Drive
    from multidrop.drives.telemetry import Subscription

RATE = 50.0
"""Samples of each drive a second, at most."""
KEPT = 200_000
"""The number of samples that wait to be taken; then the oldest are dropped."""


class AsyncTelemetry:
    """Samples from now until `close`, the end of the session, or the loss of a line. Polls only while it is open."""

    def __init__(self, owner: Owner, drives: Sequence[Drive], rate: float = RATE) -> None:
        """Begin to read. A rate of `math.inf` is as fast as the line allows."""
        self.missed = 0
        """The number of samples that were dropped because the program did not take them."""
        self._shell = owner.shell
        self._names = {(drive.link.name, drive.address): self._shell.display_name(drive) for drive in drives}
        self._rows: deque[Sample] = deque()
        self._news = asyncio.Event()
        self._lost: Exception | None = None
        self._begun = self._shell.now()
        period = 1.0 / rate
        self._leave = self._shell.subscribe(self._take)
        self._subscriptions = [self._subscribe(bus, period) for bus in dict.fromkeys(bus for bus, _ in self._names)]
        self._open = True

    def _subscribe(self, bus: str, period: float) -> Subscription[str]:
        return self._shell.buses[bus].telemetry.subscribe([own for name, own in self._names if name == bus], period)

    def _take(self, event: SessionEvent) -> None:
        if not isinstance(event, OnBus):
            return
        if isinstance(event.event, Read) and (event.bus, event.event.address) in self._names:
            self._rows.append(self._sample(event.bus, event.event))
            if len(self._rows) > KEPT:
                self._rows.popleft()
                self.missed += 1
        elif isinstance(event.event, Lost) and any(bus == event.bus for bus, _ in self._names):
            self._lost = event.event.error
        else:
            return
        self._news.set()

    def _sample(self, bus: str, read: Read) -> Sample:
        at, wall = read.at - self._begun, self._shell.wall(read.at).timestamp()
        return Sample(at, wall, self._names[bus, read.address], read.axis, read.position, read.velocity)

    def close(self) -> None:
        """End it. Samples that came can still be taken. May be called again."""
        if self._open:
            self._open = False
            self._leave()
            for each in self._subscriptions:
                each.close()
            self._news.set()

    async def __aenter__(self) -> AsyncTelemetry:
        """Return it; the end of the block closes it."""
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def __aiter__(self) -> AsyncTelemetry:
        """Return it."""
        return self

    async def __anext__(self) -> Sample:
        """Wait for the next sample. Raises TransportLost once the samples before the loss are taken."""
        while not self._rows:
            if self._lost is not None:
                raise self._lost
            if not self._open:
                raise StopAsyncIteration
            self._news.clear()
            await self._news.wait()
        return self._rows.popleft()

    async def samples(self) -> Samples:
        """Take all samples that have come and were not taken yet."""
        rows, self._rows = self._rows, deque()
        return Samples(rows)
