"""The programs that an MCode drive holds: read, divided, ended, offered by name, and made a file."""

from __future__ import annotations

import re
from abc import ABC
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeVar

from multidrop.base.errors import Diagnostic, NoAnswer, Refused
from multidrop.base.files import SourceLine, split_lines
from multidrop.dialects.codec import Procedure
from multidrop.dialects.family import Printed, Programs, Progress
from multidrop.dialects.program_files import Held, Stored
from multidrop.dialects.state import who
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode.codec import EVERY_DRIVE
from multidrop.families.lexium.host.mcode.exchange import QUESTION_REPEATS
from multidrop.families.lexium.host.mcode.operations import MCodeOperations
from multidrop.families.lexium.host.mcode.settings import listed
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import editing, help, program_file
from multidrop.families.lexium.manual.grammar import Compare, NameTerm, parsed
from multidrop.families.lexium.manual.groups import LAST_LINES
from multidrop.families.lexium.manual.statements import size_of

# The programs of a file and of a listing.
#
# Theory of operation. A listing shows lines with their addresses and no ends of programs. A line ends where the next
# one begins, unless a program ends there. So a gap larger than the line is the end of a program. The sizes of lines
# are known from few units (`statements.size_of`). A file is divided at every such gap: a PG too many changes nothing
# in the drive. What counts as one program is divided at a gap only after an instruction that ends a program, or at a
# large gap.


LONGEST_LINE_BYTES = 64
"""Bytes between the addresses of two lines, more than one line takes: another program begins."""
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
class ReadProgram:
    """A program in a drive: its lines, and the address after the last one."""

    lines: tuple[Stored, ...]
    end: int

    @property
    def start(self) -> int:
        return self.lines[0].at

    def declared(self, word: str) -> set[str]:
        declarations = [declared(line.text) for line in self.lines]
        return {declaration[1] for declaration in declarations if declaration is not None and declaration[0] == word}


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
    rows = [row for line in listed if (row := _LISTED.fullmatch(line.strip()))]
    return tuple(Stored(int(row[1]), row[2]) for row in rows)


def names_of(held: Held) -> dict[str, Called]:
    rows = [row for line in held.names if (row := _NAMED.fullmatch(line.strip()))]
    return {row[1].upper(): Called(row[2] or LABEL, row[3]) for row in rows}


def programs(lines: Sequence[Stored], product: str = "", fine: bool = False) -> list[ReadProgram]:
    """Divide a listing into programs; `fine`: at every gap."""
    programs: list[list[Stored]] = []
    end = -1
    for line in lines:
        before = programs[-1][-1] if programs else None
        ends = before is not None and (fine or classify.word_of(before.text)[0] in LAST_LINES)
        if before is None or line.at - before.at > LONGEST_LINE_BYTES or (line.at > end and ends):
            programs.append([])
        programs[-1].append(line)
        end = line.at + size(line.text, product)
    return [
        ReadProgram(tuple(program_lines), program_lines[-1].at + size(program_lines[-1].text, product))
        for program_lines in programs
    ]


@lru_cache(maxsize=4096)
def size(text: str, product: str) -> int:
    """Return the bytes that a line takes; 0 for a line that this grammar does not parse."""
    statement = parsed(text)
    return size_of(statement, product) if statement is not None else 0


def programs_of(lines: Sequence[SourceLine]) -> list[FileProgram]:
    return list(_divided(tuple(lines))[0])


def size_of_file(lines: Sequence[SourceLine]) -> int:
    return sum(len(program.lines) for program in programs_of(lines))


def immediate_lines(lines: Sequence[SourceLine]) -> list[SourceLine]:
    """Return the lines of a file that the drive executes at once: all but its programs."""
    return list(_divided(tuple(lines))[1])


