"""Readings of the drives of one link at the lowest priority, while there is a subscription.

Theory of operation. Three pollers share the wire: positions and velocities, values by their words, and conditions. Each
reads one thing at a time: the one that is due for longest. A thing is due one period after it was due before, so the
rate does not sink with the time that a reading takes; one that cannot keep up is due at once. The end of a poll of
motion begins the next one in the turn of the event loop that read the reply, and then publishes the sample. So at the
highest rate the wire is never idle. A drive that does not reply is asked again after a pause that grows.

Conditions are read part by part, each in its turn among the conversations with its drive: a typed line waits for one
part at most. The quick parts are read once a period. The slow ones are read at first and after each request that may do
more than ask. They are also read now and then, as a program or another host may change a setting. A part that a drive
refuses is never asked again. Nothing there reports a drive's silence: the polls of motion do.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from math import inf
from typing import NamedTuple

from multidrop.base.errors import DriveError, NoAnswer, Refused, TransportLost
from multidrop.dialects import Motion, Priority
from multidrop.dialects.values import Part
from multidrop.dialects.values import Value as Fact
from multidrop.drives.drive import Drive, ProgramReading
from multidrop.drives.events import Conditioned, Sample, Silent, Valued
from multidrop.drives.poller import Due, Poller
from multidrop.drives.poller import Subscription as Subscription
from multidrop.drives.recount import recount
from multidrop.drives.roster import Roster

MODEST = 0.02
"""Default period of a drive's motion, s: a screen shows no more, and others need the wire."""
SHORTEST_PERIOD = 0.001
"""Shortest period of a drive's motion, s: a simulated wire without a baud rate has no other limit."""
READ_PERIOD = 0.05
"""Default period of a value, s."""
WATCH_PERIOD = 1.0
"""Default period of a drive's conditions, s."""
RATE_OVER = 2.0
"""Time over which the rate is averaged, s."""
NAKS = 3
"""NAKs in a row after which a value counts as refused."""
AGED = 30
"""Periods after which settings are read again."""
SCALES = 5
"""Periods between two readings of what the scales of a drive rest on."""
LEAST_AGE = 3.0
"""Seconds between two readings of a setting, however many commands are sent."""


class DriveValue(NamedTuple):
    """A value by the address of its drive and its word."""

    address: str
    word: str


class _MotionPoller(Poller[str]):
    """Polls position and velocity of drives, by address."""

    shortest = SHORTEST_PERIOD
    retry = 0.02

    def __init__(self, roster: Roster) -> None:
        super().__init__(roster)
        self._times: dict[str, deque[float]] = {}

    def rate(self, address: str) -> float:
        now = self._link.now()
        recent = [t for t in self._times.get(address, ()) if t > now - RATE_OVER]
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 2 else 0.0

    def _drive(self, thing: str) -> Drive:
        return self._roster.at(thing)

    def _readable(self, drive: Drive) -> bool:
        return super()._readable(drive) and not drive.state.stranger

    def _begin(self, thing: str, due: Due, drive: Drive) -> None:
        self._converse(thing, due, partial(drive.start_motion, Priority.POLL), self._took)

    def _took(self, address: str, at: float, axes: Sequence[Motion]) -> None:
        """Begin the next poll; then publish what was read."""
        self._times.setdefault(address, deque(maxlen=1000)).append(at)
        seen = self._roster.at(address).seen
        velocities = seen.velocities if seen is not None else [axis.velocity for axis in axes]
        self._next()
        for axis, velocity in zip(axes, velocities, strict=True):
            sample = Sample(at, address, axis.position, velocity, axis.axis, axis.trouble, axis.program)
            asyncio.get_running_loop().call_soon(self._publish, sample)

    def _publish(self, sample: Sample) -> None:
        if sample.address in self.periods:  # else the subscription has ended meanwhile
            self._link.publish(sample)

    def _silent(self, thing: str, due: Due) -> None:
        self._link.publish(Silent(self._link.now(), thing))


