"""The set-ups in a stored program that a drive will refuse when it executes them.

A drive takes a stored line whose form is right, whatever its numbers are. So each set-up with plain numbers is executed
on a new drive that holds the program. The set-ups before it, since the last place at which paths may join, are executed
there first: they may exclude it (two inputs of one type, a minus limit above the plus limit). TE is no set-up.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from typing import NamedTuple

from multidrop.families.lexium.manual.grammar import NameTerm, Statement, parsed
from multidrop.families.lexium.manual.groups import CONDITIONAL, LABELLING, LAST_LINES, PLACES, SETUPS
from multidrop.families.lexium.manual.program_file import ProgramLine
from multidrop.families.lexium.manual.statements import names_in
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.state.program_memory import ProgramContents
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.world import World

JOINS = LABELLING | (CONDITIONAL - LAST_LINES)
"""After these other lines may have been executed before: a label, and the return of a call."""


class RefusedLater(NamedTuple):
    """A line that the drive stores, and the error of executing it. `alone`: whatever was set up before."""

    line: ProgramLine
    code: int
    alone: bool


def refused_later(
    lines: Sequence[ProgramLine], program: ProgramContents, personality: str, wrong: Container[int]
) -> Iterator[RefusedLater]:
    """Find them among the lines of a program that a drive holds; `wrong` are numbers of lines to leave out."""
    blank = fresh = _fresh(program, personality)
    for line in lines:
        statement = parsed(line.text) if line.section == "program" and line.mark is None else None
        if line.mark is not None or (statement is not None and statement.word in JOINS):
            fresh = blank
        if statement is None or line.number in wrong or not _plain(statement):
            continue
        if fresh is blank:
            fresh = _fresh(program, personality)
        if not fresh.execute(line.text, 0.0).refused:
            continue
        code = fresh.errors.code
        fresh.errors.clear()
        yield RefusedLater(line, code, _fresh(program, personality).execute(line.text, 0.0).refused)


def _fresh(program: ProgramContents, personality: str) -> MCodeDevice:
    spec = DriveSpec(personality=personality)
    device = MCodeDevice(spec, World(spec.world))
    device.program.load(program)
    return device


def _plain(statement: Statement) -> bool:
    """Whether it is a set-up with a value, and no part of it but a place depends on the drive."""
    if statement.word not in SETUPS or not statement.arguments:
        return False
    place = PLACES.get(statement.word)
    values = [
        argument for at, argument in enumerate(statement.arguments) if at != place or not isinstance(argument, NameTerm)
    ]
    return not any(True for value in values for _ in names_in(value))
