"""A-SCRIPT files, and what is in a controller as one: readable where it can be, compiled lines otherwise."""

from __future__ import annotations

from dialects.base import Known, Talk
from dialects.errors import Diagnostic
from dialects.pmx import programs, transfer
from dialects.pmx.script_code import Undecodable

ENDINGS = programs.ENDINGS
load = programs.load
check = programs.check


def readable(known: Known) -> Talk[tuple[str, ...]]:
    """The program as A-SCRIPT, or its compiled lines where a unit's own compiler made them; a note says why."""
    listed = yield from transfer.listing(known)
    try:
        return tuple(programs.readable(listed))
    except Undecodable as problem:
        known.notes.append(f"compiled lines, as they are stored: {problem}")
        return listed


def upload(known: Known, raw: bool) -> Talk[tuple[str, ...]]:
    """A file that can be downloaded again: A-SCRIPT, or (`raw`, or where that cannot be) compiled lines."""
    lines = yield from transfer.listing(known) if raw else readable(known)
    if not lines:
        raise Diagnostic("holds no program", known.address)
    return lines
