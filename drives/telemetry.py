"""Position and velocity, polled at the lowest priority while there is a subscription."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from dialects import DriveError, NoAnswer, Priority
from drives.events import Sample, Silent, Transaction
from drives.roster import Roster
from transports import TransportLost

FASTEST = 0.02
"""Shortest time between two samples of one drive, s: nobody sees more, and others need the wire."""
AFTER_SILENCE = 1.0
"""Pause after a poll without an answer, s; longer by the same with each further one."""
LONGEST_SILENCE = 5
"""Longest pause, in multiples of AFTER_SILENCE."""
RATE_OVER = 2.0
"""Time over which the rate is averaged, s."""
SHORTEST = 0.001
"""Shortest sleep between two polls, s."""


@dataclass(eq=False)
class Subscription:
    """A request for samples of some drives, until it is closed."""

    telemetry: Telemetry
    addresses: tuple[str, ...]
    period: float

    def close(self) -> None:
        """End it."""
        self.telemetry.unsubscribe(self)


@dataclass
class _Poll:
    """The polling of one drive: when it is due, polls without an answer in a row, times of the samples."""

    due: float = 0.0
    silences: int = 0
    times: deque[float] = field(default_factory=lambda: deque(maxlen=200))


class Telemetry:
    """The poller of one link. It publishes its samples as events of the link."""

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        self._link = roster.link
        self._subscriptions: list[Subscription] = []
        self._polls: dict[str, _Poll] = {}
        self._task: asyncio.Task[None] | None = None
        self._wake = asyncio.Event()

    def subscribe(self, addresses: Sequence[str], period: float = 0.0) -> Subscription:
        """Poll these drives, each every `period` s as far as the wire allows; 0: as fast as it allows."""
        subscription = Subscription(self, tuple(addresses), max(period, FASTEST))
        self._subscriptions.append(subscription)
        self._wake.set()
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._run())
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        """End a subscription; the last one ends the polling."""
        if subscription in self._subscriptions:
            self._subscriptions.remove(subscription)
            self._wake.set()

    def rate(self, address: str) -> float:
        """Rate of a drive's samples, per second."""
        poll = self._polls.get(address)
        now = self._link.now()
        recent = [t for t in poll.times if t > now - RATE_OVER] if poll else []
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 2 else 0.0

    def period(self, address: str) -> float:
        """Shortest period requested for a drive, s; infinite without a subscription."""
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
        while (addresses := self._wanted()) and not self._link.lost:
            now = self._link.now()
            due = {a: self._polls.setdefault(a, _Poll()).due for a in addresses}
            address = min(due, key=lambda a: due[a])
            if due[address] > now:
                await self._pause(due[address] - now)
            else:
                await self._poll(address, self._polls[address], now)

    async def _pause(self, seconds: float) -> None:
        self._wake.clear()
        try:
            await asyncio.wait_for(self._wake.wait(), max(seconds, SHORTEST))
        except TimeoutError:
            return

    async def _poll(self, address: str, poll: _Poll, now: float) -> None:
        poll.due = now + self.period(address)
        drive = self._roster.at(address)
        if drive.programming or drive.transferring:
            poll.due = now + FASTEST
            return
        transactions: list[Transaction] = []
        try:
            axes = await drive.motion(Priority.POLL, transactions.append)
        except TransportLost:
            return
        except NoAnswer:
            poll.silences += 1
            poll.due = self._link.now() + AFTER_SILENCE * min(poll.silences, LONGEST_SILENCE)
            self._link.publish(Silent(self._link.now(), address))
            return
        except DriveError:  # a stop or program mode kept it from being asked: that is no silence
            poll.due = self._link.now() + FASTEST
            return
        poll.silences = 0
        at = transactions[-1].transmitted_at
        poll.times.append(at)
        for axis in axes:
            self._link.publish(Sample(at, address, axis.position, axis.velocity, axis.axis, axis.trouble))
