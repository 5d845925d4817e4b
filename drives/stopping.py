"""Stopping a line: what to write, and seeing afterwards that it worked.

A stop is only believed when the velocity has been read as 0 (screen and log must not lie), so once the wire is
quiet and the stop has been repeated, every drive is asked; one that still moves is stopped again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dialects import Dialect, DriveError, Priority, Stopped
from dialects.families import PLAIN
from transports import TransportLost

if TYPE_CHECKING:
    from drives.bus import Bus
    from drives.drive import Drive

TRIES = 3


@dataclass(frozen=True)
class Forms:
    """What stops every drive on a bus, each form once."""

    at_once: bytes
    unended: bytes
    """The same, of which no byte ends a line that was half sent."""
    again: tuple[bytes, ...]
    """The same, to be written piece by piece when it is quiet."""
    spoil: bytes
    """What makes a half-sent line harmless."""
    framed: bool
    """Messages carry their length: one that has begun to leave must leave whole."""


def stop_forms(bus: Bus) -> Forms:
    """The bytes that stop every drive on the bus, those too that were only spoken to or are being looked for."""
    groups: dict[tuple[Dialect, bool], list[str]] = {}
    for drive in bus.reached:
        names = groups.setdefault((drive.dialect, not drive.known.stale), [])
        names.append(drive.address or drive.known.name)
    if bus.called or not groups:
        groups.setdefault((PLAIN[bus.family], False), []).extend(bus.called)
    at_once: list[bytes] = []
    unended: list[bytes] = []
    again: list[bytes] = []
    spoils: list[bytes] = []
    for (dialect, sure), names in groups.items():
        stop, spoil = dialect.stop(names, sure), dialect.spoil()
        if stop not in at_once:
            if at_once and dialect.stop_gap is not None:
                again.insert(0, stop)  # its answer and the first one's would run into each other
            else:
                at_once.append(stop)
                unended.append(dialect.stop(names, sure, half_sent=True))
            again += dialect.stop_again(names, sure)
        spoils += [spoil] if spoil not in spoils else []
    framed = any(dialect.framed for dialect, _ in groups)
    return Forms(b"".join(at_once), b"".join(unended), tuple(again), b"".join(spoils), framed)


async def confirm_stop(bus: Bus) -> None:
    """Read every drive's velocity and say what was found; stop again while one moves."""
    moving = bus.reached
    if not moving:
        bus.say("stop sent; no drive is known here, so it is not known whether all stand", warning=True)
    tries = 0
    while tries < TRIES:
        stops = bus.stops
        still = [drive for drive in moving if await _moves(drive)]
        if bus.stops != stops and not bus.lost:
            continue  # somebody has stopped it again meanwhile, so all of them are asked again
        if not still:
            return
        moving, tries = still, tries + 1
        if tries < TRIES:
            bus.stop()
    names = ", ".join(drive.shown for drive in moving)
    bus.say(f"STILL MOVING after {TRIES} stops: {names}; cut the power", warning=True)


async def _moves(drive: Drive) -> bool:
    if drive.programming and not drive.bus.engaged(drive):
        drive.bus.say(f"{drive.shown}: stop sent; in program mode it cannot be asked whether it stands", warning=True)
        return False
    try:
        axes = await drive.motion(Priority.OPERATOR)
    except Stopped:
        return True
    except (TimeoutError, DriveError, TransportLost) as error:
        drive.bus.say(f"{drive.shown}: stop sent, but it is not known whether it stands: {error}", warning=True)
        return False
    speeds = [axis.velocity for axis in axes if axis.velocity]
    if speeds:
        drive.bus.say(f"{drive.shown}: still moves at {speeds[0]} a second; stop sent again", warning=True)
    else:
        drive.bus.say(f"{drive.shown}: stopped, velocity 0 at {', '.join(str(a.position) for a in axes)}")
    return bool(speeds)
