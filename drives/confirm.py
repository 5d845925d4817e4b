"""Confirmation of a stop: read velocities and programs, and stop again what moves or runs on.

A stop is believed only when two readings show the drive at rest and no program runs that can move it: screen and log
must not lie. So each drive is read once the wire is quiet and the stop was repeated. A drive that still moves and does
not slow down is stopped again, and so is one whose program runs, unless a command has started it since.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from multidrop.dialects import DriveError, Motion, Priority, Stopped
from multidrop.drives.drive import Drive
from multidrop.drives.events import Sample, Transaction
from multidrop.drives.halt import Fate, Halt
from multidrop.transports import TransportLost

TRIES = 3
BETWEEN = 0.1
"""Time between two readings of a drive that may be slowing down, s."""
RAMP = 30.0
"""How long a drive is read that slows down, or was stopped in vain, s."""


class Activity(NamedTuple):
    """What a drive did when it was read; nothing, where that is not known."""

    speed: int = 0
    """Unsigned, of its fastest axis."""
    runs: bool = False
    """A program runs."""
    places: str = ""
    """The positions of its axes; empty: not read."""

    @property
    def none(self) -> bool:
        """Whether it neither moves nor runs a program, or nothing is known."""
        return not self.speed and not self.runs

    def lessens(self, before: Activity | None) -> bool:
        """Whether it slows down, as far as two readings show, and no program runs that can move it again."""
        return not self.runs and (before is None or self.speed < before.speed)


NOTHING = Activity()
ENDLESS = Activity(1 << 40)
"""Of a drive that another stop kept from being read: faster than any."""


async def confirm_stop(halt: Halt, repeat: Callable[[Halt], None], superseded: Callable[[Halt], bool]) -> None:
    """Read the drives of a stop and publish what was found; `repeat` it for what goes on and does not slow down."""
    link = halt.link
    unconfirmed = list(halt.affected)
    if not unconfirmed:
        link.notify("stop sent; no drive is known here, so no velocity could be read", warning=True)
    before: dict[Drive, Activity] = {}
    active: dict[Drive, Activity] = {}
    tries, until = 0, link.now() + RAMP
    while unconfirmed and link.now() < until:
        found = {drive: await _read(drive, halt) for drive in unconfirmed if not halt.started_since(drive)}
        _announce(halt, found)
        if superseded(halt) and not link.lost:
            return
        active = {drive: each for drive, each in found.items() if not each.none and not halt.started_since(drive)}
        slow_down = all(each.lessens(before.get(drive)) for drive, each in active.items())
        before = found
        if active and not slow_down and tries < TRIES:
            tries += 1
            _once_more(halt, active, tries, repeat)
        # The line of an operator that may start a drive may also be refused, and then nothing has started it.
        undecided = [drive for drive in unconfirmed if halt.started_since(drive) and drive.starting]
        once = [drive for drive, each in found.items() if each.none and halt.fate(drive) is Fate.SENT]
        unconfirmed = [*active, *undecided, *once]
        if unconfirmed:
            await asyncio.sleep(BETWEEN)
    if active and tries < TRIES:
        names = ", ".join(drive.shown for drive in active)
        link.notify(f"{names}: slows down for more than {RAMP:g} s", warning=True)


def _announce(halt: Halt, found: Mapping[Drive, Activity]) -> None:
    """Say which drives stand, whether this reading or a poll after it has confirmed that."""
    for drive, each in found.items():
        if each.places and each.none and halt.fate(drive) is Fate.STANDING:
            halt.link.notify(f"{drive.shown}: stopped, velocity 0 at {each.places}")


def _once_more(halt: Halt, active: Mapping[Drive, Activity], tries: int, repeat: Callable[[Halt], None]) -> None:
    """Stop again what goes on, or give up and say so."""
    link = halt.link
    if tries == TRIES:
        halt.vain = True
        for goes_on, moves in (("MOVING", True), ("RUNNING", False)):
            if names := ", ".join(drive.shown for drive, each in active.items() if bool(each.speed) is moves):
                link.notify(f"STILL {goes_on} after {TRIES} stops: {names}; cut the power", warning=True)
        return
    for drive, each in active.items():
        does = f"still moves at {each.speed} a second" if each.speed else "its program still runs"
        link.notify(f"{drive.shown}: {does}; stop sent again", warning=True)
    repeat(halt)


async def _read(drive: Drive, halt: Halt) -> Activity:
    """Read and publish what a drive does; NOTHING also where that cannot be read, which is a doubt of the stop."""
    if drive.programming and not drive.engaged:
        return _not_known(drive, halt, "its velocity cannot be read in program mode")
    ended: list[Transaction] = []
    try:
        axes = await drive.motion(Priority.OPERATOR, ended.append)
        runs, why = await _program(drive, axes)
    except Stopped:
        return ENDLESS
    except (TimeoutError, DriveError, TransportLost) as error:
        return _not_known(drive, halt, f"its velocity could not be read: {error}")
    at = ended[-1].transmitted_at
    for each in axes:
        drive.link.publish(Sample(at, drive.address, each.position, each.velocity, each.axis, each.trouble, runs))
    if why:
        return _not_known(drive, halt, why)
    halt.doubts.pop(drive, None)
    speed = abs(drive.seen.velocity) if drive.seen is not None else 0
    return Activity(speed, bool(runs), ", ".join(str(each.position) for each in axes))


async def _program(drive: Drive, axes: Sequence[Motion]) -> tuple[bool | None, str]:
    """Whether a program runs, None where that is not asked: a drive that moves is stopped again; or why not known."""
    runs = axes[0].program
    if runs is not None or any(axis.velocity for axis in axes):
        return runs, ""
    try:
        return await drive.busy(), ""
    except Stopped:
        raise
    except (TimeoutError, DriveError, TransportLost) as error:
        return None, f"velocity 0 was read, and whether a program runs was not: {error}"


def _not_known(drive: Drive, halt: Halt, why: str) -> Activity:
    halt.doubts[drive] = why
    drive.link.notify(f"{drive.shown}: stop sent, but {why}", warning=True)
    return NOTHING
