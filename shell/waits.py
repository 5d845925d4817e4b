"""Waits: for a time, for drives to stand, for programs to end, for a value of a drive, for a text."""

from __future__ import annotations

import asyncio
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic, DriveError
from multidrop.drives.drive import REST

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.workspace import Workspace

LIMIT = 60.0
"""The default time limit, s."""
APART = REST
"""The time between the two readings of a drive at rest, and between those of a value, s."""
SHOWN = 3
"""The number of lines that a wait for a text shows when it runs out."""
SIGNS: Mapping[str, Callable[[int, int], bool]] = {
    "=": operator.eq,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_CONDITION = re.compile(
    r"(?:@(?P<target>\S+)\s+)?(?P<word>[A-Za-z][A-Za-z0-9_]*)\s*(?P<sign>[=!<>]=|[=<>])\s*(?P<value>[+-]?\d{1,15})",
    re.ASCII,
)


@dataclass(frozen=True)
class Condition:
    """A value that a drive must report: `I1=1` of the selected drive, `@b P>=51200` of another one."""

    target: str
    word: str
    sign: str
    value: int

    @property
    def text(self) -> str:
        """The condition without the drive."""
        return f"{self.word}{self.sign}{self.value}"

    def holds(self, seen: int) -> bool:
        """Whether a value that was read fits."""
        return SIGNS[self.sign](seen, self.value)


def condition(text: str) -> Condition | None:
    """Parse a condition; None for another text."""
    match = _CONDITION.fullmatch(text.strip())
    return Condition(match["target"] or "", match["word"], match["sign"], int(match["value"])) if match else None


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
    """The first drive that is not at rest, in one place, in both of two readings."""
    before: dict[Drive, tuple[int, ...]] = {}
    for reading in range(2):
        if reading:
            await sleep(APART)
        for drive in drives:
            if drive.programming:
                raise DriveError(
                    f"{workspace.display_name(drive)} is in program mode and would store the question; PG ends it"
                )
            place = await drive.rest()
            if place is None or before.setdefault(drive, place) != place or (idle and await drive.busy()):
                return drive
    return None


async def wait_value(workspace: Workspace, drive: Drive, wanted: Condition, limit: float) -> None:
    """Wait until a drive reports a value. Raises DriveError after `limit` seconds, Diagnostic for no such value."""
    line, name = _question(workspace, drive, wanted), workspace.display_name(drive)
    deadline = workspace.now() + limit
    while not wanted.holds(seen := await _value(workspace, drive, line)):
        if workspace.now() >= deadline:
            raise DriveError(f"/wait {wanted.text}: {name} still reports {seen} after {limit:g} s")
        await sleep(APART)


def _question(workspace: Workspace, drive: Drive, wanted: Condition) -> str:
    name = workspace.display_name(drive)
    if drive.link.name in workspace.raw:
        raise Diagnostic("is in raw mode, where no drive is asked", drive.link.name, "/raw off ends it")
    line = drive.family.question(wanted.word)
    if line is None or drive.starts(line):
        raise Diagnostic(f"{wanted.word} has no value to wait for", name)
    return line


async def _value(workspace: Workspace, drive: Drive, line: str) -> int:
    """Ask a drive for a value."""
    name = workspace.display_name(drive)
    if drive.programming:
        raise DriveError(f"{name} is in program mode and would store the question; PG ends it")
    printed = await drive.send(line)
    if len(printed) != 1 or not re.fullmatch(r"\s*[+-]?\d{1,15}\s*", printed[0], re.ASCII):
        raise DriveError(f"{name}: {line} printed {', '.join(printed) or 'nothing'}; a wait needs a whole number")
    return int(printed[0])


async def wait_text(workspace: Workspace, text: str, limit: float) -> None:
    """Wait until a drive prints a text; what came since the line before counts.

    Raises DriveError after `limit` seconds.
    """
    if not await workspace.lately.finds(text, limit):
        seen = ", ".join(f'"{line}"' for line in workspace.lately.last(SHOWN)) or "nothing"
        raise DriveError(f'/wait "{text}": not printed within {limit:g} s; seen {seen}')
