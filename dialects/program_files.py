"""Programs of a family: files, their language, problems and canonical spelling; what a drive holds.

The language is imported at its first use. In canonical spelling indents, remarks and their columns stay.
`walk` and `nearest` go breadth-first through the statements of a program, which are numbered.
"""

from __future__ import annotations

import importlib
import re
from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

from multidrop.base.comments import ENTER, behind_number, enter_in, grouped_at
from multidrop.base.errors import Diagnostic, Refused
from multidrop.base.files import SourceLine
from multidrop.base.on_demand import imported, imported_if

if TYPE_CHECKING:
    from multidrop.dialects.editing import EditingLanguage


class Problem(NamedTuple):
    """A problem: line and column from 1, description, remedy. A program with mere warnings runs."""

    line: int
    column: int
    what: str
    hint: str = ""
    warning: bool = False

    def where(self, name: str) -> str:
        return f"{name}:{self.line}:{self.column}"

    def line_for(self, name: str) -> str:
        hint = f"; {self.hint}" if self.hint else ""
        return f"{self.where(name)}: {'warning: ' if self.warning else ''}{self.what}{hint}"


def in_order(problems: Iterable[Problem]) -> list[Problem]:
    """The problems by their places in the file; errors precede warnings of one place."""
    return sorted(problems, key=lambda each: (each.line, each.column, each.warning))


def errors(problems: Sequence[Problem]) -> list[Problem]:
    return [problem for problem in problems if not problem.warning]


def refuse(problems: Sequence[Problem], name: str) -> None:
    """Raise a Diagnostic for the first error, if any; it gives the number of the others."""
    wrong = in_order(errors(problems))
    if not wrong:
        return
    more = f" ({len(wrong) - 1} more: multidrop program check)" if len(wrong) > 1 else ""
    raise Diagnostic(wrong[0].what + more, wrong[0].where(name), wrong[0].hint)


def check_enter(lines: Iterable[str], names: Container[str] = ()) -> Iterator[Problem]:
    """Report `^M` and `^J` that stand for Enter. `names` are those that a program combines with `^`."""
    for number, line in enumerate(lines, 1):
        match = enter_in(line)
        if match is not None and match[0][1] not in names:
            yield Problem(number, match.start() + 1, f"{match[0]} {ENTER}")


def check_comment(line: str, number: int, mark: int) -> Iterator[Problem]:
    """Report a comment that begins right behind a digit; it is an error where a number in groups of digits is meant.

    `number`: of the line, from 1. `mark`: the index at which its comment begins.
    """
    if not behind_number(line, mark):
        return
    if (grouped := grouped_at(line, mark)) is not None:
        yield Problem(number, grouped.start + 1, grouped.why, "put a blank before a comment")
    else:
        what = f"the comment begins right behind a number: {line[mark:].split()[0]} is not sent"
        yield Problem(number, mark + 1, what, "put a blank before it", warning=True)


LOCKED = "its program is locked (LK=1); LK=0 opens a lock that was not saved; CP opens any, and erases the program"


class Stored(NamedTuple):
    """A line in a drive: its address, or its number in memory, and its text as the drive lists it."""

    at: int
    text: str


@dataclass(frozen=True)
class Held:
    """Everything that a drive holds of programs."""

    lines: tuple[Stored, ...] = ()
    names: tuple[str, ...] = ()
    """Variables with their values, and labels with their places, as the drive prints them."""
    locked: bool = False
    """The drive lists no program: it is locked."""

    def check_listed(self, who: str) -> None:
        """Raise Refused where the drive is locked; `who` names it for a person."""
        if self.locked:
            raise Refused(f"{who}: no listing: {LOCKED}")

    def check_program(self, who: str) -> None:
        """Raise Refused where the drive is locked or holds no program."""
        self.check_listed(who)
        if not self.lines:
            raise Refused(f"{who} holds no program")


class Difference(NamedTuple):
    """A line that is not the same in a file and in a drive.

    `number`: of the file's line; 0: the file has none. `at`: the place in the drive; None: the drive has none.
    """

    number: int
    here: str
    at: int | None
    there: str


def first_difference(found: Sequence[Difference], drive: str = "drive") -> str:
    """Say why a file must be sent by the first of its differences; empty where there is none."""
    if not found:
        return ""
    return f"line {found[0].number} differs" if found[0].number else f"the {drive} holds more lines"


class LinePart(NamedTuple):
    """A part of a line, by columns from 0. `kind`: word, starts, label, text, remark or wrong.

    `starts`: a word that can start motion.
    """

    start: int
    stop: int
    kind: str


class ProgramEntry(NamedTuple):
    """A place at which a program can begin: its name, its line in the file from 1, and the command that starts it."""

    name: str
    line: int
    start: str


class Conversion(NamedTuple):
    """A program made into one for other drives: its text, each change, and what cannot be converted.

    `changes` and `refused` have lines of the original; `inserted` is the line before which there is a new one, or 0.
    """

    text: str
    changes: Sequence[Problem]
    refused: Sequence[Problem]
    inserted: int = 0


class Converter(Protocol):
    """A conversion of programs: a module of a family's manual."""

    TARGETS: Sequence[str]
    """The products to convert for, the usual one first."""

    def source(self, text: str) -> str:
        """Return the product that a program is for. Raises Diagnostic where it is for none that can be converted."""

    def convert(self, text: str, product: str) -> Conversion:
        """Convert a correct program for a product."""

    def worlds(self, text: str) -> Iterable[tuple[str, Mapping[str, Any], Mapping[str, Any]]]:
        """Yield worlds to try both programs in: a description, and the world's table in a cell file for each drive."""


