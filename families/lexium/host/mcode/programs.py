"""Programs in MCode drives: the family's record; a file and what a drive holds, compared in canonical spelling."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest

from multidrop.base.errors import Refused
from multidrop.base.files import SourceLine
from multidrop.base.text import counted, real
from multidrop.dialects.certifying import Certifying, Occupied
from multidrop.dialects.codec import Procedure
from multidrop.dialects.program_files import Difference, Held, Stored, first_difference
from multidrop.dialects.state import who
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode import program_readout
from multidrop.families.lexium.host.mcode.before_request import value_of
from multidrop.families.lexium.host.mcode.download import MCodeDownload, clears_itself
from multidrop.families.lexium.host.mcode.operations import MCodeOperations
from multidrop.families.lexium.host.mcode.program_readout import FileProgram
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import guards
from multidrop.families.lexium.manual.grammar import (
    Argument,
    Compare,
    LineError,
    NameTerm,
    Number,
    Statement,
    UnaryTerm,
    parse,
)
from multidrop.families.lexium.manual.mnemonic import ETHERNET, EXPANDED
from multidrop.families.lexium.manual.statements import canonical
from multidrop.families.lexium.manual.table import lookup

HOLDING = ("variable", "flag")
"""The kinds of words that hold a value."""
STEADY = {"S", "CP", "PG"}
"""Words of a file that leave nothing to compare beside the programs."""


def _not_replaced(program: FileProgram, start: int, starts: set[int], product: str) -> FileProgram:
    """Return the lines of a program before the first one that begins inside it and changes a part of it."""
    others = starts - {start}
    inside: list[SourceLine] = []
    for line in program.lines:
        end = start + program_readout.size(line.text, product)
        if any(start <= other < end for other in others):
            break
        inside.append(line)
        start = end
    return replace(program, lines=tuple(inside))


def _there(program: FileProgram, start: int | None, starts: set[int], held: Held, product: str) -> Sequence[Stored]:
    """Return the lines in the drive from an address on: those of the program, and what an earlier one left after them.

    A line after the program belongs to it if no gap is between them, unless the program is a part of another one.
    """
    lines = held.lines
    first = next((n for n, line in enumerate(lines) if line.at == start), len(lines))
    last = first
    part = 0 < first < len(lines) and _follows(lines[first - 1], lines[first], product)
    while last < len(lines) and (last == first or lines[last].at not in starts):
        if last - first >= len(program.lines) and (part or not _follows(lines[last - 1], lines[last], product)):
            break
        last += 1
    return lines[first:last]


def _follows(before: Stored, line: Stored, product: str) -> bool:
    return before.at + program_readout.size(before.text, product) == line.at


def _compared(here: Sequence[SourceLine], there: Sequence[Stored], names: set[str]) -> Iterator[Difference]:
    own = [canonical(line.text, names) for line in here]
    theirs = [canonical(line.text, names) for line in there]
    if own == theirs:
        return
    from difflib import SequenceMatcher  # send never needs it

    for kind, a, b, c, d in SequenceMatcher(None, own, theirs, autojunk=False).get_opcodes():
        if kind == "equal":
            continue
        for source, stored in zip_longest(here[a:b], there[c:d]):
            number, text = (source.number, source.text) if source else (0, "")
            at, listed = (stored.at, stored.text) if stored else (None, "")
            yield Difference(number, text, at, listed)


def _unlike(state: MCodeState, line: SourceLine, held: Held) -> Procedure[str]:
    """Return why a line outside of programs must be sent; empty where the drive has its value."""
    names = program_readout.names_of(held)
    try:
        statement = parse(line.text, set(names))
    except LineError:
        statement = Statement(classify.word_of(line.text)[0], ())
    if statement is None or statement.word in STEADY:
        return ""
    named = program_readout.declared(line.text)
    name = named[1] if named is not None else statement.word
    if named is not None:
        first = statement.arguments[0]
        values = [_literal(first.right) if isinstance(first, Compare) else 0.0]
    else:
        values = yield from _values(state, statement)
    if name in names:
        present = [real(names[name].value)]
    elif named is not None or (row := lookup(name, state.product)) is None:
        return f"line {line.number} differs"
    else:
        present = (yield from _read_setting(state, name, values)) if row.kind in HOLDING and values else []
    if None in values or not present:
        return f"line {line.number}: '{line.text}' cannot be compared"
    return "" if present == values else f"line {line.number} differs"


def _values(state: MCodeState, statement: Statement) -> Procedure[list[float | None]]:
    """Return the values that a setting gets; of another word (`D=A`) its present value."""
    match statement.arguments:
        case (NameTerm(word),) if (row := lookup(word, state.product)) is not None and row.kind in HOLDING:
            return (yield from _read_setting(state, word, []))
    return [_literal(argument) for argument in statement.arguments]


def _literal(argument: Argument | None) -> float | None:
    """Return a number as written; None for anything else."""
    match argument:
        case Number(value):
            return float(value)
        case UnaryTerm("-", Number(value)):
            return -float(value)
    return None


def _read_setting(state: MCodeState, name: str, values: Sequence[float | None]) -> Procedure[list[float | None]]:
    """Read the present values of a setting; of a setting with several rows the row that begins alike."""
    printed = yield from MCodeOperations(state).immediate(state.codec.request(state.address, f"PR {name}"))
    rows = [[real(number) for number in line.rpartition("=")[2].split(",")] for line in printed if line.strip()]
    if len(rows) == 1:
        return rows[0]
    return next((row for row in rows if row[:1] == list(values[:1])), [])


class MCodePrograms(MCodeDownload):
    """The program in an MCode drive."""

    state: MCodeState

    save = "S"
    remark = "'"
    clearing = "CP"
    begins = ("PG", "FD")

    def differences(self, lines: Sequence[SourceLine], held: Held, before: Held | None = None) -> Sequence[Difference]:
        """Return where the programs of a file differ from those that a drive holds; other programs do not count.

        `before`: what the drive held before the file was sent. A line of that after a program is another program's.
        """
        names = program_readout.names_of(held)
        programs = program_readout.programs_of(lines)
        starts = {start for stored_program in programs if (start := stored_program.start(names)) is not None}
        known = {
            *names,
            *(declaration[1] for line in lines if (declaration := program_readout.declared(line.text)) is not None),
        }
        made: list[Difference] = []
        for program in programs:
            start = program.start(names)
            own = program if start is None else _not_replaced(program, start, starts, self.state.product)
            made += _compared(own.lines, _there(own, start, starts, held, self.state.product), known)
        old = set(before.lines) if before is not None else set()
        return tuple(
            stored_program
            for stored_program in made
            if stored_program.number or (stored_program.at, stored_program.there) not in old
        )

    def to_send(self, lines: Sequence[SourceLine], held: Held) -> Procedure[str]:
        """Return why a file must be sent; empty where the drive holds its programs, variables and settings already."""
        if why := first_difference(self.differences(lines, held)):
            return why
        if clears_itself(lines) and program_readout.size_of_file(lines) != len(held.lines):
            return "the drive holds other programs, which the file clears"
        for line in program_readout.immediate_lines(lines):
            if why := (yield from _unlike(self.state, line, held)):
                return why
        return ""

    def acts(self, line: str) -> bool:
        return guards.acts(line)


# The questions of a certificate.
#
# An immediate error runs a resident OE subroutine, and reading ER clears it. So the program is listed first, and LK is
# read before that: a drive that is locked refuses L with an error. (MCode reference 5.1.40, 5.1.75, 5.1.94.)


_SUBROUTINE = "an error would run its subroutine for errors (OE)"


class MCodeCertifying(Certifying):
    """The questions of a certificate to an MCode drive."""

    state: MCodeState

    module = __file__
    reads = "PR {}"
    writes = "{}={}"

    def traits(self) -> set[str]:
        """The firmware, the port, and how the drive is set, as far as questions depend on it."""
        state = self.state
        traits = {
            "mdrive" if state.product in EXPANDED | {"MDI", "MDIE"} else "lexium",
            "ethernet" if ETHERNET.match(state.product) else "serial",
        }
        traits |= {"base"} if state.product == "MDI" else set()
        traits |= (
            {"hmt"} if (row := lookup("AF", state.product)) is not None and state.product in row.products else set()
        )
        return traits | {"party" if state.codec.party else "alone"}

    def occupied(self) -> Procedure[Occupied]:
        """Find out whether a program is stored. Raises Refused where an error stands."""
        state = self.state
        error, locked = (yield from value_of(state, 'EF," ",LK', "[01] [01]")).split()
        if error == "1":
            raise Refused(
                f"{who(state)} has an error (EF=1) that the questions would clear: read it with PR ER, then ask"
            )
        if locked == "1":
            return Occupied(errors=f"its program is locked (LK=1), so it cannot be listed; {_SUBROUTINE}")
        lines = yield from MCodeOperations(state).listing("")
        return Occupied(errors=f"a program is stored ({counted(len(lines), 'line')}); {_SUBROUTINE}" if lines else "")

    def masked(self, raw: bytes) -> str:
        """Replace the drive's name, and check bytes, which depend on it."""
        text, name = raw.decode("latin-1"), re.escape(self.state.address)
        if name:
            text = re.sub(rf'(?m)^{name}(?=[A-Z])|(?<="){name}(?=")|(?<=~){name}', "NAME", text)
        return re.sub("[\x80-\xff]", "<check>", text)
