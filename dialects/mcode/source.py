"""MCode program files: what is wrong with one as far as its text tells, and one made of what is in a drive."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass

from dialects.base import Known, Talk
from dialects.errors import Diagnostic, Refused
from dialects.mcode import programs
from dialects.mcode.asking import who
from dialects.mcode.lines import LineError, Name, Number, Statement, is_name, parse
from dialects.mcode.programs import ProgramLine
from dialects.mcode.table import lookup
from dialects.mcode.talk import listing, perform
from dialects.problems import Problem

ENDINGS = (".mxt", ".txt")
load = programs.load
TARGETS = {"BR": 0, "CL": 0, "OE": 0, "TA": 1}
"""Words that go somewhere, and which of their arguments says where."""
GAP = 64
"""Bytes between the addresses of two lines; more than a line can take is a program of its own."""
_PLACE = re.compile(r":(\d+)\Z")
_COLUMN = re.compile(r" at character (\d+)")
_LISTED = re.compile(r"(\d+)\s+(\S.*)")
_USER = re.compile(r"(\w+)\s*=\s*G\s+(-?[\d.]+)")
"""A global variable as PR UV tells it; a local one is declared by the program itself."""


def check(text: str) -> list[Problem]:
    """Lines that no drive can take, PG that do not pair, places that are gone to and not there."""
    try:
        lines = programs.read(text, "")
    except Diagnostic as wrong:
        place, column = _PLACE.search(wrong.where), _COLUMN.search(wrong.message)
        indent = int(column[1]) if column else 1
        return [Problem(int(place[1]) if place else 1, indent, wrong.message, wrong.hint)]
    raw = re.split(r"\r\n|\n|\r", text)
    names = _names(lines)
    problems: list[Problem] = []
    labels: dict[str, int] = {}
    for line in lines:
        indent = len(raw[line.number - 1]) - len(raw[line.number - 1].lstrip())
        try:
            statement = parse(line.text, names)
        except LineError as wrong:
            problems.append(Problem(line.number, indent + wrong.column + 1, wrong.why))
            continue
        if statement is not None:
            problems += _meant(statement, line, indent + 1, names, labels)
    return problems


def measure(text: str) -> str:
    """How many lines it has; what a drive holds is told in bytes, which only the drive counts."""
    inside = [line.text for line in programs.read(text, "program") if line.section == "program"]
    return f"{sum(not text.upper().startswith('PG') for text in inside)} lines of program"


def _names(lines: Sequence[ProgramLine]) -> set[str]:
    """Labels and variables that the file declares."""
    declared = (re.match(r"(?:LB|VA)\s*=?\s*([A-Z]\w{0,2})", line.text, re.IGNORECASE | re.ASCII) for line in lines)
    return {found[1].upper() for found in declared if found}


def _meant(
    statement: Statement, line: ProgramLine, column: int, names: set[str], labels: dict[str, int]
) -> Iterator[Problem]:
    word = statement.word
    if word and word not in names and lookup(word) is None:
        hint = "is VA or LB missing?" if is_name(word) else ""
        yield Problem(line.number, column + statement.column, f"there is no {word}", hint)
        return
    first = statement.arguments[0] if statement.arguments else None
    if word == "LB" and isinstance(first, Name):
        if first.word in labels:
            what = f"LB {first.word} stands in line {labels[first.word]} already"
            yield Problem(line.number, column + first.column, what)
        labels.setdefault(first.word, line.number)
    at = TARGETS.get(word)
    for place, argument in enumerate(statement.arguments):
        for name in _used(argument):
            if name.word in names or (lookup(name.word) is not None and place != at):
                continue
            what = f"there is no label {name.word}" if place == at else f"there is no {name.word}"
            hint = f"LB {name.word} is missing" if place == at else "is VA missing?"
            yield Problem(line.number, column + name.column, what, hint)


def _used(part: object) -> Iterator[Name]:
    """The names in an argument."""
    if isinstance(part, Name):
        yield part
    elif is_dataclass(part) and not isinstance(part, Number):
        for each in fields(part):
            yield from _used(getattr(part, each.name))


def upload(known: Known, raw: bool) -> Talk[tuple[str, ...]]:
    """A file that makes a drive's program and variables what they are: VA, PG, the lines, PG, S."""
    listed = yield from listing(known, "")
    users = yield from perform(known, "PR UV")
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
        raise Refused(f"{who(known)} holds no program")
    return (*declared, *made, "PG", "S")


def readable(known: Known) -> Talk[tuple[str, ...]]:
    """The program as the drive lists it."""
    return listing(known, "")
