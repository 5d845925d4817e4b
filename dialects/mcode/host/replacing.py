"""A program file and what the drive holds: what the host sends instead, before or beside the file's lines.

Theory of operation. A drive refuses a label or a variable that exists (error 28), and an error runs a resident OE
subroutine. A program that is shorter than the one in its place leaves the rest of that after it. So the host reads
the listing and the names first. It assigns the file's value to a global variable that exists. CP removes all programs,
their labels and their variables, and keeps global variables. The host sends CP if a program or a name of the file
replaces one in the drive, and stores again each program that the file does not replace. A program of the file that
lies inside one of the drive changes a part of it, and replaces nothing. A global variable cannot become a label or a
local variable without deleting other variables. The host refuses that before it sends anything. (MCode reference
3.2.2, 5.1.23, 5.1.75, 5.1.134, 5.1.136, section 10; facts of real units.)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Refused
from multidrop.dialects.files import SourceLine
from multidrop.dialects.held import LOCKED, Held
from multidrop.dialects.mcode.host import classify
from multidrop.dialects.mcode.host.listing import (
    GLOBAL,
    LABEL,
    LOCAL,
    FileProgram,
    Program,
    declared,
    immediate_lines,
    names_of,
    programs,
    programs_of,
    size,
)
from multidrop.dialects.mcode.host.operations import immediate
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import who
from multidrop.dialects.mcode.manual.program_checker import slips
from multidrop.dialects.mcode.manual.program_file import ProgramLine

WHOLE = {"", "0", "1", "S"}
"""The parameters with which CP clears all programs."""


@dataclass(frozen=True)
class Line:
    """A line to send: its number in the file, from 1, and its text. Number 0: it is not in the file."""

    number: int
    text: str


@dataclass
class Plan:
    """The lines to send for a file, and the programs that CP removes: they go, or are stored again."""

    lines: list[Line] = field(default_factory=list)
    in_the_way: list[str] = field(default_factory=list)
    """Names of programs in the drive that the file gives again."""
    replaced: list[Program] = field(default_factory=list)
    kept: list[Program] = field(default_factory=list)

    @property
    def clears(self) -> bool:
        """Whether CP is needed."""
        return bool(self.in_the_way or self.replaced)

    def after_clearing(self, product: str) -> list[Line]:
        """Return the lines to send after CP: the programs that stay, each line at its address, then the file."""
        again: list[Line] = []
        for program in programs([line for each in self.kept for line in each.lines], product, fine=True):
            inside = [Line(0, line.text) for line in program.lines]
            again += [Line(0, f"PG {program.start}"), *inside, Line(0, "PG")]
        return again + self.lines


def concerns_programs(lines: Sequence[SourceLine]) -> bool:
    """Whether a file declares names or stores programs, so that what the drive holds matters."""
    return any(declared(line.text) or classify.enters_program(line.text) for line in lines)


def prepare(state: MCodeState, lines: Sequence[SourceLine], held: Held) -> Procedure[Sequence[SourceLine]]:
    """Return the lines to send, after clearing the drive's programs if needed. Raises Refused before that."""
    if held.locked and programs_of(lines):
        raise Refused(f"{who(state)}: {LOCKED} (nothing was sent)")
    made = plan(lines, held, who(state), state.product)
    if not made.clears:
        return made.lines
    yield from _clear(state, made, held, lines)
    return made.after_clearing(state.product)


def plan(lines: Sequence[SourceLine], held: Held, drive: str, product: str = "") -> Plan:
    """Plan the lines for a drive that holds these programs and names. Raises Refused."""
    made = _named_lines(lines, held, drive, product)
    if clears_itself(lines):
        return made
    names = names_of(held)
    own = programs_of(lines)
    for program in programs(held.lines, product):
        gone = any(_overlap(each, each.start(names), program, product) for each in own)
        (made.replaced if gone or _share_names(program, lines) else made.kept).append(program)
    return made


