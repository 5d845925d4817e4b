"""Any values of drives, polled at the lowest priority while there is a subscription.

One value of a link is read at a time, beside the polls of `drives.telemetry`: the queue of the line has them take
turns. A value that its drive has lost is not asked for again.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from multidrop.dialects import DriveError, End, NoAnswer, Priority, Refused
from multidrop.drives.conclusions import Outcome
from multidrop.drives.conversations import Conversation
from multidrop.drives.events import Transaction, Valued
from multidrop.drives.roster import PrintWait, Roster
from multidrop.drives.subscriptions import Subscription, Subscriptions
from multidrop.transports import TransportLost

USUAL = 0.05
"""Default period of a value, s."""
FASTEST = 0.002
"""Shortest period of a value, s."""
RETRY = 0.05
"""Pause after a drive could not be asked, s."""
AFTER_SILENCE = 1.0
"""Pause after a reading without an answer, s; longer by the same with each further one, up to five times."""
NAKS = 3
"""NAKs in a row after which a value counts as refused."""


class Value(NamedTuple):
    """A value by the address of its drive and its word."""

    address: str
    word: str


@dataclass
class _Due:
    at: float
    silences: int = 0
    refusals: int = 0
    """NAKs in a row: noise damages a request now and then, and a value that is gone is refused each time."""
    lost: bool = False
    """The drive has refused it."""


class Readings:
    """The reader of one link. It publishes values as events of the link."""

    def __init__(self, roster: Roster) -> None:
        self._roster, self._link = roster, roster.link
        self._subscriptions = Subscriptions[Value](FASTEST, self._changed)
        self._print_wait = PrintWait(roster)
        self._due: dict[Value, _Due] = {}
        self._under_way: Conversation[float] | None = None
        self._busy = self._paused = False
        self._timer: asyncio.TimerHandle | None = None

    def subscribe(self, values: Sequence[Value], period: float = USUAL) -> Subscription[Value]:
        """Read these values, each every `period` s as far as the wire allows. Their words were checked before."""
        return self._subscriptions.add(values, period)

    def close(self) -> None:
        """End all reading."""
        self._subscriptions.clear()
        if self._under_way is not None:
            self._under_way.interrupt()

    def pause(self) -> None:
        """Begin no reading until `resume`."""
        self._paused = True

    def resume(self) -> None:
        """Go on after a pause, or after one of the link."""
        self._paused = False
        self._set_timer(self._link.now())

    def _changed(self) -> None:
        now, before = self._link.now(), self._due
        self._due = {value: before.get(value) or _Due(now) for value in self._subscriptions.periods}
        self._set_timer(now)

    def _set_timer(self, at: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_at(at, self._next) if self._due else None

    def _next(self) -> None:
        """Read the value that is due for longest, or wait for the next one that is due."""
        wanted = {value: due for value, due in self._due.items() if not due.lost}
        if self._busy or self._paused or self._link.away or not wanted:
            return
        now = self._link.now()
        value, due = min(wanted.items(), key=lambda item: item[1].at)
        if due.at > now:
            return self._set_timer(due.at)
        if left := self._print_wait.left(now):
            return self._set_timer(now + left)
        drive = self._roster.at(value.address)
        if drive.programming or drive.transferring or drive.family.readings is None:
            due.at = now + RETRY
            return self._set_timer(now)
        due.at = max(due.at + self._subscriptions.periods[value], now)
        self._begin(value, due)

    def _begin(self, value: Value, due: _Due) -> None:
        drive = self._roster.at(value.address)
        assert drive.family.readings is not None
        ended: list[Transaction] = []

        def over(outcome: Outcome[float]) -> None:
            self._busy, self._under_way = False, None
            if outcome.error is None:
                due.silences = due.refusals = 0
                self._set_timer(self._link.now())
                at = ended[-1].transmitted_at if ended else self._link.now()
                self._link.publish(Valued(at, value.address, value.word, outcome.value()))
            else:
                due.refusals += bool(ended) and ended[-1].reply.end is End.NAK
                self._put_off(value, due, outcome)

        self._busy = True
        procedure = drive.family.readings.again(drive.state, value.word, Priority.POLL)
        under_way = drive.start(procedure, over, ended.append)
        self._under_way = under_way if self._busy else None

    def _put_off(self, value: Value, due: _Due, outcome: Outcome[float]) -> None:
        """Read a value later that was not read; raise what is neither a loss nor a drive's error."""
        now = self._link.now()
        try:
            outcome.value()
        except TransportLost:  # `resume` begins again
            return
        except NoAnswer:
            due.silences += 1
            if due.refusals >= NAKS:
                self._give_up(value, due, f"{value.address or self._link.name} replies NAK to '{value.word}'")
            due.at = now + AFTER_SILENCE * min(due.silences, 5)
        except Refused as refusal:
            self._give_up(value, due, str(refusal))
        except DriveError:  # a stop kept it from being asked
            due.at = now + RETRY
        self._set_timer(now)

    def _give_up(self, value: Value, due: _Due, why: str) -> None:
        """Read a value no longer, and say so once: each refusal may start a subroutine for errors in the drive."""
        due.lost = True
        self._link.notify(f"{why}; it is not read again", value.address, warning=True)