class FileLanguage(Protocol):
    """The language of program files: a module of a family's manual."""

    def read(self, text: str, name: str) -> Sequence[SourceLine]:
        """Read the lines of a text; `name` is the file's name in a Diagnostic. Raises Diagnostic."""

    def check(self, text: str, product: str = "") -> list[Problem]:
        """Report every error that the text shows, on a product where that matters."""

    def formatted(self, text: str) -> str:
        """Return a correct program in canonical spelling, with its remarks and its layout."""

    def measure(self, text: str) -> str:
        """Describe the length of a correct program. Raises Diagnostic for any other."""

    def parts(self, line: str) -> Sequence[LinePart]:
        """Return the parts of a line that an editor shows in another style. Never fails."""

    def entries(self, text: str) -> Sequence[ProgramEntry]:
        """Return the places at which a program of a file can begin."""


class ProgramFiles(NamedTuple):
    """The program files of a family."""

    title: str
    """The name of the language, for a person."""
    endings: tuple[str, ...]
    """The endings of the files' names."""
    module: str
    """The module that is the `FileLanguage`."""
    editing_at: str
    """The place of the `EditingLanguage`."""
    ids: tuple[str, ...]
    """The names by which editors know the language."""
    converters: Mapping[str, str] = MappingProxyType({})
    """By the name of what they convert to: modules that are a `Converter`."""
    unsupported_at: str = ""
    """The place of a function that warns of what one unit lacks: of a text, a product, a version and a part number.

    Empty: every unit of a product has all of its commands, as far as is known.
    """

    def unsupported(self, text: str, product: str, version: str, part: str) -> list[Problem]:
        """Warn of what a program uses and one unit lacks, by the version and the part number that it reports."""
        check: Callable[[str, str, str, str], list[Problem]] | None = imported_if(self.unsupported_at)
        return check(text, product, version, part) if check is not None and (version or part) else []

    @property
    def language(self) -> FileLanguage:
        """Read, check, format and measure."""
        return cast(FileLanguage, importlib.import_module(self.module))

    @property
    def editing(self) -> EditingLanguage:
        """Names, help and completion of a text under editing."""
        language: EditingLanguage = imported(self.editing_at)
        return language


def numbered(lines: Sequence[str]) -> list[SourceLine]:
    """Return the lines of a file that are not empty."""
    return [SourceLine(number, line) for number, line in enumerate(lines, 1) if line]


BLANKS = " \t"
TAB = 8
"""Columns from one tab stop to the next."""


_END_OF_FILE = "\x1a"


def respelled(text: str, remark_at: Callable[[str], int], spell: Callable[[str], str]) -> str:
    """Return a text with its statements in canonical spelling. `remark_at` finds where the remark of a line begins."""
    body = text.rstrip(_END_OF_FILE)
    parts = re.split("(\r?\n)" if "\n" in body else "(\r)", body)  # as `split_lines` divides it
    parts[::2] = [_respelled_line(part, remark_at(part), spell) for part in parts[::2]]
    return "".join(parts) + text[len(body) :]


def _respelled_line(line: str, end: int, spell: Callable[[str], str]) -> str:
    """Return a line with its statement in canonical spelling; its remark begins at `end`.

    A remark keeps its column where the new statement leaves room. Blanks at the end of a line without a remark go.
    """
    code = line[:end].rstrip(BLANKS)
    statement = code.lstrip(BLANKS)
    if not statement:
        return line
    indent, gap, remark = code[: len(code) - len(statement)], line[len(code) : end], line[end:]
    spelled = spell(statement)
    if not remark:
        return indent + spelled
    if spelled == statement or not gap:
        return indent + spelled + gap + remark
    return _filled(indent + spelled, _width(line[:end]), gap) + remark


def _filled(code: str, column: int, gap: str) -> str:
    """Fill up to a column with what the gap consists of, with one such character at least."""
    if gap.strip("\t"):
        return code + " " * max(column - _width(code), 1)
    code += "\t"
    while _width(code) < column:
        code += "\t"
    return code


def _width(text: str) -> int:
    return len(text.expandtabs(TAB))


Ways = Callable[[int], Iterable[int]]
"""Gives the statements that may be executed after a statement."""


def walk(starts: Iterable[int], ways: Ways) -> dict[int, int | None]:
    """Return the statements that are reached, nearest first, each with the one before it; None for a start."""
    before: dict[int, int | None] = dict.fromkeys(starts)
    queue = deque(before)
    while queue:
        place = queue.popleft()
        for way in ways(place):
            if way not in before:
                before[way] = place
                queue.append(way)
    return before


def way_to(place: int, before: Mapping[int, int | None]) -> Iterator[tuple[int, int]]:
    """Yield the steps of a walk to a statement, the last one first: from where, and to where."""
    while (previous := before[place]) is not None:
        yield previous, place
        place = previous


def nearest(starts: Iterable[int], ways: Ways, wanted: Callable[[int], bool], most: int) -> int | None:
    """Find the nearest wanted statement; None if none is among the first `most` ones."""
    seen = dict.fromkeys(starts)
    queue = deque(seen)
    while queue and len(seen) <= most:
        place = queue.popleft()
        if wanted(place):
            return place
        for way in ways(place):
            if way not in seen:
                seen[way] = None
                queue.append(way)
    return None
