"""Confirmation of a stop: read the velocities, and stop again what moves on.

A stop is believed only when the velocity was read as 0: screen and log must not lie. So each drive is read once the
wire is quiet and the stop was repeated. A drive that still moves and does not slow down is stopped again, unless a
command has started it since.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from dialects import DriveError, Priority, Stopped
from drives.drive import Drive
from drives.halt import Halt
from transports import TransportLost

TRIES = 3
BETWEEN = 0.1
"""Time between two readings of a drive that may be slowing down, s."""
RAMP = 30.0
"""How long a drive is read that slows down, or was stopped in vain, s."""
ENDLESS = 1 << 40
"""Speed of a drive that another stop kept from being read: faster than any."""


async def confirm_stop(halt: Halt, repeat: Callable[[Halt], None], superseded: Callable[[Halt], bool]) -> None:
    """Read the drives of a stop and publish what was found; `repeat` it for what moves and does not slow down."""
    link = halt.link
    unconfirmed = list(halt.affected)
    if not unconfirmed:
        link.notify("stop sent; no drive is known here, so no velocity could be read", warning=True)
    before: dict[Drive, int] = {}
    moving: list[Drive] = []
    tries, until = 0, link.now() + RAMP
    while unconfirmed and link.now() < until:
        speeds = {drive: await _speed(drive, halt) for drive in unconfirmed if not halt.started_since(drive)}
        if superseded(halt) and not link.lost:
            return
        moving = [drive for drive, speed in speeds.items() if speed and not halt.started_since(drive)]
        slow_down = all(speeds[drive] < before.get(drive, speeds[drive] + 1) for drive in moving)
        before = speeds
        if moving and not slow_down and tries < TRIES:
            tries += 1
            _once_more(halt, {drive: speeds[drive] for drive in moving}, tries, repeat)
        # The line of an operator that may start a drive may also be refused, and then nothing has started it.
        undecided = [drive for drive in unconfirmed if halt.started_since(drive) and drive.starting]
        unconfirmed = moving + undecided
        if unconfirmed:
            await asyncio.sleep(BETWEEN)
    if moving and tries < TRIES:
        names = ", ".join(drive.shown for drive in moving)
        link.notify(f"{names}: slows down for more than {RAMP:g} s", warning=True)


def _once_more(halt: Halt, speeds: dict[Drive, int], tries: int, repeat: Callable[[Halt], None]) -> None:
    """Stop again what moves on, or give up and say so."""
    link = halt.link
    if tries == TRIES:
        halt.vain = True
        names = ", ".join(drive.shown for drive in speeds)
        link.notify(f"STILL MOVING after {TRIES} stops: {names}; cut the power", warning=True)
        return
    for drive, speed in speeds.items():
        link.notify(f"{drive.shown}: still moves at {speed} a second; stop sent again", warning=True)
    repeat(halt)


async def _speed(drive: Drive, halt: Halt) -> int:
    """Read the unsigned speed of a drive; 0 also where it cannot be read, which is published."""
    if drive.programming and not drive.engaged:
        return _not_known(drive, halt, "its velocity cannot be read in program mode")
    try:
        axes = await drive.motion(Priority.OPERATOR)
    except Stopped:
        return ENDLESS
    except (TimeoutError, DriveError, TransportLost) as error:
        return _not_known(drive, halt, f"its velocity could not be read: {error}")
    halt.doubts.pop(drive, None)
    speed = max(abs(axis.velocity) for axis in axes)
    if not speed:
        drive.link.notify(f"{drive.shown}: stopped, velocity 0 at {', '.join(str(a.position) for a in axes)}")
    return speed


def _not_known(drive: Drive, halt: Halt, why: str) -> int:
    halt.doubts[drive] = why
    drive.link.notify(f"{drive.shown}: stop sent, but {why}", warning=True)
    return 0
