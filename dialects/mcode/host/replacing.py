"""A program file and the names that exist in the drive: what the host sends instead, or before.

Theory of operation. A drive refuses a label or a variable that exists (error 28), and an error runs a resident OE
subroutine. So the host reads the names first (`PR UV`). It assigns the file's value to a global variable that exists.
CP removes labels and variables of the program in the drive, and keeps global variables. The host sends CP only if such
a name is in the way. A global variable cannot become a label or a local variable without deleting other variables. The
host refuses that before it sends anything. (MCode reference 3.2.2, 5.1.23, 5.1.75, 5.1.134, 5.1.136, section 10; facts
of real units.)
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from dialects.codec import Procedure
from dialects.errors import Refused
from dialects.files import SourceLine
from dialects.mcode.host import classify
from dialects.mcode.host.exchange import answered
from dialects.mcode.host.operations import immediate
from dialects.mcode.host.signatures import question, value
from dialects.mcode.host.state import MCodeState
from dialects.mcode.host.wording import who
from dialects.mcode.manual.grammar import Compare, LineError, Name, Statement, parse
from dialects.mcode.manual.program_checker import slips
from dialects.mcode.manual.program_file import ProgramLine

GLOBAL, LOCAL, LABEL = "G", "L", "label"
"""Kinds of names in a drive: a variable of the two scopes that PR UV prints, or a label of the program."""
NAMING = {"VA", "LB"}
_LISTED = re.compile(r"(\w+)\s*=\s*(?:([GL])\s+)?(-?[\d.]+)")


@dataclass(frozen=True)
class Line:
    """A line to send: its number in the file, from 1, and its text."""

    number: int
    text: str


@dataclass
class Plan:
    """The lines to send for a file. `in_the_way`: names of the program in the drive, which CP removes."""

    lines: list[Line] = field(default_factory=list)
    in_the_way: list[str] = field(default_factory=list)


def prepare(state: MCodeState, lines: Sequence[SourceLine]) -> Procedure[Sequence[SourceLine]]:
    """Return the lines to send, after clearing the drive's program if needed. Raises Refused before that."""
    if not any(_named(line.text) for line in lines):
        return lines
    names = yield from _names(state)
    made = plan(lines, names, who(state))
    if made.in_the_way:
        yield from _clear(state, made.in_the_way, names, lines)
    return made.lines


def plan(lines: Sequence[SourceLine], names: Mapping[str, str], drive: str) -> Plan:
    """Plan the lines for a drive in which these names exist. Raises Refused."""
    held, own, made, inside = dict(names), set[str](), Plan(), False
    for line in lines:
        word, name = _named(line.text) or ("", "")
        is_a = held.get(name, "")
        made.lines.append(Line(line.number, line.text))
        if inside and is_a == GLOBAL and name not in own:
            raise Refused(
                f"line {line.number}: '{line.text}': {drive} has a global variable {name} already; CP 1 or FD deletes "
                "it, with all others (nothing was sent)"
            )
        taken = is_a == LABEL or (is_a == LOCAL and word == "LB")
        if taken and name not in (*own, *made.in_the_way):
            made.in_the_way.append(name)
        if word == "VA" and not inside:
            if is_a == GLOBAL:
                made.lines[-1] = Line(line.number, _assignment(line.text, name))
            held[name] = GLOBAL
        if name:
            own.add(name)
        inside = classify.enters_program(line.text) or (inside and not classify.leaves_program(line.text))
        if not inside:
            _forget(line.text, held)
    return made


def _forget(text: str, held: dict[str, str]) -> None:
    """Forget the names that a line of the file deletes; a CP with an address is left to its author."""
    word, rest = classify.word_of(text)
    everything = word == "FD" or (word == "CP" and rest.startswith("1"))
    for name in [each for each, is_a in held.items() if everything or (word == "CP" and is_a != GLOBAL)]:
        del held[name]


def _statement(text: str) -> Statement | None:
    try:
        return parse(text)
    except LineError:
        return None


@lru_cache(maxsize=1024)
def _named(text: str) -> tuple[str, str] | None:
    """Return `VA` or `LB` and the name that the line declares; None for any other line."""
    statement = _statement(text)
    if statement is None or statement.word not in NAMING or not statement.arguments:
        return None
    first = statement.arguments[0]
    if isinstance(first, Compare):
        first = first.left
    return (statement.word, first.word) if isinstance(first, Name) else None


def _assignment(text: str, name: str) -> str:
    """Return `Q1=25` for `VA Q1=25`, and `Q1=0` for `VA Q1`."""
    _, equals, given = text.partition("=")
    return f"{name}={given.strip() if equals else 0}"


def _names(state: MCodeState) -> Procedure[dict[str, str]]:
    """Read the user's names in a drive, and the kind of each."""
    listed = yield from immediate(state, state.codec.request(state.address, "PR UV"))
    found = [row for line in listed if (row := _LISTED.fullmatch(line.strip()))]
    return {row[1].upper(): row[2] or LABEL for row in found}


def _clear(
    state: MCodeState, in_the_way: Sequence[str], names: Mapping[str, str], lines: Sequence[SourceLine]
) -> Procedure[None]:
    """Send CP and report what it deletes. A file with an error and a locked program are refused first."""
    first, variables = ", ".join(in_the_way), [name for name, is_a in names.items() if is_a == GLOBAL]
    for slip in slips([line for line in lines if isinstance(line, ProgramLine)], variables):
        raise Refused(f"line {slip.line}: {slip.what} (nothing was sent)")
    reply = yield from answered(state, question(state, "LK", "[01]"))
    if value(state, reply) == "1":
        raise Refused(
            f"{who(state)}: its program is locked (LK=1) and has {first} already; CP erases it and opens the lock "
            "(nothing was sent)"
        )
    yield from immediate(state, state.codec.request(state.address, "CP"))
    mine = {found[1] for line in lines if (found := _named(line.text))}
    gone = ", ".join(name for name, is_a in names.items() if is_a == LABEL and name not in mine)
    also = f"; labels that the file does not have went with it: {gone}" if gone else ""
    state.note(f"{who(state)}: the program in it was cleared (CP), as it had {first} already{also}")
