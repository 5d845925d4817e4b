"""What one unit lacks of its product's commands, by the firmware and the part number that it reports.

Manual 4.1 to 4.5 and the table of compatibility of each command in section 5. Words are marked in the table; here are
the parts of set-ups, and the one warning about old firmware (5.1.110).
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator
from functools import lru_cache

from multidrop.dialects.program_files import Problem, in_order
from multidrop.families.lexium.manual import program_file
from multidrop.families.lexium.manual.grammar import Argument, Number, Statement, parsed
from multidrop.families.lexium.manual.mnemonic import LEXIUM, Mnemonic
from multidrop.families.lexium.manual.statements import words_of
from multidrop.families.lexium.manual.table import lookup

_VERSION = re.compile(r"LM\w+ (\d+)\.(\d+)")
_SMALL_PART = re.compile(r"<?LMD[A-Z]{2}42")
CLOCKS, FIRST_WITH_CLOCKS = frozenset({13, 14, 15}), (6, 0)
"""Types of an input, and the firmware that has them (5.1.64)."""
CAPTURE = 12
NOT_SMALL = {"IS": frozenset({4}), "OS": frozenset({1, 2}), "TI": frozenset({4})}
"""Inputs and outputs that a NEMA 17 lacks: error 10 (5.1.56, 5.1.93)."""
TRIP_ON_CAPTURE = 4
SAFE_REVERSAL = (5, 9)
"""The firmware from which on RD cannot cause motion (5.1.110)."""
HINT = "this drive refuses it"


@lru_cache(maxsize=64)
def firmware(version: str) -> tuple[int, int] | None:
    """The firmware of a Lexium by what VR prints; None where that does not show it."""
    match = _VERSION.match(version)
    return (int(match[1]), int(match[2])) if match else None


def lacks(row: Mnemonic, version: str, part: str) -> str:
    """Say why a unit lacks a word of its product; empty: it has the word, as far as its identity shows."""
    own = firmware(version)
    if row.firmware and own is not None and own[0] < row.firmware:
        return f"{row.name} needs firmware {row.firmware}, and this drive has {_shown(own)}"
    if row.large and _SMALL_PART.match(part):
        return f"{row.name} is not on a NEMA 17 ({part})"
    return ""


def unsupported(text: str, product: str, version: str, part: str) -> list[Problem]:
    """Warn of what a program file uses and one unit lacks; each word once."""
    lines, _ = program_file.scan(text)
    names = frozenset(line.declares for line in lines if line.declares)
    problems, told = list[Problem](), set[str]()
    for line in lines if product in LEXIUM else ():
        statement = parsed(line.text, names)
        if statement is None:
            continue
        column = line.column + statement.column
        for why in _reasons(statement, names, product, version, part):
            if why not in told:
                told.add(why)
                problems.append(Problem(line.number, column, why, HINT, warning=True))
        if statement.word == "RD" and statement.arguments and (own := firmware(version)) and own < SAFE_REVERSAL:
            what = f"RD may cause unintended MOTION with firmware {_shown(own)}"
            problems.append(Problem(line.number, column, what, "update the firmware to 5.009 or newer", warning=True))
    return in_order(problems)


def _reasons(statement: Statement, names: Container[str], product: str, version: str, part: str) -> Iterator[str]:
    for word in words_of(statement):
        row = lookup(word, product) if word not in names else None
        if row is not None and (why := lacks(row, version, part)):
            yield why
    word, numbers = statement.word, [_whole(argument) for argument in statement.arguments]
    own, small = firmware(version), _SMALL_PART.match(part) is not None
    if word == "IS" and own is not None and own < FIRST_WITH_CLOCKS and CLOCKS & {*numbers[1:2]}:
        yield f"IS type {numbers[1]} needs firmware 6, and this drive has {_shown(own)}"
    if small and numbers and numbers[0] in NOT_SMALL.get(word, ()):
        yield f"{word}={numbers[0]} is not on a NEMA 17 ({part}): error 10"
    if small and word == "IS" and numbers[1:2] == [CAPTURE]:
        yield f"IS type {CAPTURE} (capture) is not on a NEMA 17 ({part})"
    if small and word == "TE" and numbers and (numbers[0] or 0) & TRIP_ON_CAPTURE:
        yield f"TE={numbers[0]} enables the trip on capture, which is not on a NEMA 17 ({part})"


def _whole(argument: Argument | None) -> int | None:
    return argument.value if isinstance(argument, Number) and isinstance(argument.value, int) else None


def _shown(own: tuple[int, int]) -> str:
    return f"{own[0]}.{own[1]:03d}"
