"""What would go on moving if this program ended now: from the last readings, and a quick one where those are old."""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING

from dialects import DriveError
from shell.stops import last_seen
from transports import TransportLost

if TYPE_CHECKING:
    from drives.bus import Bus
    from drives.drive import Drive
    from shell.session import Session

FRESH = 1.0
"""Seconds for which a reading counts."""
QUICK = 2.0
"""Seconds that reading the drives of a bus may take, at most: a silent one takes the half of it."""


async def in_motion(session: Session) -> list[str]:
    """A line for each drive that moves, and for each of which that is not known though it has answered before."""
    begun = session.now()
    await asyncio.gather(*(_read(bus) for bus in session.buses.values()))
    told = []
    for bus in session.buses.values():
        for drive in bus.all_drives:
            if text := _told(drive, begun, session.now()):
                told.append(f"{session.display_name(drive)} {text}")
    return told


async def _read(bus: Bus) -> None:
    """Read the drives whose last readings are old, in turn; those that were silent last, as time may not do for all."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(QUICK):
            for drive in sorted(bus.all_drives, key=_heard, reverse=True):
                if not _fresh(drive, bus.now()) and not drive.programming and not drive.transferring:
                    with contextlib.suppress(DriveError, TransportLost):
                        await drive.motion()


def _heard(drive: Drive) -> float:
    return max(drive.started_at, drive.seen.at if drive.seen is not None else float("-inf"))


def _fresh(drive: Drive, since: float) -> bool:
    """Whether a drive was read since a second before that, and since something was sent that may have started it."""
    seen = drive.seen
    return seen is not None and seen.at > max(since - FRESH, drive.started_at) and not drive.bus.lost


def _told(drive: Drive, begun: float, now: float) -> str:
    if _fresh(drive, begun) and drive.seen is not None:
        return f"moves at {drive.seen.velocity} a second" if drive.seen.velocity else ""
    state = bool(drive.product) or drive.seen is not None or drive.commands
    return f"is not known: {last_seen(drive, now)}" if state else ""
