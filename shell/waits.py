"""Waits: for a time, for drives to stand, for programs to end."""

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
"""The default time limit, s."""
APART = 0.05
"""The time between the two readings of velocity 0, s."""


def seconds(text: str, wrong: Callable[[str], Diagnostic]) -> float:
    """Parse a time, s: 0 to a day. Raises the Diagnostic that `wrong` returns."""
    if not re.fullmatch(r"\d+(\.\d*)?|\.\d+", text, re.ASCII) or float(text) > 86400:
        raise wrong(f"no time {text}; valid: 0 to 86400 seconds")
    return float(text)


async def sleep(duration: float) -> None:
    """Wait for a time, s."""
    await asyncio.sleep(duration)


async def wait(workspace: Workspace, limit: float, *, idle: bool, drives: Sequence[Drive] | None = None) -> None:
    """Wait until every addressed drive is at rest in two readings; with `idle`, also until no program runs.

    `drives`: wait for these instead. Raises DriveError after `limit` seconds, and for a drive in program mode (it would
    store the question).
    """
    deadline = workspace.now() + limit
    drives = workspace.addressed_drives() if drives is None else drives
    while moving := await _moving(workspace, drives, idle):
        if workspace.now() >= deadline:
            verb = "/wait idle" if idle else "/wait stopped"
            raise DriveError(f"{verb}: {workspace.display_name(moving)} still runs after {limit:g} s")
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
