"""A-SCRIPT files, and what is in a controller as one: readable where it can be, compiled lines otherwise."""

from __future__ import annotations

from dialects.base import Known, Talk
from dialects.errors import Refused
from dialects.pmx import programs, transfer
from dialects.pmx.asking import who
from dialects.pmx.script_code import LINES
from dialects.pmx.script_decode import Undecodable
from dialects.problems import Problem

ENDINGS = programs.ENDINGS
load = programs.load


def check(text: str, product: str = "") -> list[Problem]:  # noqa: ARG001
    """Everything that is wrong, as far as the text tells. There is one product."""
    return programs.check(text)


def measure(text: str) -> str:
    """How much of the controller's memory it takes."""
    return f"{len(programs.compiled(programs.read(text, 'program')))} of {LINES} compiled lines"


def readable(known: Known) -> Talk[tuple[str, ...]]:
    """The program as A-SCRIPT, or its compiled lines where a unit's own compiler made them; a remark says why."""
    listed = yield from transfer.listing(known)
    try:
        return tuple(programs.readable(listed))
    except Undecodable as problem:
        return (f"; compiled lines, as they are stored: {problem}", *listed)


def upload(known: Known, raw: bool) -> Talk[tuple[str, ...]]:
    """A file that can be downloaded again: A-SCRIPT, or (`raw`, or where that cannot be) compiled lines."""
    lines = yield from transfer.listing(known) if raw else readable(known)
    if not lines:
        raise Refused(f"{who(known)} holds no program")
    return lines
