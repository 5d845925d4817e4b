"""Position and velocity, polled at the lowest priority while there is a subscription.

Theory of operation. One drive is read at a time: the one that is due for longest. The end of a poll begins the next
one, in the turn of the event loop that read the reply, and then publishes the sample. So at the highest rate the wire
is never idle. A drive is due one period after it was due before, so the rate does not sink with the time that a reading
takes. A drive that cannot keep up is due at once.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from multidrop.dialects import DriveError, Motion, NoAnswer, Priority
from multidrop.drives.apart import apart
from multidrop.drives.conclusions import Outcome
from multidrop.drives.conversations import Conversation
from multidrop.drives.events import Sample, Silent, Transaction
from multidrop.drives.readings import USUAL, Readings, Value
from multidrop.drives.roster import PrintWait, Roster
from multidrop.drives.subscriptions import Subscription, Subscriptions
from multidrop.drives.watching import PERIOD, Watching
from multidrop.transports import TransportLost

MODEST = 0.02
"""Default period of a drive, s: a screen shows no more, and others need the wire."""
FASTEST = 0.001
"""Shortest period of a drive, s: a simulated wire without a baud rate has no other limit."""
RETRY = 0.02
"""Pause after a drive could not be asked, s."""
AFTER_SILENCE = 1.0
"""Pause after a poll without an answer, s; longer by the same with each further one."""
LONGEST_SILENCE = 5
"""Longest pause, in multiples of AFTER_SILENCE."""
AFTER_DEFECT = 60.0
"""Pause after a poll that failed by a defect, s: each one is reported."""
RATE_OVER = 2.0
"""Time over which the rate is averaged, s."""


@dataclass
class _Poll:
    """The polling of one drive: when it is due, polls without an answer in a row, times of the samples."""

    due: float = 0.0
    silences: int = 0
    times: deque[float] = field(default_factory=lambda: deque(maxlen=1000))


class Telemetry:
    """The poller of one link. It publishes its samples as events of the link."""

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        self._link = roster.link
        self._subscriptions = Subscriptions[str](FASTEST, self._changed)
        self._polls: dict[str, _Poll] = {}
        self._under_way: Conversation[tuple[Motion, ...]] | None = None
        self._busy = self._paused = False
        self._timer: asyncio.TimerHandle | None = None
        self._print_wait = PrintWait(roster)
        self._watching = Watching(roster)
        self._readings = Readings(roster)

    def watch(self, addresses: Sequence[str], period: float = PERIOD) -> Subscription[str]:
        """Read the conditions of these drives every `period` s, between the polls."""
        return self._watching.watch(addresses, period)

    def read(self, values: Sequence[Value], period: float = USUAL) -> Subscription[Value]:
        """Read values by their words, which `dialects.values` has checked, each every `period` s beside the polls."""
        return self._readings.subscribe(values, period)

    def subscribe(self, addresses: Sequence[str], period: float = MODEST) -> Subscription[str]:
        """Poll these drives, each every `period` s as far as the wire allows; 0: as fast as it allows."""
        return self._subscriptions.add(addresses, period)

    def rate(self, address: str) -> float:
        """Rate of a drive's samples, per second."""
        poll = self._polls.get(address)
        now = self._link.now()
        recent = [t for t in poll.times if t > now - RATE_OVER] if poll else []
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 2 else 0.0

    def period(self, address: str) -> float:
        """Shortest period requested for a drive, s; infinite without a subscription."""
        return self._subscriptions.periods.get(address, float("inf"))

    def close(self) -> None:
        """End all polling."""
        self._subscriptions.clear()
        self._watching.close()
        self._readings.close()
        if self._under_way is not None:
            self._under_way.interrupt()

    def _changed(self) -> None:
        now = self._link.now()
        for address, period in self._subscriptions.periods.items():  # one that was asked for at a slower rate
            poll = self._polls.setdefault(address, _Poll())
            poll.due = max(now, min(poll.due, now + period)) if not poll.silences else poll.due
        self._set_timer(now)

    # Polls

    def _set_timer(self, at: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_at(at, self._next) if self._subscriptions.periods else None

    def _next(self) -> None:
        """Poll the drive that is due for longest, or wait for the next one that is due."""
        periods = self._subscriptions.periods
        if self._busy or self._paused or self._link.away or not periods:
            return
        now = self._link.now()
        address = min(periods, key=lambda each: self._polls[each].due)
        poll = self._polls[address]
        if poll.due > now:
            return self._set_timer(poll.due)
        if left := self._print_wait.left(now):
            return self._set_timer(now + left)
        drive = self._roster.at(address)
        if drive.programming or drive.transferring:
            poll.due = now + RETRY
            return self._set_timer(now)
        poll.due = max(poll.due + periods[address], now)
        self._begin(address, poll)

    def pause(self) -> None:
        """Begin no poll until `resume`."""
        self._paused = True
        self._watching.pause()
        self._readings.pause()

    def resume(self) -> None:
        """Go on polling after a pause, or after one of the link."""
        self._paused = False
        self._watching.resume()
        self._readings.resume()
        self._set_timer(self._link.now())

    def _begin(self, address: str, poll: _Poll) -> None:
        ended: list[Transaction] = []

        def over(outcome: Outcome[tuple[Motion, ...]]) -> None:
            self._busy, self._under_way = False, None
            if outcome.error is None:
                self._read(address, poll, ended[-1].transmitted_at, outcome.value())
            else:
                self._failed(address, poll, outcome)

        self._busy = True
        under_way = self._roster.at(address).start_motion(Priority.POLL, over, ended.append)
        self._under_way = under_way if self._busy else None

    def _read(self, address: str, poll: _Poll, at: float, axes: Sequence[Motion]) -> None:
        """Begin the next poll; then publish what was read."""
        poll.silences = 0
        poll.times.append(at)
        loop = asyncio.get_running_loop()
        seen = self._roster.at(address).seen
        velocities = seen.velocities if seen is not None else [axis.velocity for axis in axes]
        self._next()
        for axis, velocity in zip(axes, velocities, strict=True):
            sample = Sample(at, address, axis.position, velocity, axis.axis, axis.trouble, axis.program)
            loop.call_soon(self._publish, sample)

    def _publish(self, sample: Sample) -> None:
        if sample.address in self._subscriptions.periods:  # else the subscription has ended meanwhile
            self._link.publish(sample)

    def _failed(self, address: str, poll: _Poll, outcome: Outcome[tuple[Motion, ...]]) -> None:
        """Set when the drive is polled again."""
        trouble: list[str] = []
        with apart(f"polling {address} on {self._link.name}", trouble):
            self._put_off(address, poll, outcome)
        if trouble:
            poll.due = self._link.now() + AFTER_DEFECT
            shown = self._roster.at(address).shown
            text = f"{shown}: the poll failed ({trouble[0]}); it is polled again in {AFTER_DEFECT:g} s"
            self._link.notify(text, address, warning=True)
        self._set_timer(self._link.now())

    def _put_off(self, address: str, poll: _Poll, outcome: Outcome[tuple[Motion, ...]]) -> None:
        """Poll a drive that was not read later; raise what is neither a loss nor a drive's error."""
        now = self._link.now()
        try:
            outcome.value()
        except TransportLost:  # `resume` begins again
            return
        except NoAnswer:
            poll.silences += 1
            poll.due = now + AFTER_SILENCE * min(poll.silences, LONGEST_SILENCE)
            self._link.publish(Silent(now, address))
        except DriveError:  # a stop or program mode kept it from being asked: that is not a silence
            poll.due = now + RETRY
