"""A-SCRIPT files, and what is in a controller as one: readable where it can be, compiled lines otherwise."""

from __future__ import annotations

from dialects.base import DriveState, Procedure
from dialects.errors import Refused
from dialects.pmx.host import download
from dialects.pmx.host.exchange import who
from dialects.pmx.manual import program_file
from dialects.pmx.manual.script_compiler import LINES
from dialects.pmx.manual.script_decompiler import Undecodable
from dialects.problems import Problem

ENDINGS = program_file.ENDINGS
load = program_file.load


def check(text: str, product: str = "") -> list[Problem]:  # noqa: ARG001
    """Everything that is wrong, as far as the text tells. There is one product."""
    return program_file.check(text)


def measure(text: str) -> str:
    """How much of the controller's memory it takes."""
    return f"{len(program_file.compiled(program_file.read(text, 'program')))} of {LINES} compiled lines"


def readable(state: DriveState) -> Procedure[tuple[str, ...]]:
    """The program as A-SCRIPT, or its compiled lines where a unit's own compiler made them; a remark says why."""
    listed = yield from download.listing(state)
    try:
        return tuple(program_file.readable(listed))
    except Undecodable as problem:
        return (f"; compiled lines, as they are stored: {problem}", *listed)


def upload(state: DriveState, raw: bool) -> Procedure[tuple[str, ...]]:
    """A file that can be downloaded again: A-SCRIPT, or (`raw`, or where that cannot be) compiled lines."""
    lines = yield from download.listing(state) if raw else readable(state)
    if not lines:
        raise Refused(f"{who(state)} holds no program")
    return lines
