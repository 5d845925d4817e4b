"""The programs that a drive holds, as read from it, and how they differ from a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from multidrop.dialects.errors import Refused

LOCKED = "its program is locked (LK=1); LK=0 opens a lock that was not saved; CP opens any, and erases the program"


class Stored(NamedTuple):
    """A line in a drive: its address, or its number in memory, and its text as the drive lists it."""

    at: int
    text: str


@dataclass(frozen=True)
class Held:
    """Everything that a drive holds of programs."""

    lines: tuple[Stored, ...] = ()
    names: tuple[str, ...] = ()
    """Variables with their values, and labels with their places, as the drive prints them."""
    locked: bool = False
    """The drive lists no program: it is locked."""

    def check_listed(self, who: str) -> None:
        """Raise Refused where the drive is locked; `who` names it for a person."""
        if self.locked:
            raise Refused(f"{who}: no listing: {LOCKED}")

    def check_program(self, who: str) -> None:
        """Raise Refused where the drive is locked or holds no program."""
        self.check_listed(who)
        if not self.lines:
            raise Refused(f"{who} holds no program")


class Difference(NamedTuple):
    """A line that is not the same in a file and in a drive.

    `number`: of the file's line; 0: the file has none. `at`: the place in the drive; None: the drive has none.
    """

    number: int
    here: str
    at: int | None
    there: str
