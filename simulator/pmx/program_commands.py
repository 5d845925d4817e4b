"""The ASCII commands of a host about the stored programs of a simulated PMX-2ED-SA (manual 7.19, table 9.0)."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from multidrop.dialects.pmx.manual.table import PROBE, PROBED
from multidrop.simulator.pmx.commands import INDEX, INVALID, OK, number
from multidrop.simulator.pmx.programs import Programs
from multidrop.simulator.pmx.settings import VARIABLES, Refusal

LINES, PROGRAMS, SUBROUTINES = 1275, 2, 32
FOR_PROGRAMS = "JOYENA="
"""A command that only a program can send (7.15)."""
_INDEXED = re.compile(r"(SASTAT|SPC|[A-Z]{1,2})(\d{1,6})", re.ASCII)


def answer_program(programs: Programs, text: str, t: float) -> str | None:
    """Carry out a command about programs; None if it is about something else."""
    if text == PROBE:
        return PROBED
    if text.startswith(FOR_PROGRAMS):
        return f"?{text}"
    head, sign, value = text.partition("=")
    found = _INDEXED.fullmatch(head + "0" if head == "SASTAT" else head)
    row = PROGRAM_WORDS.get(found[1]) if found else None
    if row is None or found is None:
        return None
    index = int(found[2])
    if index >= row.count:
        return f"?{text}" if row.count == PROGRAMS else INDEX
    try:
        reply = row.set(programs, index, value, t) if sign else row.get(programs, index, t)
    except Refusal as refusal:
        reply = str(refusal)
    return reply or f"?{text}"


@dataclass(frozen=True)
class ProgramWord:
    """A word about programs: the range of its index; what it reads and what it sets ("" has no such use)."""

    count: int
    get: Callable[[Programs, int, float], str]
    set: Callable[[Programs, int, str, float], str]


def _nothing(*_: object) -> str:
    return ""


def _store_line(programs: Programs, index: int, text: str, t: float) -> str:
    return OK if programs.memory.store(index, text) else INVALID


def _control(programs: Programs, index: int, text: str, t: float) -> str:
    return OK if programs.control(index, number(text, 0, 3), t) else INVALID


def _call(programs: Programs, index: int, t: float) -> str:
    return OK if programs.call(index, t) else "?Sub not Initialized"


def _set_variable(programs: Programs, index: int, text: str, t: float) -> str:
    programs.variables[index] = number(text)
    return OK


PROGRAM_WORDS: dict[str, ProgramWord] = {
    "GS": ProgramWord(SUBROUTINES, _call, _nothing),
    "SA": ProgramWord(LINES, lambda programs, n, t: programs.memory.line(n), _store_line),
    "SASTAT": ProgramWord(PROGRAMS, lambda programs, n, t: str(programs.status(n)), _nothing),
    "SPC": ProgramWord(PROGRAMS, lambda programs, n, t: str(programs.counter(n)), _nothing),
    "SR": ProgramWord(PROGRAMS, _nothing, _control),
    "V": ProgramWord(VARIABLES, lambda programs, n, t: str(programs.variables[n]), _set_variable),
}