def clears_itself(lines: Sequence[SourceLine]) -> bool:
    """Whether a file clears all programs before it stores its own: CP or FD is its author's decision."""
    entered = next((line.number for line in lines if classify.enters_program(line.text)), 0)
    before = (classify.word_of(line.text) for line in immediate_lines(lines) if line.number < entered)
    return any(word == "FD" or (word == "CP" and rest.upper() in WHOLE) for word, rest in before)


def _overlap(own: FileProgram, start: int | None, program: Program, product: str) -> bool:
    """Whether a program of the file takes the place of one in the drive; not where it is a part of that."""
    if start is None:
        return False
    end = start + sum(size(line.text, product) for line in own.lines)
    part = program.start < start and end <= program.end
    return start < program.end and program.start < end and not part


def _share_names(program: Program, lines: Sequence[SourceLine]) -> bool:
    """Whether a file gives names again that a program has: as a label in one of both, or a local name as a global."""
    found = [each for line in lines if (each := declared(line.text)) is not None]
    outside = [each for line in immediate_lines(lines) if (each := declared(line.text)) is not None]
    no_local = {name for word, name in found if word == "LB"} | {name for _, name in outside}
    return bool(program.declared("LB") & {name for _, name in found} or program.declared("VA") & no_local)


def _named_lines(lines: Sequence[SourceLine], held: Held, drive: str, product: str) -> Plan:
    """Plan what becomes of the names that a file declares. Raises Refused."""
    known = {name: called.kind for name, called in names_of(held).items()}
    own, made, inside = set[str](), Plan(), False
    for line in lines:
        word, name = declared(line.text) or ("", "")
        is_a = known.get(name, "")
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
            known[name] = GLOBAL
        if name:
            own.add(name)
        inside = classify.enters_program(line.text) or (inside and not classify.leaves_program(line.text))
        if not inside:
            _forget(line.text, known, product)
    return made


def _forget(text: str, known: dict[str, str], product: str) -> None:
    """Forget the names that a line of the file deletes; a CP with an address is left to its author.

    The parameter 1, which deletes global variables, is an address on an MDrivePlus.
    """
    word, rest = classify.word_of(text)
    parameter = "" if product.startswith("MD") else rest.partition(",")[0].strip()
    everything = word == "FD" or (word == "CP" and parameter == "1")
    for name in [each for each, is_a in known.items() if everything or (word == "CP" and is_a != GLOBAL)]:
        del known[name]


def _assignment(text: str, name: str) -> str:
    """Return `Q1=25` for `VA Q1=25`, and `Q1=0` for `VA Q1`."""
    _, equals, given = text.partition("=")
    return f"{name}={given.strip() if equals else 0}"


def _clear(state: MCodeState, made: Plan, held: Held, lines: Sequence[SourceLine]) -> Procedure[None]:
    """Send CP and report what it deletes. A file with an error is refused first."""
    names = names_of(held)
    variables = [name for name, called in names.items() if called.kind == GLOBAL]
    for slip in slips([line for line in lines if isinstance(line, ProgramLine)], variables):
        raise Refused(f"line {slip.line}: {slip.what} (nothing was sent)")
    yield from immediate(state, state.codec.request(state.address, "CP"))
    state.note(f"{who(state)}: {_cleared(made, [name for name in names if names[name].kind == LABEL], lines)}")


def _cleared(made: Plan, labels: Iterable[str], lines: Sequence[SourceLine]) -> str:
    """Describe what CP has cleared."""
    mine = {found[1] for line in lines if (found := declared(line.text))}
    stay = {name for program in made.kept for name in program.declared("LB")}
    gone = ", ".join(name for name in labels if name not in mine | stay)
    which = ", ".join(str(program.start) for program in made.replaced)
    parts = [
        f"the program at {which} was cleared (CP)" if which else f"{', '.join(made.in_the_way)} went with CP",
        f"labels that the file does not have went with it: {gone}" if gone else "",
        f"stored again: the program at {', '.join(str(program.start) for program in made.kept)}" if made.kept else "",
    ]
    return "; ".join(part for part in parts if part)
