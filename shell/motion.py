"""The positions of drives, and the drives that would keep moving if this program ended now, from fresh readings."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from multidrop.dialects import DriveError
from multidrop.drives.drive import confirmed_motion
from multidrop.shell.stop_report import UNCONFIRMED, last_seen
from multidrop.transports import TransportLost

if TYPE_CHECKING:
    from multidrop.dialects import Motion
    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Drive, Running
    from multidrop.shell.workspace import Workspace

FRESH = 1.0
"""The age up to which a reading counts, s."""
PROGRAM_FRESH = 10.0
"""The age up to which it counts whether a program runs, s: the longest time between two readings of conditions."""
LIMIT = 2.0
"""The longest time to read the drives of a bus, s; a silent drive takes half of it."""


@dataclass(frozen=True)
class Standing:
    """Position and velocity of a drive, read now; without axes the reason why they are not known."""

    name: str
    axes: tuple[Motion, ...] = ()
    why: str = ""
    unconfirmed: bool = False
    """It reads velocity 0, and its position may change."""

    @property
    def text(self) -> str:
        """In words: `b stands at 51200`."""
        if not self.axes:
            return f"{self.name} not known ({self.why})"
        if self.unconfirmed:
            return f"{self.name} {UNCONFIRMED}; now {' and '.join(str(each.position) for each in self.axes)}"
        return f"{self.name} {' and '.join(map(_axis, self.axes))}"

    @property
    def fact(self) -> dict[str, int | dict[str, int]] | None:
        """The position as an object for programs; None: not known."""
        if not self.axes:
            return None
        if len(self.axes) == 1 and not self.axes[0].axis:
            return {"position": self.axes[0].position, "velocity": self.axes[0].velocity}
        return {each.axis: {"position": each.position, "velocity": each.velocity} for each in self.axes}


def _axis(each: Motion) -> str:
    axis = f"{each.axis} " if each.axis else ""
    return (
        f"{axis}moves at {each.velocity} a second at {each.position}"
        if each.velocity
        else f"{axis}stands at {each.position}"
    )


async def standings(workspace: Workspace, drives: Iterable[Drive]) -> tuple[Standing, ...]:
    """Read the positions of drives: those of one bus in turn, LIMIT at most for each bus."""
    by_bus: dict[str, list[Drive]] = {}
    for drive in drives:
        by_bus.setdefault(drive.link.name, []).append(drive)
    found = await asyncio.gather(*(_standing(workspace, each) for each in by_bus.values()))
    return tuple(each for bus in found for each in bus)


async def _standing(workspace: Workspace, drives: Sequence[Drive]) -> list[Standing]:
    """Read the drives of one bus; the line has no time left for those that the limit leaves out."""
    found = {drive: Standing(workspace.display_name(drive), why="no time was left to ask") for drive in drives}
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(LIMIT):
            for drive in drives:
                name = workspace.display_name(drive)
                try:
                    found[drive] = Standing(name, why=_unasked(drive))
                    if not found[drive].why:
                        found[drive] = Standing(name, why="no answer")
                        axes = await confirmed_motion(drive)
                        found[drive] = Standing(
                            name, axes, unconfirmed=not any(axis.velocity for axis in axes) and not _rests(drive)
                        )
                except (DriveError, TransportLost) as failure:
                    found[drive] = Standing(name, why=str(failure).removeprefix(f"{name}: "))
    return [found[drive] for drive in drives]


def _rests(drive: Drive) -> bool:
    return drive.seen is not None and drive.seen.at_rest()


def _unconfirmed(drive: Drive) -> bool:
    return drive.seen is not None and not drive.seen.velocity and not drive.seen.at_rest()


def _unasked(drive: Drive) -> str:
    """The reason not to ask a drive; empty: it can be asked."""
    if drive.link.away is not None:
        return "the connection is lost"
    return "it is in program mode" if drive.programming else ""


async def in_motion(workspace: Workspace) -> list[str]:
    """A line for each drive that moves or runs a program, and for each known drive whose motion cannot be read."""
    begun = workspace.now()
    await asyncio.gather(*(_read(bus) for bus in workspace.buses.values()))
    lines = []
    for bus in workspace.buses.values():
        for drive in bus.all_drives:
            if text := _described(drive, begun, workspace.now()):
                lines.append(f"{workspace.display_name(drive)} {text}")
    return lines


async def _read(bus: Bus) -> None:
    """Read the drives whose readings are old, in turn; silent drives last, since time may run out."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(LIMIT):
            for drive in sorted(bus.all_drives, key=_last_contact, reverse=True):
                if (not _fresh(drive, bus.now()) or _unconfirmed(drive)) and _answers(drive):
                    with contextlib.suppress(DriveError, TransportLost):
                        await confirmed_motion(drive)
            for drive in bus.all_drives:
                at_rest = _fresh(drive, bus.now()) and drive.seen is not None and not drive.seen.velocity
                if at_rest and _answers(drive) and _program(drive, bus.now()) is None:
                    with contextlib.suppress(DriveError, TransportLost):
                        await drive.busy()


def _program(drive: Drive, now: float) -> Running | None:
    """Whether a program runs in a drive, if that was read lately and after its last start."""
    running = drive.running
    return running if running is not None and running.at > max(now - PROGRAM_FRESH, drive.started_at) else None


def _answers(drive: Drive) -> bool:
    """Whether a drive can be asked now: a drive in program mode would store the question."""
    return not drive.programming and not drive.transferring


def _last_contact(drive: Drive) -> float:
    return max(drive.started_at, drive.seen.at if drive.seen is not None else float("-inf"))


def _fresh(drive: Drive, since: float) -> bool:
    """Whether a drive was read after its last start, at most FRESH before `since`, and its bus still works."""
    seen = drive.seen
    return seen is not None and seen.at > max(since - FRESH, drive.started_at) and not drive.link.away


def _described(drive: Drive, begun: float, now: float) -> str:
    if _fresh(drive, begun) and drive.seen is not None:
        if _unconfirmed(drive):
            return UNCONFIRMED
        if drive.seen.velocity:
            return f"moves at {drive.seen.velocity} a second"
        running = _program(drive, begun)
        return "runs a program, which may move it" if running is not None and running.runs else ""
    known = bool(drive.product) or drive.seen is not None or drive.commands
    return f"is not known: {last_seen(drive, now)}" if known else ""
