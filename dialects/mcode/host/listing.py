"""The programs of a file and of a listing.

Theory of operation. A listing shows lines with their addresses and no ends of programs. A line ends where the next one
begins, unless a program ends there. So a gap larger than the line is the end of a program. The sizes of lines are known
from few units (`line_size`). A file is divided at every such gap: a PG too many changes nothing in the drive. What
counts as one program is divided at a gap only after an instruction that ends a program, or at a large gap.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from multidrop.dialects.files import SourceLine
from multidrop.dialects.held import Held, Stored
from multidrop.dialects.mcode.host import classify
from multidrop.dialects.mcode.manual.grammar import Compare, LineError, Name, Statement, parse
from multidrop.dialects.mcode.manual.statements import size_of

GAP = 64
"""Bytes between the addresses of two lines, more than one line takes: another program begins."""
ENDS = {"E", "RT", "BR"}
"""The words that a program ends with."""
GLOBAL, LOCAL, LABEL = "G", "L", "label"
"""Kinds of names in a drive: a variable of the two scopes that PR UV prints, or a label of the program."""
_LISTED = re.compile(r"(\d+)\s+(\S.*)", re.ASCII)
_NAMED = re.compile(r"(\w+)\s*=\s*(?:([GL])\s+)?(-?\d+(?:\.\d+)?)", re.ASCII)


@dataclass(frozen=True)
class Called:
    """A name in a drive: its kind, and its value or its address."""

    kind: str
    value: str


@dataclass(frozen=True)
class Program:
    """A program in a drive: its lines, and the address after the last one."""

    lines: tuple[Stored, ...]
    end: int

    @property
    def start(self) -> int:
        """The address of its first line."""
        return self.lines[0].at

    def declared(self, word: str) -> set[str]:
        """The names that its VA or LB lines declare."""
        found = [declared(line.text) for line in self.lines]
        return {each[1] for each in found if each is not None and each[0] == word}


@dataclass(frozen=True)
class FileProgram:
    """A program of a file: the address or label of its PG, and its lines between PG and PG."""

    place: str
    lines: tuple[SourceLine, ...]

    def start(self, names: Mapping[str, Called]) -> int | None:
        """The address at which it begins; None for an unknown label."""
        if self.place.isdigit():
            return int(self.place)
        called = names.get(self.place.upper())
        is_label = called is not None and called.kind == LABEL and called.value.isdecimal()
        return int(called.value) if called is not None and is_label else None


def stored(listed: Sequence[str]) -> tuple[Stored, ...]:
    """Return the lines of a listing as the drive printed it."""
    found = [row for line in listed if (row := _LISTED.fullmatch(line.strip()))]
    return tuple(Stored(int(row[1]), row[2]) for row in found)


def names_of(held: Held) -> dict[str, Called]:
    """Return the user's names in a drive, in capitals."""
    found = [row for line in held.names if (row := _NAMED.fullmatch(line.strip()))]
    return {row[1].upper(): Called(row[2] or LABEL, row[3]) for row in found}


def programs(lines: Sequence[Stored], product: str = "", fine: bool = False) -> list[Program]:
    """Divide a listing into programs; `fine`: at every gap."""
    found: list[list[Stored]] = []
    end = -1
    for line in lines:
        if not found or _begins(found[-1][-1], line.at, end, fine):
            found.append([])
        found[-1].append(line)
        end = line.at + size(line.text, product)
    return [Program(tuple(each), each[-1].at + size(each[-1].text, product)) for each in found]


def _begins(before: Stored, at: int, end: int, fine: bool) -> bool:
    """Whether a program begins at an address. `end`: where the line before it ends, as far as sizes are known."""
    if at - before.at > GAP:
        return True
    return at > end and (fine or classify.word_of(before.text)[0] in ENDS)


@lru_cache(maxsize=4096)
def size(text: str, product: str) -> int:
    """Return the bytes that a line takes; 0 for a line that this grammar does not parse."""
    statement = _statement(text)
    return size_of(statement, product) if statement is not None else 0


def programs_of(lines: Sequence[SourceLine]) -> list[FileProgram]:
    """Return the programs of a file, each from PG to PG."""
    found: list[FileProgram] = []
    place, inside = "", list[SourceLine]()
    for line in lines:
        if classify.enters_program(line.text):
            place, inside = classify.word_of(line.text)[1], []
        elif place and classify.leaves_program(line.text):
            found.append(FileProgram(place, tuple(inside)))
            place = ""
        elif place:
            inside.append(line)
    return found


def size_of_file(lines: Sequence[SourceLine]) -> int:
    """Count the lines in the programs of a file."""
    return sum(len(program.lines) for program in programs_of(lines))


def immediate_lines(lines: Sequence[SourceLine]) -> list[SourceLine]:
    """Return the lines of a file that the drive executes at once: all but its programs."""
    found: list[SourceLine] = []
    inside = False
    for line in lines:
        if classify.enters_program(line.text) or inside:
            inside = not classify.leaves_program(line.text)
        else:
            found.append(line)
    return found


def _statement(text: str) -> Statement | None:
    try:
        return parse(text)
    except LineError:
        return None


@lru_cache(maxsize=4096)
def declared(text: str) -> tuple[str, str] | None:
    """Return `VA` or `LB` and the name that the line declares; None for any other line."""
    statement = _statement(text)
    if statement is None or statement.word not in ("VA", "LB") or not statement.arguments:
        return None
    first = statement.arguments[0]
    if isinstance(first, Compare):
        first = first.left
    return (statement.word, first.word) if isinstance(first, Name) else None
