"""Reading the program in an MCode drive, and making a file of it."""

from __future__ import annotations

import re

from dialects.codec import Procedure
from dialects.errors import Refused
from dialects.mcode.host.operations import listing, perform
from dialects.mcode.host.state import MCodeState
from dialects.mcode.host.wording import who

GAP = 64
"""Bytes between the addresses of two lines; more than a line can take is a program of its own."""
_LISTED = re.compile(r"(\d+)\s+(\S.*)")
_USER = re.compile(r"(\w+)\s*=\s*G\s+(-?[\d.]+)")
"""A global variable as PR UV tells it; a local one is declared by the program itself."""


def upload(state: MCodeState, raw: bool) -> Procedure[tuple[str, ...]]:
    """A file that makes a drive's program and variables what they are: VA, PG, the lines, PG, S."""
    listed = yield from listing(state, "")
    users = yield from perform(state, "PR UV")
    declared = [f"VA {found[1]}={found[2]}" for line in users if (found := _USER.fullmatch(line.strip()))]
    made: list[str] = []
    before: int | None = None
    for line in listed:
        found = _LISTED.fullmatch(line.strip())
        if found is None:
            continue
        at = int(found[1])
        if before is None or at - before > GAP:
            made += [f"PG {at}"] if before is None else ["PG", f"PG {at}"]
        made.append(found[2])
        before = at
    if before is None:
        raise Refused(f"{who(state)} holds no program")
    return (*declared, *made, "PG", "S")


def readable(state: MCodeState) -> Procedure[tuple[str, ...]]:
    """The program as the drive lists it."""
    return listing(state, "")
