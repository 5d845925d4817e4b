"""Drives after a lost connection: what was known of each is read again before anything may start it.

Where `reconnect` is wanted, a drive is read while it rests after each command: its positions and its settings. After
the return of its line these are read again. Where they are not the same, or the last command was too recent for them
to be known, its position does not count, and nothing starts it (`Drive.hold`) until it counts again. So it is where it
was not at rest. A drive that got no command and was not read yet is compared by its identity only: the program knows
nothing of it that could have changed.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from typing import NamedTuple

from multidrop.base.errors import DriveError, NoAnswer, Refused, TransportLost
from multidrop.base.isolation import isolated
from multidrop.dialects import Priority
from multidrop.dialects.values import Value, differing
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.events import Changed, Lost
from multidrop.shell.events import OnBus, SessionEvent
from multidrop.shell.session import Session

NEVER = float("-inf")
LOOK_PERIOD = 0.25
"""The time between two looks for drives to read, s."""
UNKNOWN = "a command was too recent, when its line was lost, to tell whether it is as it was"
MOVED = "it moved, or a program ran in it, when it was last read before its line was lost, so its position is not known"


class KnownDrive(NamedTuple):
    """What was known of a drive when its line was lost."""

    identity: Mapping[str, Value]
    positions: Mapping[str, int]
    """Empty: it had moved, was commanded since, or was not read yet."""
    settings: Mapping[str, Value] | None
    """None: it was commanded since, or they were not read yet."""
    commanded: bool
    """Something that may do more than ask was sent to it since it was last read, or since it was opened."""
    read: bool
    """Its position was read in this session."""


def _identity(drive: Drive) -> Mapping[str, Value]:
    state = drive.state
    return {"product": state.product, "version": state.version, "part": state.part, "serial number": state.serial}


class Returns:
    """The drives of one session that comes back by itself."""

    def __init__(self, shell: Session) -> None:
        self._shell = shell
        self._lost: dict[Bus, dict[Drive, KnownDrive]] = {}
        self._tasks: dict[Bus, asyncio.Task[None]] = {}
        self._refused: set[tuple[Drive, str]] = set()
        """Parts that a drive refuses: each refusal may start a subroutine for errors in it."""
        self._programs_read: set[Drive] = set()
        """The drives that were asked, since their line is open, whether a program runs; of others that is a guess."""
        self._following = asyncio.get_running_loop().create_task(self._follow())
        self._leave = shell.subscribe(self._take, Lost, Changed)

    def close(self) -> None:
        """End it."""
        self._leave()
        for task in (self._following, *self._tasks.values()):
            task.cancel()

    async def compared(self) -> None:
        """Wait until what came back is compared."""
        if running := [task for task in self._tasks.values() if not task.done()]:
            await asyncio.wait(running)

    async def note(self, drive: Drive) -> None:
        """Read what a return is compared with, unless it is known. Raises DriveError or TransportLost."""
        drive.strict = True
        if not drive.rested:
            await drive.motion(Priority.POLL)
        if self._known(drive).settings is None or not drive.calm:
            await self._settings(drive, every=not drive.calm)

    async def _settings(self, drive: Drive, *, every: bool = False) -> dict[str, Value]:
        """Read the settings of a drive, and with `every` all of its conditions. Raises NoAnswer."""
        values = dict[str, Value]()
        for part in drive.family.values.parts({}):
            if (part.slow or every) and (drive, part.name) not in self._refused:
                commands = drive.commands
                try:
                    facts = await drive.run(part.read())
                except Refused:
                    self._refused.add((drive, part.name))
                    continue
                if part.slow:
                    drive.settings[part.name] = facts, commands
                    values |= facts
        if every:
            self._programs_read.add(drive)
        return values

    def _known(self, drive: Drive) -> KnownDrive:
        parts = [part.name for part in drive.family.values.parts({}) if part.slow]
        parts = [name for name in parts if (drive, name) not in self._refused]
        current = all(name in drive.settings and drive.settings[name][1] == drive.commands for name in parts)
        settings = {k: value for name in parts for k, value in drive.settings[name][0].items()} if current else None
        at, commands, places = drive.resting
        stale = any(drive.settings[name][1] != drive.commands for name in parts if name in drive.settings)
        commanded = drive.commands != commands or drive.started_at > at or stale
        positions = drive.rested
        if not commanded and not self._ran_program(drive):
            positions = positions or places
        return KnownDrive(_identity(drive), positions, settings, commanded, read=at > NEVER)

    def _ran_program(self, drive: Drive) -> bool:
        """Whether a drive has shown that a program runs; false where that is only a guess."""
        runs = drive.running is not None and drive.running.runs
        return runs or (drive.state.running and drive in self._programs_read)

    async def _follow(self) -> None:
        while True:
            for bus in [each for each in self._shell.buses.values() if each.link.away is None]:
                for drive in list(bus.drives.values()):
                    if not (drive.programming or drive.transferring or drive.state.settings_unknown):
                        with isolated(f"reading {drive.shown}"), contextlib.suppress(DriveError, TransportLost):
                            await self.note(drive)
            await asyncio.sleep(LOOK_PERIOD)

    def _take(self, event: SessionEvent) -> None:
        bus = self._shell.buses.get(event.bus) if isinstance(event, OnBus) else None
        if bus is None or not isinstance(event, OnBus):
            return
        if isinstance(event.event, Lost) and bus not in self._lost:
            self._lost[bus] = {drive: self._known(drive) for drive in bus.all_drives}
            self._programs_read.difference_update(bus.all_drives)
        elif isinstance(event.event, Changed) and bus in self._lost and bus.link.away is None and not self._busy(bus):
            self._tasks[bus] = asyncio.get_running_loop().create_task(self._compare(bus))

    def _busy(self, bus: Bus) -> bool:
        return bus in self._tasks and not self._tasks[bus].done()

    async def _compare(self, bus: Bus) -> None:
        for drive, before in self._lost[bus].items():
            trouble = [UNKNOWN]
            with isolated(f"the return of {drive.shown}", trouble):
                trouble[:] = await self._differences(bus, drive, before)
            if bus.link.away is not None:
                return  # lost again: compared after the next return
            if trouble:
                drive.hold = "; ".join(trouble)
                drive.state.reference_lost(drive.family.units.axes())
                text = f"{self._shell.display_name(drive)}: {drive.hold}: nothing moves it until its position counts"
                self._shell.notify(text, bus=bus.name, warning=True)
        del self._lost[bus]

    async def _differences(self, bus: Bus, drive: Drive, before: KnownDrive) -> list[str]:
        if drive not in bus.drives.values():
            return ["it has not replied since its line was lost"]
        try:
            axes, now = await drive.motion(), await self._settings(drive)
        except (DriveError, TransportLost) as failure:
            return ["it does not reply since its line was lost" if isinstance(failure, NoAnswer) else str(failure)]
        if before.commanded:
            return [UNKNOWN]
        if before.read and not before.positions:
            return [MOVED]
        was = {f"{axis} position".strip(): position for axis, position in before.positions.items()}
        places = {f"{axis.axis} position".strip(): axis.position for axis in axes}
        identity = {name: value for name, value in _identity(drive).items() if before.identity[name]}
        now = {**identity, **(now if before.settings is not None else {}), **(places if was else {})}
        known = {name: value for name, value in before.identity.items() if value}
        differences = differing({**known, **(before.settings or {}), **was}, now)
        return [f"{name.replace('_', ' ')} {old} before its line was lost, {new} now" for name, old, new in differences]
