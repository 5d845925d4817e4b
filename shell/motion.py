"""The drives that would keep moving if this program ended now, from fresh readings of their velocity."""

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
    from shell.workspace import Workspace

FRESH = 1.0
"""The age up to which a reading counts, s."""
LIMIT = 2.0
"""The longest time to read the drives of a bus, s; a silent drive takes half of it."""


async def in_motion(workspace: Workspace) -> list[str]:
    """A line for each drive that moves, and for each known drive whose motion cannot be read."""
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
                if not _fresh(drive, bus.now()) and _answers(drive):
                    with contextlib.suppress(DriveError, TransportLost):
                        await drive.motion()


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
        return f"moves at {drive.seen.velocity} a second" if drive.seen.velocity else ""
    known = bool(drive.product) or drive.seen is not None or drive.commands
    return f"is not known: {last_seen(drive, now)}" if known else ""
