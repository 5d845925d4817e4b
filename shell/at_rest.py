"""What a drive does as a line of an automation fails: read before a stop of it is written, or left out.

A drive whose family has a routine for errors may move after a line that it has refused. So MV and BY are read twice
after that, and before a line for which the tables do not vouch, where it is not known what the drive does. Reading them
changes nothing.
"""

from __future__ import annotations

import asyncio

from multidrop.base.errors import DriveError, Stopped, TransportLost
from multidrop.drives.drive import LEAST_REST, Drive

ROUTINE = "its OE routine may have started"
READING_TIMEOUT = 1.0
"""The longest time for these readings, s."""
READING_TRIES = 2
RECENT = 1.0
"""The greatest age of a reading of a drive that moves, s."""
LOST = (TimeoutError, DriveError, TransportLost)


async def excused(drive: Drive) -> bool:
    """Read whether a drive that was at rest still is, runs no program and has no trips enabled: it needs no stop."""
    try:
        async with asyncio.timeout(READING_TIMEOUT):
            ready = await drive.run(drive.family.values.parameters.ready())
            return not ready and not await drive.busy()
    except LOST:
        return False


async def active(drive: Drive) -> bool:
    """Read whether a drive runs a program or moves."""
    runs = await drive.busy()
    moves = await drive.run(drive.family.moving())
    drive.noted = (drive.link.now(), runs or moves)
    return runs or moves


async def _active_twice(drive: Drive) -> bool:
    if await active(drive):
        return True
    await asyncio.sleep(LEAST_REST)
    return await active(drive)


async def at_rest_after_error(drive: Drive) -> bool:
    """Read twice after an error whether a drive is at rest and runs no program; False also where that is not known."""
    try:
        async with asyncio.timeout(READING_TIMEOUT):
            return not await _active_twice(drive)
    except LOST:
        return False


def known_active(drive: Drive) -> bool | None:
    """Whether a drive moved or ran a program when it was last read; None where that is not known."""
    readings = [drive.noted] if drive.noted is not None else []
    if drive.seen is not None and drive.seen.velocity:
        readings.append((drive.seen.at, True))
    if drive.running is not None and drive.running.runs:
        readings.append((drive.running.at, True))
    since = max(drive.commanded_at, drive.link.now() - RECENT)
    if any(moves and at > since for at, moves in readings):
        return True
    return False if any(not moves and at > drive.commanded_at for at, moves in readings) else None


async def look_before(drive: Drive, text: str) -> None:
    """Read what a drive does before a line that it may refuse, where that is not known. Raises Stopped."""
    if drive.family.vouched(text, drive.product) or known_active(drive) is not None or drive.missing:
        return
    for _ in range(READING_TRIES):  # noise may have damaged a reply, and asking again changes nothing
        try:
            async with asyncio.timeout(READING_TIMEOUT):
                await active(drive)
            return
        except Stopped:
            raise
        except LOST:
            continue
