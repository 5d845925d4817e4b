"""Waiting: for a time, for drives to stand, for programs to end."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dialects import Diagnostic, DriveError

if TYPE_CHECKING:
    from drives.drive import Drive
    from shell.workspace import Workspace

LIMIT = 60.0
"""Seconds that a wait lasts at most, unless given."""
APART = 0.05
"""Seconds between the two readings of a velocity of 0."""


def seconds(text: str, wrong: Callable[[str], Diagnostic]) -> float:
    """A time as typed, s: 0 to a day. Raises what `wrong` makes."""
    if not re.fullmatch(r"\d+(\.\d*)?|\.\d+", text, re.ASCII) or float(text) > 86400:
        raise wrong(f"{text} is not a time in seconds")
    return float(text)


async def sleep(duration: float) -> None:
    """Wait that many seconds."""
    await asyncio.sleep(duration)


async def wait(workspace: Workspace, limit: float, *, idle: bool) -> None:
    """Until every addressed drive has stood in two readings APART; with `idle`, also runs no program.

    Raises DriveError when `limit` seconds are over, or where a drive is in program mode (it would store the question).
    """
    deadline = workspace.now() + limit
    drives = workspace.addressed_drives()
    while moving := await _moving(workspace, drives, idle):
        if workspace.now() >= deadline:
            verb = "/wait idle" if idle else "/wait stopped"
            raise DriveError(f"{verb}: {workspace.display_name(moving)} is still at work after {limit:g} s")
        await sleep(APART)


async def _moving(workspace: Workspace, drives: Sequence[Drive], idle: bool) -> Drive | None:
    """The first drive that is not at rest in both of two readings."""
    for reading in range(2):
        if reading:
            await sleep(APART)
        for drive in drives:
            if drive.programming:
                raise DriveError(
                    f"{workspace.display_name(drive)} is in program mode and would store the question; PG ends it"
                )
            if not await drive.still() or (idle and await drive.busy()):
                return drive
    return None