@lru_cache(maxsize=8)
def _divided(lines: tuple[SourceLine, ...]) -> tuple[tuple[FileProgram, ...], tuple[SourceLine, ...]]:
    """Divide a file into its programs and the lines outside of them; each step of a download asks for one or both."""
    programs, outside = list[FileProgram](), list[SourceLine]()
    place, inside = "", list[SourceLine]()
    for line in lines:
        if classify.enters_program(line.text):
            place, inside = classify.word_of(line.text)[1], []
        elif not place:
            outside.append(line)
        elif classify.leaves_program(line.text):
            programs.append(FileProgram(place, tuple(inside)))
            place = ""
        else:
            inside.append(line)
    return tuple(programs), tuple(outside)


@lru_cache(maxsize=4096)
def declared(text: str) -> tuple[str, str] | None:
    statement = parsed(text)
    if statement is None or statement.word not in ("VA", "LB") or not statement.arguments:
        return None
    first = statement.arguments[0]
    if isinstance(first, Compare):
        first = first.left
    return (statement.word, first.word) if isinstance(first, NameTerm) else None


# Reading the programs of an MCode drive, with its labels and variables, and ending them.
#
# A locked program is not listed: the drive refuses L with error 44, and an error runs a resident OE subroutine. So the
# host reads LK first. (MCode reference 5.1.35, 5.1.75, 5.1.134.)


T = TypeVar("T")


def _again(state: MCodeState, ask: Callable[[], Procedure[T]]) -> Procedure[T]:
    """Ask again after a damaged reply: these questions change nothing. A drive that is silent is not asked again."""
    for _ in range(QUESTION_REPEATS):
        try:
            return (yield from ask())
        except NoAnswer:
            if state.settings_unknown or state.programming:
                raise
    return (yield from ask())


def _sent_lines(text: str) -> Iterator[tuple[str, program_file.ProgramLine | None]]:
    sent: Sequence[program_file.ProgramLine] = program_file.scan(text)[0]
    by_number = {line.number: line for line in sent}
    for number, line in enumerate(split_lines(text.removesuffix("\x1a").removesuffix("\n")), 1):
        yield line, by_number.get(number)


