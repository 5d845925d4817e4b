"""Conditions of drives, read part by part at the lowest priority while there is a watch.

Theory of operation. One part is read at a time on a link, each in its turn among the conversations with its drive: a
typed line waits for one part at most. The quick parts are read once a period. The slow ones are read at first and after
each request that may do more than ask. They are also read now and then, as a program or another host may change a
setting. A part that a drive refuses is never asked again. Nothing here reports a drive's silence: the polls of motion
do.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from multidrop.dialects import DriveError, NoAnswer, Refused
from multidrop.dialects.parameters import Value
from multidrop.dialects.values import Part, Reader
from multidrop.drives.apart import apart
from multidrop.drives.drive import Drive, Running
from multidrop.drives.events import Conditioned
from multidrop.drives.roster import PrintWait, Roster
from multidrop.drives.subscriptions import Subscription, Subscriptions
from multidrop.transports import TransportLost

PERIOD = 1.0
"""Default seconds between two readings of a drive."""
SHORTEST = 0.1
AGED = 30
"""Periods after which settings are read again."""
LEAST = 3.0
"""Seconds between two readings of a setting, however many commands are sent."""
AWAY = 0.5
"""Pause while nothing can be read, s."""
AFTER_FAILURE = 2.0
"""Pause after a reply that did not come, s; longer by the same with each further one."""
PATIENCE = 5
"""Most failures that make the pause longer."""
AFTER_DEFECT = 60.0


@dataclass
class _Watched:
    """The facts that were read of one drive, with their times."""

    drive: Drive
    due: float = 0.0
    period: float = PERIOD
    facts: dict[str, Value] = field(default_factory=dict)
    read: dict[str, tuple[float, int]] = field(default_factory=dict)
    """Time of each part's last reading, and the drive's commands so far."""
    refused: set[str] = field(default_factory=set)
    failures: int = 0


class Watching:
    """The reader of conditions on one link. It publishes them as events of the link."""

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        self._link = roster.link
        self._watches = Subscriptions[str](SHORTEST, self._begin)
        self._watched: dict[str, _Watched] = {}
        self._print_wait = PrintWait(roster)
        self._task: asyncio.Task[None] | None = None
        self._changed = asyncio.Event()
        """Something may be due sooner than it was."""
        self._paused = False

    def watch(self, addresses: Sequence[str], period: float = PERIOD) -> Subscription[str]:
        """Read the conditions of these drives every `period` s; the end of the last such watch ends the readings."""
        now = self._link.now()
        for each in (self._watched[address] for address in addresses if address in self._watched):
            if not each.failures:  # one that was asked for at a slower rate
                each.due = min(each.due, now)
        return self._watches.add(addresses, period)

    def pause(self) -> None:
        """Begin no part until `resume`."""
        self._paused = True

    def resume(self) -> None:
        """Go on after a pause, or after one of the link: everything is read again."""
        self._paused = False
        self._watched.clear()
        self._changed.set()

    def close(self) -> None:
        """End all watches."""
        self._watches.clear()
        if self._task is not None:
            self._task.cancel()

    def _begin(self) -> None:
        self._changed.set()
        if self._watches.periods and (self._task is None or self._task.done()):
            self._task = asyncio.get_running_loop().create_task(self._run())

    async def _run(self) -> None:
        """Read what is due, until no watch is left."""
        while periods := self._watches.periods:
            listed = [address for address in periods if address in self._roster.drives]
            if self._paused or self._link.away is not None or not listed:
                await asyncio.sleep(AWAY)
                continue
            address = min(listed, key=lambda each: self._at(each).due)
            watched, now = self._at(address), self._link.now()
            if watched.due > now:
                await self._until(watched.due - now)
                continue
            watched.period = periods[address]
            watched.due = now + watched.period
            trouble: list[str] = []
            with apart(f"reading the conditions of {address} on {self._link.name}", trouble):
                await self._read(watched)
            if trouble:
                watched.due = now + AFTER_DEFECT
                self._link.notify(f"{watched.drive.shown}: {trouble[0]}", address, warning=True)

    async def _until(self, seconds: float) -> None:
        """Wait so long, or until something may be due sooner."""
        self._changed.clear()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._changed.wait()

    def _at(self, address: str) -> _Watched:
        """The facts of a drive; those of another drive at the same address are dropped."""
        drive = self._roster.drives[address]
        watched = self._watched.get(address)
        if watched is None or watched.drive is not drive:
            watched = self._watched[address] = _Watched(drive)
        return watched

    async def _read(self, watched: _Watched) -> None:
        """Read the parts of a drive that are due, and publish its conditions."""
        drive = watched.drive
        reader: Reader[Any] | None = drive.family.conditions
        if reader is None:
            return
        ready, begun = False, self._link.now()
        for name in [part.name for part in reader.parts(drive.state, watched.facts)]:
            part = next((each for each in reader.parts(drive.state, watched.facts) if each.name == name), None)
            if part is None or not self._due(watched, part):
                continue
            if self._barred(drive) or not await self._part(watched, part):
                return
            ready = True
        if ready and watched.facts:
            conditions = reader.fold(drive.state, watched.facts)
            if (runs := next((each.runs for each in conditions if each.runs is not None), None)) is not None:
                drive.running = Running(begun, runs)
            self._link.publish(Conditioned(self._link.now(), drive.address, conditions))

    def _due(self, watched: _Watched, part: Part[Any]) -> bool:
        if part.name in watched.refused:
            return False
        at, commands = watched.read.get(part.name, (float("-inf"), -1))
        age = self._link.now() - at
        return not part.slow or age > AGED * watched.period or (age > LEAST and commands != watched.drive.commands)

    def _barred(self, drive: Drive) -> bool:
        """Whether nothing may be read of a drive now: it stores lines, or its settings are to be found out first."""
        unsure = drive.programming or drive.transferring or drive.state.settings_unknown
        return unsure or self._paused or self._link.away is not None or drive.address not in self._watches.periods

    async def _part(self, watched: _Watched, part: Part[Any]) -> bool:
        """Read one part; whether the next may follow."""
        while left := self._print_wait.left(self._link.now()):
            await asyncio.sleep(left)
        drive = watched.drive
        commands = drive.commands
        try:
            found = await drive.run(part.read(drive.state))
            watched.facts |= found
            if part.slow:
                drive.settings[part.name] = (found, commands)
        except Refused:
            watched.refused.add(part.name)
        except NoAnswer:
            watched.failures = min(watched.failures + 1, PATIENCE)
            watched.due = self._link.now() + AFTER_FAILURE * watched.failures
            return False
        except (DriveError, TransportLost):  # stopped, in program mode, or away
            return False
        watched.failures = 0
        watched.read[part.name] = (self._link.now(), commands)
        return True
