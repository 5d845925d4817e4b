"""Reading the program of an MCode drive, and making a file of it."""

from __future__ import annotations

import re

from dialects.codec import Procedure
from dialects.errors import Refused
from dialects.mcode.host.operations import listing, perform
from dialects.mcode.host.state import MCodeState
from dialects.mcode.host.wording import who

GAP = 64
"""Bytes between the addresses of two lines, more than one line takes: a new program begins."""
_LISTED = re.compile(r"(\d+)\s+(\S.*)")
_USER = re.compile(r"(\w+)\s*=\s*G\s+(-?[\d.]+)")
"""A global variable in the print of PR UV; the program itself declares its local variables."""


def upload(state: MCodeState, raw: bool) -> Procedure[tuple[str, ...]]:
    """Return a file that reproduces a drive's program and variables: VA, PG, the lines, PG, S."""
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
    """List the program as the drive does."""
    return listing(state, "")
