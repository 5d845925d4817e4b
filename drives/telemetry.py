"""Position and velocity polled at the lowest priority, only while somebody looks."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dialects import DriveError, NoAnswer, Priority
from drives.events import Sample, Silent, Transaction
from transports import TransportLost

if TYPE_CHECKING:
    from drives.bus import Bus

FASTEST = 0.02
"""Seconds between two samples of one drive at the least: nobody sees more, and others need the wire."""
AFTER_SILENCE = 1.0
"""Seconds for which a drive that did not answer is left alone, and once more for each time that it did not."""
LONGEST_SILENCE = 5
RATE_OVER = 2.0
SHORTEST = 0.001


@dataclass(eq=False)
class Subscription:
    """Somebody looks at some drives. Close it to end that."""

    telemetry: Telemetry
    addresses: tuple[str, ...]
    period: float

    def close(self) -> None:
        """Look no longer."""
        self.telemetry.unsubscribe(self)


@dataclass
class _Poll:
    due: float = 0.0
    silences: int = 0
    times: deque[float] = field(default_factory=lambda: deque(maxlen=200))


class Telemetry:
    """The poller of one bus; its samples are events of the bus."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._subscriptions: list[Subscription] = []
        self._polls: dict[str, _Poll] = {}
        self._task: asyncio.Task[None] | None = None
        self._wake = asyncio.Event()

    def subscribe(self, addresses: Sequence[str], period: float = 0.0) -> Subscription:
        """Poll these drives, each at least every `period` s as far as the wire allows; 0: as fast as it does."""
        subscription = Subscription(self, tuple(addresses), max(period, FASTEST))
        self._subscriptions.append(subscription)
        self._wake.set()
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._run())
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        """End one; the last one ends the polling."""
        if subscription in self._subscriptions:
            self._subscriptions.remove(subscription)
            self._wake.set()

    def rate(self, address: str) -> float:
        """Samples a second of a drive over the last two seconds."""
        poll = self._polls.get(address)
        now = self._bus.now()
        recent = [t for t in poll.times if t > now - RATE_OVER] if poll else []
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 2 else 0.0

    def period(self, address: str) -> float:
        """The period asked for, s; infinite where nobody looks."""
        wanted = [s.period for s in self._subscriptions if address in s.addresses]
        return min(wanted, default=float("inf"))

    def close(self) -> None:
        """End all polling."""
        self._subscriptions.clear()
        if self._task:
            self._task.cancel()

    def _wanted(self) -> list[str]:
        return list(dict.fromkeys(a for s in self._subscriptions for a in s.addresses))

    async def _run(self) -> None:
        while (addresses := self._wanted()) and not self._bus.lost:
            now = self._bus.now()
            due = {a: self._polls.setdefault(a, _Poll()).due for a in addresses}
            address = min(due, key=lambda a: due[a])
            if due[address] > now:
                await self._pause(due[address] - now)
                continue
            await self._poll(address, self._polls[address], now)

    async def _pause(self, seconds: float) -> None:
        self._wake.clear()
        try:
            await asyncio.wait_for(self._wake.wait(), max(seconds, SHORTEST))
        except TimeoutError:
            return

    async def _poll(self, address: str, poll: _Poll, now: float) -> None:
        poll.due = now + self.period(address)
        drive = self._bus.at(address)
        if drive.programming or drive.transferring:
            poll.due = now + FASTEST
            return
        carried: list[Transaction] = []
        try:
            axes = await drive.motion(Priority.POLL, carried.append)
        except TransportLost:
            return
        except NoAnswer:
            poll.silences += 1
            poll.due = self._bus.now() + AFTER_SILENCE * min(poll.silences, LONGEST_SILENCE)
            self._bus.publish(Silent(self._bus.now(), address))
            return
        except DriveError:  # a stop, or program mode: that it is not asked does not make it silent
            poll.due = self._bus.now() + FASTEST
            return
        poll.silences = 0
        at = carried[-1].transmitted_at
        poll.times.append(at)
        for axis in axes:
            self._bus.publish(Sample(at, address, axis.position, axis.velocity, axis.axis, axis.trouble))
