"""Restarts of drives that no drive reports: what is read after a silence is compared with what was read before it.

Theory of operation. A drive that replies again after a missing reply, or after a loss of its line, is read once:
position, and the settings that were read before. A restart leaves one of these signs: a sign-on; position 0 where the
drive rested elsewhere and nothing was sent, and no program ran, that can move it; a setting that is another one
although nothing was sent that sets it. Without a sign nothing is claimed: a drive may only have been slow. After a
restart the position counts from wherever the drive was, until a homing or a set position is seen as done. Only reads
are sent.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Mapping
from dataclasses import dataclass
from typing import Any

from multidrop.dialects import DriveError, NoAnswer
from multidrop.dialects.parameters import Value
from multidrop.drives.apart import apart
from multidrop.drives.drive import Drive, still
from multidrop.drives.link import Link
from multidrop.transports import TransportLost

PAUSE = 0.25
"""Seconds between two looks at a line that is away, or at a drive that homes."""
BOOT = 1.0
"""Seconds after a sign-on before the drive is asked."""
NAMED = 4
"""Most settings that a message names."""


@dataclass(frozen=True)
class Before:
    """What was known of a drive when it replied again."""

    rested: Mapping[str, int]
    """Positions of its axes at rest, if nothing was sent or ran since that can move them."""
    settings: Mapping[str, Value]
    """Settings as last read, if nothing was sent since that sets them."""
    sign: str
    """The sign of a restart that is there already: a sign-on."""


class Restarts:
    """Looks for restarts of the drives of one link, and for the homings after them."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._tasks: dict[Drive, asyncio.Task[None]] = {}
        self._homings: dict[tuple[Drive, str], asyncio.Task[None]] = {}

    def replied_again(self, drive: Drive, sign: str = "") -> None:
        """Compare a drive with what was known of it; `sign`: it has shown already that it restarted."""
        before = Before(_rested(drive), _unchanged(drive), sign)
        running = self._tasks.get(drive)
        if (sign or before.rested or before.settings) and (running is None or running.done()):
            self._tasks[drive] = self._begin(f"looking for a restart of {drive.shown}", self._look(drive, before))

    def homes(self, drive: Drive, axis: str) -> None:
        """Watch a homing of an axis whose position does not count, to its end."""
        if (before := self._homings.pop((drive, axis), None)) is not None:
            before.cancel()
        work = self._to_its_end(drive, axis, (drive.commands, drive.started_at))
        task = self._begin(f"watching the homing of {drive.shown}", work)
        self._homings[drive, axis] = task

    def close(self) -> None:
        """End all looking."""
        for task in (*self._tasks.values(), *self._homings.values()):
            task.cancel()

    def _begin(self, what: str, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        async def guarded() -> None:
            trouble: list[str] = []
            with apart(f"{what} on {self._link.name}", trouble):
                await work
            if trouble:
                self._link.notify(trouble[0], warning=True)

        return asyncio.get_running_loop().create_task(guarded())

    async def _look(self, drive: Drive, before: Before) -> None:
        """Read the drive once; say a restart that shows, once."""
        await asyncio.sleep(BOOT if before.sign else 0)
        while self._link.away is not None or drive.programming or drive.transferring:
            await asyncio.sleep(PAUSE)
        try:
            axes = await drive.motion()
            settings = await self._settings(drive, before) if before.settings else {}
        except (DriveError, TransportLost) as failure:
            drive.missing = isinstance(failure, NoAnswer)
            return
        at_rest = all(axis.velocity == 0 for axis in axes)
        jumped = [axis for axis in axes if at_rest and axis.position == 0 != before.rested.get(axis.axis, 0)]
        changed = [name for name, value in settings.items() if value != before.settings[name]]
        if not (before.sign or jumped or changed):
            return
        signs = [before.sign] if before.sign else []
        for axis in axes:
            name = f"{axis.axis} " if axis.axis else ""
            was = f"{before.rested[axis.axis]} before, " if axis.axis in before.rested else ""
            signs.append(f"{name}position {was}{axis.position} now")
        for name in changed:
            signs.append(f"{_shown(name)} {_text(before.settings[name])} before, {_text(settings[name])} now")
        more = f"; {len(signs) - NAMED} more differ" if len(signs) > NAMED else ""
        drive.state.reference_lost(axis.axis for axis in axes)
        verb = f"/referenced {drive.address}".rstrip()
        self._link.notify(
            f"{drive.shown} was restarted ({'; '.join(signs[:NAMED])}{more}): its position is not referenced; "
            f"home it, set its position, or {verb} if it is right",
            drive.address,
            warning=True,
        )

    @staticmethod
    async def _settings(drive: Drive, before: Before) -> Mapping[str, Value]:
        """Read the known settings again."""
        reader = drive.family.conditions
        found: dict[str, Value] = {}
        if reader is not None:
            for part in reader.parts(drive.state, {}):
                if part.slow and part.name in drive.settings:
                    found |= await drive.run(part.read(drive.state))
        return {name: value for name, value in found.items() if name in before.settings}

    async def _to_its_end(self, drive: Drive, axis: str, sent: tuple[int, float]) -> None:
        """Wait until the drive rests; the axis is referenced if nothing was `sent` in between and no error is set."""
        stops = self._link.stops
        try:
            while not await still(drive):
                await asyncio.sleep(PAUSE)
            ended_well = await drive.run(drive.family.homed(drive.state))
        except (DriveError, TransportLost):
            return
        if ended_well and (drive.commands, drive.started_at) == sent and self._link.stops == stops:
            drive.state.referenced(axis)
            name = f" {axis}" if axis else ""
            self._link.notify(f"{drive.shown}{name} is referenced: the homing has ended", drive.address)


def _rested(drive: Drive) -> Mapping[str, int]:
    """The last positions at rest, if no program ran and nothing was sent since that can change them; else none."""
    at, commands, positions = drive.resting
    return positions if drive.calm and drive.started_at <= at and commands == drive.commands else {}


def _unchanged(drive: Drive) -> Mapping[str, Value]:
    """The settings as last read, if no program ran and nothing was sent since that can set them; else none."""
    known = [facts for facts, commands in drive.settings.values() if drive.calm and commands == drive.commands]
    return {name: value for facts in known for name, value in facts.items()}


def _shown(name: str) -> str:
    """A setting as a person knows it: `VM`, `run current 0`."""
    return name.replace("_", " ").lower() if "_" in name else name


def _text(value: Value) -> str:
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