class _ValuePoller(Poller[DriveValue]):
    """Polls values by their words, which a person named."""

    shortest = 0.002
    retry = 0.05

    def _count(self) -> None:
        super()._count()
        self._due = {value: self._due[value] for value in self.periods}

    def _drive(self, thing: DriveValue) -> Drive:
        return self._roster.at(thing.address)

    def _begin(self, thing: DriveValue, due: Due, drive: Drive) -> None:
        procedure = drive.family.values.again(thing.word, Priority.POLL)
        self._converse(thing, due, partial(drive.start, procedure, typed=True), self._took)

    def _took(self, value: DriveValue, at: float, read: float) -> None:
        self._set_timer(self._link.now())
        self._link.publish(Valued(at, value.address, value.word, read))

    def _silent(self, thing: DriveValue, due: Due) -> None:
        if due.refusals >= NAKS:
            self._refused(thing, due, f"{self._drive(thing).shown}: NAK to '{thing.word}'")

    def _refused(self, thing: DriveValue, due: Due, why: str) -> None:
        """Read a value no longer, and say so once: each refusal may start a subroutine for errors in the drive."""
        due.at = inf
        self._link.notify(f"{why}; it is not read again", thing.address, warning=True)


@dataclass
class _Facts:
    """The facts that were read of one drive, with their times."""

    drive: Drive
    facts: dict[str, Fact] = field(default_factory=dict)
    read: dict[str, tuple[float, int]] = field(default_factory=dict)
    """Time of each part's last reading, and the drive's commands so far."""
    refused: set[str] = field(default_factory=set)
    restarts: int = 0
    """The restarts of the drive so far."""
    scaled_at: float = -inf
    """When what its scales rest on was last read."""


