"""Program files of TMCL modules (`.tmc`, `.tmcl`), in the mnemonics of the maker's IDE: read, assembled, written.

A line is a label, a command, both, or a constant, and a remark:

    Speed = 51200           // a name for a number
    Loop: ROR 0, Speed
        WAIT TICKS, 0, 100
        ROR 0, -Speed       // the constant with the other sign
        JA Loop             ; the other mark of a remark

Capitals and small letters mean the same. A label is the address of the command that follows it. The file of a program
shows no addresses: its first command is line 0 of the memory. (TMCM-1290 TMCL firmware manual, "Testing with a simple
TMCL program", "Using symbolic constants"; hexadecimal numbers and `;` as an assembler by others has them.)
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from multidrop.base.files import SourceLine, split_lines, wrong_characters
from multidrop.base.text import counted
from multidrop.dialects.program_files import (
    LinePart,
    Problem,
    ProgramEntry,
    check_comment,
    check_enter,
    errors,
    in_order,
    numbered,
    refuse,
    respelled,
    walk,
)
from multidrop.families.tmcl.manual import instructions
from multidrop.families.tmcl.manual.commands import BLANKS, Command, TmclCall
from multidrop.families.tmcl.manual.instructions import (
    CONTROL,
    EMPTY,
    ENDS,
    JUMPS,
    MEMORY,
    ROWS,
    STACK,
    WEARS,
    InstructionField,
    ProgramWord,
    call_with,
    fields_of,
    number_of,
    spelled,
    unknown,
)

NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_REMARK = re.compile(r"//|;")
_LINE = re.compile(
    r"\s*(?:(?P<label>[A-Za-z_]\w*)\s*:)?\s*"
    r"(?:(?P<name>[A-Za-z_]\w*)\s*=\s*(?P<value>.*?)|(?P<word>[^\s,]+)(?:\s*(?P<fields>.*?))?)?\s*",
    re.ASCII,
)


class LinePiece(NamedTuple):
    """A part of a line and its column, from 1."""

    text: str
    column: int


@dataclass(frozen=True)
class Divided:
    """One line in its parts. `name` and `value`: those of a constant."""

    number: int
    label: LinePiece | None = None
    name: LinePiece | None = None
    value: LinePiece | None = None
    word: LinePiece | None = None
    fields: tuple[LinePiece, ...] = ()


class PlacedLine(NamedTuple):
    """A line of the memory: the line of the file that it comes from, its address, and what is stored."""

    source: int
    at: int
    call: TmclCall


@dataclass
class Assembled:
    """What a file gives: its lines of the memory, its labels and constants in capitals, its problems."""

    lines: list[PlacedLine] = field(default_factory=list)
    labels: dict[str, int] = field(default_factory=dict)
    constants: dict[str, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def constant(self, piece: LinePiece) -> int | None:
        """The value of a constant, with the other sign behind a minus; None for what is no constant."""
        opposite = negated(piece)
        number = self.constants.get((opposite or piece).text.upper())
        return number if number is None or opposite is None else -number

    def wrong(self, line: int, place: LinePiece, what: str, hint: str = "") -> None:
        self.problems.append(Problem(line, place.column, what, hint))


def negated(piece: LinePiece) -> LinePiece | None:
    """The name behind a minus, `Speed` of `-Speed`; None for any other text."""
    name = piece.text[1:].lstrip(BLANKS)
    if not piece.text.startswith("-") or not NAME.fullmatch(name):
        return None
    return LinePiece(name, piece.column + len(piece.text) - len(name))


def remark_at(line: str) -> int:
    """The index at which the remark of a line begins; the length of a line without one."""
    match = _REMARK.search(line)
    return match.start() if match else len(line)


def divided(line: str, number: int = 1) -> Divided | None:
    """The parts of a line; None for an empty one."""
    code = line[: remark_at(line)]
    match = _LINE.fullmatch(code)
    if not code.strip() or match is None:
        return None

    def piece(group: str) -> LinePiece | None:
        return None if match[group] is None else LinePiece(match[group], match.start(group) + 1)

    fields, at = [], match.start("fields") + 1
    for field_text in match["fields"].split(",") if match["fields"] else ():
        fields.append(LinePiece(field_text.strip(BLANKS), at + len(field_text) - len(field_text.lstrip())))
        at += len(field_text) + 1
    return Divided(number, piece("label"), piece("name"), piece("value"), piece("word"), tuple(fields))


# Assembly


def assembled(lines: Iterable[SourceLine]) -> Assembled:
    """Assemble the lines of a file, and report every fault: one for each line, at most."""
    made = Assembled()
    parts = [halves for line in lines if (halves := divided(line.text, line.number)) is not None]
    at, names = 0, dict[str, int]()
    for part in parts:
        if part.label is not None:
            _declare(made, part, part.label, names)
            made.labels.setdefault(part.label.text.upper(), at)
        if part.name is not None and part.value is not None:
            _declare(made, part, part.name, names)
            number = _constant(made, part, part.value)
            made.constants.setdefault(part.name.text.upper(), number)
        at += part.word is not None
    for part in parts:
        if part.word is not None:
            call = _command(made, part, part.word)
            made.lines.append(PlacedLine(part.number, len(made.lines), call or TmclCall(EMPTY)))
    if len(made.lines) > MEMORY:
        place, what = made.lines[MEMORY].source, f"there are {len(made.lines)} lines, and a module holds {MEMORY}"
        made.problems.append(Problem(place, 1, what, "the memory ends at this line"))
    made.problems = in_order(made.problems)
    return made


def _declare(made: Assembled, line: Divided, name: LinePiece, names: dict[str, int]) -> None:
    """Note the line that gives a name; two lines cannot give the same one."""
    word = name.text.upper()
    if word in names:
        made.wrong(line.number, name, f"{name.text} is already in line {names[word]}", "choose another name")
    elif word in instructions.WORDS:
        made.wrong(line.number, name, f"{name.text} is a command", "choose another name")
    names.setdefault(word, line.number)


def _constant(made: Assembled, line: Divided, value: LinePiece) -> int:
    number = number_of(value.text)
    number = made.constant(value) if number is None else number
    if number is None or number not in instructions.BY_NUMBER[-1].valid:
        hint = "valid: a number, or a constant of a line before"
        made.wrong(line.number, value, f"a constant cannot be {value.text!r}", hint)
        return 0
    return number


def _command(made: Assembled, line: Divided, word: LinePiece) -> TmclCall | None:
    """The command of a line; None where it is wrong, which is noted."""
    if word.text.startswith("#"):
        made.wrong(line.number, word, f"{word.text} is not supported", "copy the lines of that file into this one")
        return None
    if word.text.isascii() and word.text.isdigit() and int(word.text) >= CONTROL:
        what = f"{word.text} is a control command, which no program holds"
        made.wrong(line.number, word, what, f"valid: a word, or a number below {CONTROL}")
        return None
    row = fields_of(word.text)
    if row is None:
        what, hint = unknown(word.text)
        label = line.fields and fields_of(line.fields[0].text.partition(" ")[0]) and NAME.fullmatch(word.text)
        made.wrong(line.number, word, what, f"a label ends with a colon: {word.text}:" if label else hint)
        return None
    number, fields = row
    if len(line.fields) != len(fields):
        what = f"{word.text} takes {'no field' if not fields else counted(len(fields), 'field')}"
        syntax = f"write {word.text.upper()} {', '.join(each.title for each in fields)}".strip()
        made.wrong(line.number, word, what, syntax)
        return None
    values = [_value(made, line, piece, each) for piece, each in zip(line.fields, fields, strict=True)]
    known = tuple(value for value in values if value is not None)
    return call_with(number, fields, known) if len(known) == len(fields) else None


def _value(made: Assembled, line: Divided, given: LinePiece, wanted: InstructionField) -> int | None:
    """The number of one field; None where it is wrong, and noted unless another field of the line is."""
    name = given.text.upper()
    number = wanted.read(given.text)
    if number is None and (constant := made.constant(given)) is not None:
        number = wanted.read(str(constant))
    if number is None and wanted.label:
        number = made.labels.get(name)
    if number is not None:
        return number
    if any(problem.line == line.number for problem in made.problems):
        return None
    if not given.text:
        made.wrong(line.number, given, f"{wanted.name} is missing", wanted.hint)
    elif wanted.label and NAME.fullmatch(given.text) and given.text.upper() not in made.constants:
        near = difflib.get_close_matches(given.text.upper(), list(made.labels), 1, 0.6)
        hint = f"is {near[0]} meant? (in any letters)" if near else wanted.hint
        made.wrong(line.number, given, f"no label {given.text}", hint)
    else:
        opposite = negated(given)
        unknown_name = opposite is not None and opposite.text.upper() not in made.constants
        hint = f"no constant {opposite.text}" if opposite is not None and unknown_name else wanted.hint
        made.wrong(line.number, given, f"{wanted.name} cannot be {given.text!r}", hint)
    return None


# The file language


def read(text: str, name: str) -> list[SourceLine]:
    refuse(check(text), name)
    return _lines(text)


def _lines(text: str) -> list[SourceLine]:
    return numbered([line[: remark_at(line)].strip(BLANKS) for line in split_lines(text)])


def compiled(lines: Sequence[SourceLine]) -> list[PlacedLine]:
    """The lines of the memory. Raises Diagnostic for a program with errors, which `read` has reported."""
    made = assembled(lines)
    refuse(made.problems, "program")
    return made.lines


def check(text: str, product: str = "") -> list[Problem]:
    """Report every error of a program, and warn of what runs otherwise than it reads."""
    lines = split_lines(text)
    unreadable = [Problem(*place, "lines end at LF or CR LF") for place in wrong_characters(lines)]
    unreadable += check_enter(line[: remark_at(line)] for line in lines)
    made = assembled(numbered(lines))
    marks = [problem for n, line in enumerate(lines, 1) for problem in check_comment(line, n, remark_at(line))]
    wrong = {problem.line for problem in unreadable}
    problems = [*unreadable, *(problem for problem in (*made.problems, *marks) if problem.line not in wrong)]
    if not made.lines and not errors(problems):  # as the backup of a module without one
        problems.append(Problem(1, 1, "holds no program", "a download of it leaves the module without one", True))
    return in_order([*problems, *_warnings(made, {error.line for error in errors(problems)})])


def _warnings(made: Assembled, wrong: Container[int]) -> Iterator[Problem]:
    """Warn of what the correct lines do together. A line with an error may be any command."""
    targets = {*made.labels.values(), *(line.call.value for line in made.lines if line.call.command in JUMPS)}
    dead = False
    for line in made.lines:
        dead = dead and line.at not in targets and line.source not in wrong
        if dead:
            yield Problem(line.source, 1, "this line is never executed", "", True)
        if line.call.command in WEARS:
            what = f"{spelled(line.call)} writes to the EEPROM, which wears out, each time that it is executed"
            yield Problem(line.source, 1, what, "", True)
        if line.call.command in JUMPS and line.call.value > len(made.lines):
            what = f"the program has no line {line.call.value}"
            yield Problem(line.source, 1, what, f"its lines are 0 to {len(made.lines) - 1}", True)
        dead = line.call.command in ENDS and line.source not in wrong
    if made.lines and made.lines[-1].call.command not in ENDS and made.lines[-1].source not in wrong:
        what = "the program runs on past this line, its last one"
        yield Problem(made.lines[-1].source, 1, what, "end it with STOP or JA", True)
    yield from _too_deep(made)


def _too_deep(made: Assembled) -> list[Problem]:
    """Warn of calls that a module ignores, as its stack is full: recursion, and nesting beyond its depth."""
    calls = {
        line.at: line.call.value for line in made.lines if line.call.command in (ProgramWord.CSUB, ProgramWord.CALL)
    }
    inside = {start: _calls_from(made, start, calls) for start in {0, *calls.values()}}
    depth, level = 0, {0}
    while level and depth <= STACK:
        depth, level = depth + 1, {calls[at] for start in level for at in inside.get(start, ())}
    if not level:
        return []
    first = min(calls)
    what = f"subroutines are nested more than {STACK} deep, or one calls itself: the module ignores such a call"
    return [Problem(made.lines[first].source, 1, what, "", True)]


def _calls_from(made: Assembled, start: int, calls: Mapping[int, int]) -> set[int]:
    """The addresses of the calls that are reached from a line before its subroutine returns."""

    def ways(at: int) -> list[int]:
        if not 0 <= at < len(made.lines):
            return []
        call = made.lines[at].call
        following = [at + 1] if call.command not in ENDS else []
        return (
            [*following, call.value]
            if call.command in (ProgramWord.JA, ProgramWord.JC, ProgramWord.DJNZ)
            else following
        )

    return walk([start], ways).keys() & calls.keys()


def measure(text: str) -> str:
    return f"{len(compiled(read(text, 'program')))} of {MEMORY} lines"


def formatted(text: str) -> str:
    """Return a program in canonical spelling. Names, numbers, remarks, blank lines and indents stay."""
    return respelled(text, remark_at, canonical)


def canonical(text: str) -> str:
    """A line in canonical spelling, without its remark: words in capitals, `, ` between fields, `Label: `."""
    halves = divided(text)
    if halves is None:
        return text.strip()
    parts = [f"{halves.label.text}:"] if halves.label is not None else []
    if halves.name is not None and halves.value is not None:
        parts.append(f"{halves.name.text} = {halves.value.text}")
    if halves.word is not None:
        row = fields_of(halves.word.text)
        known = row[1] if row is not None and len(row[1]) == len(halves.fields) else ()
        fields = [each.text for each in halves.fields]
        for at, wanted in enumerate(known):
            fields[at] = fields[at].upper() if fields[at].upper() in wanted.words else fields[at]
        parts.append(f"{halves.word.text.upper() if row else halves.word.text} {', '.join(fields)}".strip())
    return " ".join(parts)


def parts(line: str) -> list[LinePart]:
    halves, start = divided(line), remark_at(line)
    marks: list[LinePart] = []
    if halves is not None:
        for piece, kind in ((halves.label, "label"), (halves.name, "label"), (halves.word, _kind(halves))):
            if piece is not None and piece.text:
                marks.append(LinePart(piece.column - 1, piece.column - 1 + len(piece.text), kind))
    return [*marks, LinePart(start, len(line), "remark")] if start < len(line) else marks


def _kind(line: Divided) -> str:
    row = fields_of(line.word.text) if line.word is not None else None
    if row is None:
        return "wrong"
    number, fields = row
    if len(fields) != len(line.fields):
        return "starts" if number in ROWS and ROWS[number].moves else "word"
    values = tuple(each.read(given.text) or 0 for each, given in zip(fields, line.fields, strict=True))
    return "starts" if number != EMPTY and instructions.moves(call_with(number, fields, values)) else "word"


def entries(text: str) -> list[ProgramEntry]:
    """Its first line, and its labels: a host may run each of them by its address."""
    made = assembled(numbered(split_lines(text)))
    program_entries = [ProgramEntry("0", made.lines[0].source, run_at(0))] if made.lines else []
    for line in _lines(text):
        label = halves.label if (halves := divided(line.text)) is not None else None
        if label is not None and (at := made.labels[label.text.upper()]) < len(made.lines):
            program_entries.append(ProgramEntry(label.text, line.number, run_at(at)))
    return program_entries


def run_at(address: int) -> str:
    """The command that runs the program of a module from an address."""
    return f"{int(Command.RUN)} 1, 0, {address}"


# Lines of a memory as a file


def disassembled(held: Mapping[int, TmclCall]) -> list[str]:
    """The lines of a file that gives exactly this memory, with labels for the targets of jumps."""
    last = max(held, default=-1)
    rows = [held.get(at, TmclCall(EMPTY)) for at in range(last + 1)]
    targets = {call.value for call in rows if call.command in JUMPS and 0 <= call.value <= last}
    lines = []
    for at, call in enumerate(rows):
        if at in targets:
            lines.append(f"{label_of(at)}:")
        jumps = call.command in JUMPS and call.value in targets
        lines.append(f"    {spelled(call, label_of(call.value) if jumps else '')}")
    return lines


def label_of(address: int) -> str:
    return f"Line{address}"
