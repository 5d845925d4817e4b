"""The poller of a link: reads things one after the other, each as often as the most eager subscription asks.

How it shares the wire with other pollers and with what people ask for: `drives.telemetry`.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf
from typing import Any, Generic, TypeVar

from multidrop.base.errors import DriveError, NoAnswer, Refused, TransportLost
from multidrop.base.isolation import isolated
from multidrop.dialects import End
from multidrop.drives.conversations import Conversation, OnOver
from multidrop.drives.drive import Drive
from multidrop.drives.events import ConversationOutcome
from multidrop.drives.roster import Roster

MOST_SILENCES = 5
"""Most polls without an answer in a row that make the pause longer."""
AFTER_DEFECT = 60.0
"""Pause after a poll that failed by a defect, s: each one is reported."""
FAILED = f"the poll failed ({{}}); it is polled again in {AFTER_DEFECT:g} s"
PRINT_QUIET = 0.1
"""Quiet time after a print before the next poll of a party line, s."""
LONGEST_WAIT = 0.2
"""Longest time for which prints hold up a poll, s."""

Thing = TypeVar("Thing", bound=Hashable)
Read = TypeVar("Read")


class Subscription(Generic[Thing]):
    """A request for readings of some things, each every `period` s, until it is closed."""

    def __init__(self, things: Sequence[Thing], period: float, ended: Callable[[Subscription[Thing]], None]) -> None:
        self.things, self.period = tuple(things), period
        self._ended = ended

    def close(self) -> None:
        """End it; a second call has no effect."""
        self._ended(self)


@dataclass
class Due:
    """When a thing is read next, s, and polls without an answer in a row."""

    at: float = 0.0
    """Infinite: it is not read again."""
    silences: int = 0
    refusals: int = 0
    """NAKs in a row: noise damages a request now and then, and a value that is gone is refused each time."""


class Poller(ABC, Generic[Thing]):
    """Reads things of one link, each as often as the most eager subscription asks."""

    shortest: float
    """Shortest period, s."""
    retry: float
    """Pause after a thing could not be asked, s."""
    after_silence: float = 1.0
    """Pause after a poll without an answer, s; longer by the same with each further one."""

    def __init__(self, roster: Roster) -> None:
        self.periods: dict[Thing, float] = {}
        """The shortest period requested for each thing, s."""
        self._roster, self._link = roster, roster.link
        self._open: list[Subscription[Thing]] = []
        self._due: dict[Thing, Due] = {}
        self._busy = self._paused = False
        self._under_way: Conversation[Any] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._waits_since: float | None = None
        """When prints began to hold up the next poll."""

    def subscribe(self, things: Sequence[Thing], period: float) -> Subscription[Thing]:
        def end(subscription: Subscription[Thing]) -> None:
            if subscription in self._open:
                self._open.remove(subscription)
                self._count()

        subscription = Subscription(things, max(period, self.shortest), end)
        self._open.append(subscription)
        self._count()
        return subscription

    def close(self) -> None:
        self._open.clear()
        self._count()
        if self._under_way is not None:
            self._under_way.interrupt()

    def pause(self) -> None:
        self._paused = True

    def resume(self) -> None:
        self._paused = False
        self._set_timer(self._link.now())

    def _count(self) -> None:
        self.periods = {}
        for subscription in self._open:
            for thing in subscription.things:
                self.periods[thing] = min(subscription.period, self.periods.get(thing, subscription.period))
        now = self._link.now()
        for thing, period in self.periods.items():
            due = self._due.setdefault(thing, Due())
            if not due.silences and due.at < inf:  # it may have been asked for at a slower rate
                due.at = max(now, min(due.at, now + period))
        self._set_timer(now)

    # One poll after the other

    def _set_timer(self, at: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        wanted = self.periods and at < inf
        self._timer = asyncio.get_running_loop().call_at(at, self._next) if wanted else None

    def _next(self) -> None:
        """Read the thing that is due for longest, or wait for the next one that is due."""
        if self._busy or self._paused or self._link.away or not self.periods:
            return
        now = self._link.now()
        thing = min(self.periods, key=lambda each: self._due[each].at)
        due = self._due[thing]
        if due.at > now:
            return self._set_timer(due.at)
        if left := self._held_up(now):
            return self._set_timer(now + left)
        drive = self._drive(thing)
        if not self._readable(drive):
            due.at = now + self.retry
            return self._set_timer(now)
        due.at = max(due.at + self.periods[thing], now)
        with self._isolated(thing, due, f"polling {thing} on {self._link.name}", FAILED, again=False):
            self._begin(thing, due, drive)

    def _held_up(self, now: float) -> float:
        """Seconds for which the next poll of a party line waits after a print. What people ask for never waits.

        A program often prints several lines in a row, and the reply of another drive runs into the next.
        """
        quiet = self._link.line.printed_at + PRINT_QUIET - now
        if quiet <= 0 or len(self._roster.drives) < 2:
            self._waits_since = None
            return 0.0
        self._waits_since = now if self._waits_since is None else self._waits_since
        left = min(quiet, self._waits_since + LONGEST_WAIT - now)
        if left <= 0:
            self._waits_since = None
        return max(left, 0.0)

    @abstractmethod
    def _drive(self, thing: Thing) -> Drive:
        """Return the drive that a thing is read of."""

    def _readable(self, drive: Drive) -> bool:
        return not (drive.state.programming or drive.transferring)

    @abstractmethod
    def _begin(self, thing: Thing, due: Due, drive: Drive) -> None:
        """Begin to read a thing, which is due."""

    def _converse(
        self,
        thing: Thing,
        due: Due,
        start: Callable[[OnOver[Read]], Conversation[Read]],
        took: Callable[[Thing, float, Read], None],
    ) -> None:
        """Read a thing in one conversation; `took` is called with the time of its last request and what was read."""

        def over(outcome: ConversationOutcome[Read]) -> None:
            self._busy, self._under_way, last = False, None, outcome.last
            if outcome.error is None:
                due.silences = due.refusals = 0
                took(thing, last.transmitted_at if last is not None else self._link.now(), outcome.result[0])
            else:
                due.refusals += last is not None and last.reply.end is End.NAK
                self._failed(thing, due, outcome)

        self._busy = True
        under_way = start(over)
        self._under_way = under_way if self._busy else None

    def _failed(self, thing: Thing, due: Due, outcome: ConversationOutcome[Any]) -> None:
        """Set when a thing is read again that was not read."""
        with self._isolated(thing, due, f"polling {thing} on {self._link.name}", FAILED):
            try:
                outcome.value()
            except TransportLost:  # `resume` begins again
                pass
            except NoAnswer:
                self._back_off(due)
                self._silent(thing, due)
            except Refused as refusal:
                due.at = self._link.now() + self.retry
                self._refused(thing, due, str(refusal))
            except DriveError:  # a stop or program mode kept it from being asked: that is not a silence
                due.at = self._link.now() + self.retry

    @contextmanager
    def _isolated(self, thing: Thing, due: Due, what: str, report: str, again: bool = True) -> Iterator[None]:
        """Report a defect and put the thing off; then set the timer, without a defect if `again`."""
        trouble: list[str] = []
        with isolated(what, trouble):
            yield
        if trouble:
            due.at, self._busy = self._link.now() + AFTER_DEFECT, self._busy and again
            drive = self._drive(thing)
            self._link.notify(f"{drive.shown}: {report.format(trouble[0])}", drive.address, warning=True)
        if trouble or again:
            self._set_timer(self._link.now())

    def _back_off(self, due: Due) -> None:
        due.silences += 1
        due.at = self._link.now() + self.after_silence * min(due.silences, MOST_SILENCES)

    def _silent(self, thing: Thing, due: Due) -> None:
        """Report a poll without an answer."""

    def _refused(self, thing: Thing, due: Due, why: str) -> None:
        """Report a refusal."""