class _ConditionPoller(Poller[str]):
    """Reads the conditions of drives that were found, by address, part by part."""

    shortest = 0.1
    retry = 0.5
    after_silence = 2.0

    def __init__(self, roster: Roster) -> None:
        super().__init__(roster)
        self._known: dict[str, _Facts] = {}
        self._task: asyncio.Task[None] | None = None

    def subscribe(self, things: Sequence[str], period: float) -> Subscription[str]:
        """Read the conditions of these drives at once, and then every `period` s."""
        now = self._link.now()
        for due in (self._due[address] for address in things if address in self._due):
            due.at = due.at if due.silences else min(due.at, now)
        return super().subscribe(things, period)

    def close(self) -> None:
        super().close()
        if self._task is not None:
            self._task.cancel()

    def resume(self) -> None:
        self._known.clear()
        self._due.clear()
        self._paused = False
        self._count()

    def _held_up(self, now: float) -> float:
        return 0.0  # each part waits for itself

    def _drive(self, thing: str) -> Drive:
        return self._roster.at(thing)

    def _readable(self, drive: Drive) -> bool:
        return drive in self._roster.drives.values()

    def _begin(self, thing: str, due: Due, drive: Drive) -> None:
        due.at = self._link.now() + self.periods[thing]
        self._busy = True
        self._task = asyncio.get_running_loop().create_task(self._read(thing, due))

    async def _read(self, address: str, due: Due) -> None:
        with self._isolated(address, due, f"reading the conditions of {address} on {self._link.name}", "{}"):
            try:
                await self._read_parts(address, due)
            finally:
                self._busy = False

    async def _read_parts(self, address: str, due: Due) -> None:
        """Read the parts of a drive that are due, and publish its conditions."""
        drive, known = self._roster.drives.get(address), self._known.get(address)
        if drive is None or address not in self.periods:
            return  # nobody wants them any more
        restarts = self._roster.restarts.count(drive)
        if known is None or known.drive is not drive or known.restarts != restarts:  # it holds other settings
            known = self._known[address] = _Facts(drive, restarts=restarts)
        ready, begun, period = False, self._link.now(), self.periods[address]
        parts = drive.family.values.parts(known.facts)
        for name in [part.name for part in parts]:
            part = next((each for each in drive.family.values.parts(known.facts) if each.name == name), None)
            if part is None or not self._part_due(known, part, period):
                continue
            if self._barred(drive) or not await self._read_part(known, due, part):
                return
            ready = True
        if parts and drive.counting.axes and not self._barred(drive) and self._scale_due(known, period):
            await self._read_scales(known)
        if ready and known.facts:
            conditions = drive.family.values.fold(known.facts)
            if (
                runs := next((condition.runs for condition in conditions if condition.runs is not None), None)
            ) is not None:
                drive.running = ProgramReading(begun, runs)
            self._link.publish(Conditioned(self._link.now(), drive.address, conditions))

    def _barred(self, drive: Drive) -> bool:
        """Whether nothing is read: it stores lines, its settings are to be found out first, or nobody asks any more."""
        storing = drive.programming or drive.transferring or drive.state.settings_unknown
        return storing or self._paused or self._link.away is not None or drive.address not in self.periods

    def _scale_due(self, known: _Facts, period: float) -> bool:
        holds = all(map(known.drive.scale_holds, known.drive.counting.axes))
        return not holds or self._link.now() - known.scaled_at >= SCALES * period

    async def _read_scales(self, known: _Facts) -> None:
        """Read what the scales of a drive rest on: a program or another master may have changed it."""
        known.scaled_at = self._link.now()
        with suppress(DriveError, TransportLost):  # the polls of motion report a silence
            await recount(known.drive, Priority.POLL)

    def _part_due(self, known: _Facts, part: Part, period: float) -> bool:
        if part.name in known.refused:
            return False
        at, commands = known.read.get(part.name, (-inf, -1))
        age = self._link.now() - at
        return not part.slow or age > AGED * period or (age > LEAST_AGE and commands != known.drive.commands)

    async def _read_part(self, known: _Facts, due: Due, part: Part) -> bool:
        """Read one part; return whether the next may follow."""
        while left := super()._held_up(self._link.now()):
            await asyncio.sleep(left)
        drive = known.drive
        commands = drive.commands
        try:
            values = await drive.run(part.read())
            known.facts |= values
            if part.slow:
                drive.settings[part.name] = (values, commands)
        except Refused:
            known.refused.add(part.name)
        except NoAnswer:
            self._back_off(due)
            return False
        except (DriveError, TransportLost):  # stopped, in program mode, or away
            return False
        due.silences = 0
        known.read[part.name] = (self._link.now(), commands)
        return True


class Telemetry:
    """The pollers of one link. They publish what they read as events of the link."""

    def __init__(self, roster: Roster) -> None:
        self._motion, self._values = _MotionPoller(roster), _ValuePoller(roster)
        self._conditions = _ConditionPoller(roster)
        self._pollers = (self._motion, self._conditions, self._values)

    def subscribe(self, addresses: Sequence[str], period: float = MODEST) -> Subscription[str]:
        """Poll these drives, each every `period` s as far as the wire allows; 0: as fast as it allows."""
        return self._motion.subscribe(addresses, period)

    def read(self, values: Sequence[DriveValue], period: float = READ_PERIOD) -> Subscription[DriveValue]:
        """Read values by their words, which `dialects.values` has checked, each every `period` s beside the polls."""
        return self._values.subscribe(values, period)

    def watch(self, addresses: Sequence[str], period: float = WATCH_PERIOD) -> Subscription[str]:
        """Read the conditions of these drives every `period` s, between the polls."""
        return self._conditions.subscribe(addresses, period)

    def rate(self, address: str) -> float:
        """Rate of a drive's samples, per second."""
        return self._motion.rate(address)

    def period(self, address: str) -> float:
        """Shortest period requested for a drive, s; infinite without a subscription."""
        return self._motion.periods.get(address, inf)

    def pause(self) -> None:
        """Begin no poll until `resume`."""
        for poller in self._pollers:
            poller.pause()

    def resume(self) -> None:
        for poller in self._pollers:
            poller.resume()

    def close(self) -> None:
        """End all polling."""
        for poller in self._pollers:
            poller.close()