class MCodeReadout(Programs, ABC):
    """The program in an MCode drive: what is read of it, the files that are made of that, and its end."""

    state: MCodeState

    def listing(self, place: str) -> Printed:
        return MCodeOperations(self.state).listing(place)

    def readable(self, held: Held) -> Sequence[str]:
        return tuple(f"{line.at}  {line.text}" for line in held.lines)

    def read(self, lines: Sequence[SourceLine], progress: Progress) -> Procedure[Held]:
        """Read the program as listed, and labels and variables; no lines from a drive that is locked."""
        state = self.state
        progress(0, 1)
        locked = yield from _again(state, lambda: MCodeOperations(state).flag("LK"))
        listed = () if locked else (yield from _again(state, lambda: MCodeOperations(state).listing("")))
        names = yield from _again(state, lambda: MCodeOperations(state).perform("PR UV"))
        held = Held(stored(listed), tuple(name.strip() for name in names if name.strip()), locked)
        labels = any(called.kind == LABEL for called in names_of(held).values())
        if labels and not (held.lines or locked):  # the L was lost on the line
            held = replace(held, lines=stored((yield from _again(state, lambda: MCodeOperations(state).listing("")))))
        return held

    def file(self, held: Held, raw: bool) -> Sequence[str]:
        """Return a file that reproduces what a drive holds: VA, PG, the lines, PG, S; none where that is nothing."""
        made = [f"VA {name}={called.value}" for name, called in names_of(held).items() if called.kind == GLOBAL]
        for program in programs(held.lines, self.state.product, fine=True):
            made += [f"PG {program.start}", *(line.text for line in program.lines), "PG"]
        return (*made, "S") if made else ()

    def executed(self, lines: Sequence[SourceLine]) -> Sequence[SourceLine]:
        return immediate_lines(lines)

    def size(self, lines: Sequence[SourceLine]) -> int:
        return size_of_file(lines)

    def end(self) -> Procedure[bool]:
        """End the running program with E, and the motion that it has begun with SL 0; return whether one ran.

        Both take a while. Raises Refused where the motor moves without a program.
        """
        state = self.state
        if not (yield from _again(state, lambda: MCodeOperations(state).flag("BY"))):
            if (yield from _again(state, lambda: MCodeOperations(state).flag("MV"))):
                raise Refused(f"{who(state)} moves: stop it first (nothing was sent)")
            return False
        yield from MCodeOperations(state).immediate(state.codec.request(state.address, "E"))
        if (yield from _again(state, lambda: MCodeOperations(state).flag("MV"))):
            yield from MCodeOperations(state).immediate(state.codec.request(state.address, "SL 0"))
        return True

    def start(self, lines: Sequence[SourceLine], label: str) -> str:
        """Return the line that executes a program of a file. Raises Diagnostic where the file has no such label."""
        programs = programs_of(lines)
        inside = [declared(line.text) for program in programs for line in program.lines]
        labels = [name for word, name in filter(None, inside) if word == "LB"]
        if label.upper() not in (*labels, *(program.place for program in programs)):
            hint = f"labels: {', '.join(labels)}" if labels else "the file has no labels"
            raise Diagnostic(f"no label {label} in the file", "", hint)
        return f"EX {label.upper()}"

    def refreshed(self, text: str, held: Held) -> Sequence[str]:
        """Return a file's lines with the present values of the variables that it declares, and those that it lacks."""
        missing = {name: called.value for name, called in names_of(held).items() if called.kind == GLOBAL}
        made: list[str] = []
        at: int | None = None
        for line, sent in _sent_lines(text):
            if sent is not None and sent.section == "program":
                at = len(made) if at is None else at
            elif sent is not None and (declaration := declared(sent.text)) is not None and declaration[1] in missing:
                value = missing.pop(declaration[1])
                if (sent.text.partition("=")[2].strip() or "0") != value:
                    line = line.replace(sent.text, f"VA {declaration[1]}={value}", 1)
            made.append(line)
        more = [f"VA {name}={value}" for name, value in missing.items()]
        return (*made[:at], *more, *made[at:]) if at is not None else (*made, *more)

    def annotated(self, text: str, held: Held) -> Sequence[str]:
        addresses = iter(held.lines)
        width = max((len(str(line.at)) for line in held.lines), default=0)
        made: list[str] = []
        rest: list[str] = []
        for line, sent in _sent_lines(text):
            if sent is None:
                rest.append(f"{'':{width}}  {line}".rstrip())
            elif sent.section == "program" and sent.mark is None:
                at = next(addresses).at
                made += [*(rest if made else []), f"{at:<{width}}  {line}"]
                rest = []
            else:
                rest = []
        return tuple(made)

    def names(self) -> Procedure[Held]:
        """Read labels and variables. Raises Refused where that would be stored, or answered by several drives."""
        state = self.state
        if state.programming or state.address in EVERY_DRIVE:
            raise Refused(f"{who(state)} does not print its names now")
        names = yield from listed(state, "PR UV")
        return Held(names=tuple(name.strip() for name in names if name.strip()))

    def offered(self, held: Held, line: str) -> Sequence[tuple[str, str]]:
        """The names that may end a line: labels where a line takes one, variables elsewhere, both after PR."""
        word = help.LANGUAGE.typing(line)
        head = line[: len(line) - len(word)]
        in_text = head.count('"') % 2 == 1
        begun = bool(word or (head.strip() and head.endswith((" ", ",", "="))))
        if in_text or not begun:
            return []
        names = names_of(held)
        return [
            (name, f"label at {called.value}" if called.kind == LABEL else f"variable, {called.value} when it was read")
            for labels in editing.LABELS_AT[editing.expected(head)]
            for name, called in names.items()
            if (called.kind == LABEL) is labels and name.startswith(word.upper())
        ]
