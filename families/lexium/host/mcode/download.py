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

from abc import ABC
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from multidrop.base.errors import DriveError, Inexpressible, NoAnswer, Refused, Stopped
from multidrop.base.files import SourceLine
from multidrop.base.text import counted
from multidrop.dialects.codec import End, Kind, Procedure, Request
from multidrop.dialects.family import Progress
from multidrop.dialects.program_files import LOCKED, Held
from multidrop.dialects.state import who
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.errors import described
from multidrop.families.lexium.host.mcode.before_request import before_request
from multidrop.families.lexium.host.mcode.exchange import (
    NAK_REPEATS,
    ends_in_program_mode,
    leave_program,
    read_error,
    take_out,
)
from multidrop.families.lexium.host.mcode.operations import (
    MCodeOperations,
    echo_everything,
    put_back,
    restore_echo,
)
from multidrop.families.lexium.host.mcode.program_readout import (
    GLOBAL,
    LABEL,
    LOCAL,
    MCodeReadout,
    ReadProgram,
    declared,
    immediate_lines,
    names_of,
    programs,
    programs_of,
    size,
)
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual.groups import SLOW
from multidrop.families.lexium.manual.program_checker import slips
from multidrop.families.lexium.manual.program_file import ProgramLine

WHOLE = {"", "0", "1", "S"}
"""The parameters with which CP clears all programs."""


@dataclass
class DownloadPlan:
    """The lines to send for a file, and the programs that CP removes: they go, or are stored again."""

    lines: list[ProgramLine] = field(default_factory=list)
    in_the_way: list[str] = field(default_factory=list)
    """Names of programs in the drive that the file gives again."""
    replaced: list[ReadProgram] = field(default_factory=list)
    kept: list[ReadProgram] = field(default_factory=list)

    @property
    def clears(self) -> bool:
        return bool(self.in_the_way or self.replaced)


def prepare(state: MCodeState, lines: Sequence[SourceLine], held: Held) -> Procedure[Sequence[SourceLine]]:
    """Return the lines to send, after clearing the drive's programs if needed. Raises Refused before that."""
    if held.locked and programs_of(lines):
        raise Refused(f"{who(state)}: {LOCKED} (nothing was sent)")
    made = plan(lines, held, who(state), state.product)
    if not made.clears:
        return made.lines
    # Send CP and report what it deletes. A file with an error is refused first.
    names = names_of(held)
    variables = [name for name, called in names.items() if called.kind == GLOBAL]
    for slip in slips([line for line in lines if isinstance(line, ProgramLine)], variables):
        raise Refused(f"line {slip.line}: {slip.what} (nothing was sent)")
    yield from MCodeOperations(state).immediate(state.codec.request(state.address, "CP"))
    state.note(f"{who(state)}: {_cleared(made, [name for name in names if names[name].kind == LABEL], lines)}")
    again: list[ProgramLine] = []  # the programs that stay, each line at its address
    for program in programs([line for each in made.kept for line in each.lines], state.product, fine=True):
        inside = [ProgramLine(0, line.text, "") for line in program.lines]
        again += [ProgramLine(0, f"PG {program.start}", ""), *inside, ProgramLine(0, "PG", "")]
    return again + made.lines


def plan(lines: Sequence[SourceLine], held: Held, drive: str, product: str = "") -> DownloadPlan:
    """Plan the lines for a drive that holds these programs and names. Raises Refused."""
    made = _named_lines(lines, held, drive, product)
    if clears_itself(lines):
        return made
    names = names_of(held)
    starts = [(each.start(names), each.lines) for each in programs_of(lines)]
    spans = [(at, at + sum(size(line.text, product) for line in inside)) for at, inside in starts if at is not None]
    declarations = [declaration for line in lines if (declaration := declared(line.text)) is not None]
    outside = [declaration for line in immediate_lines(lines) if (declaration := declared(line.text)) is not None]
    no_local = {name for word, name in declarations if word == "LB"} | {name for _, name in outside}
    for program in programs(held.lines, product):
        over = [(at, end) for at, end in spans if at < program.end and program.start < end]
        gone = any(not (program.start < at and end <= program.end) for at, end in over)  # a part of it replaces nothing
        # A name is given again: as a label in one of both, or a local name as a global.
        shared = program.declared("LB") & {name for _, name in declarations} or program.declared("VA") & no_local
        (made.replaced if gone or shared else made.kept).append(program)
    return made


def clears_itself(lines: Sequence[SourceLine]) -> bool:
    """Whether a file clears all programs before it stores its own: CP or FD is its author's decision."""
    entered = next((line.number for line in lines if classify.enters_program(line.text)), 0)
    before = (classify.word_of(line.text) for line in immediate_lines(lines) if line.number < entered)
    return any(word == "FD" or (word == "CP" and rest.upper() in WHOLE) for word, rest in before)


def _named_lines(lines: Sequence[SourceLine], held: Held, drive: str, product: str) -> DownloadPlan:
    """Plan what becomes of the names that a file declares. Raises Refused."""
    known = {name: called.kind for name, called in names_of(held).items()}
    own, made, inside = set[str](), DownloadPlan(), False
    for line in lines:
        word, name = declared(line.text) or ("", "")
        is_a = known.get(name, "")
        made.lines.append(ProgramLine(line.number, line.text, ""))
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
                _, equals, given = line.text.partition("=")
                made.lines[-1] = ProgramLine(line.number, f"{name}={given.strip() if equals else 0}", "")
            known[name] = GLOBAL
        if name:
            own.add(name)
        inside = classify.enters_program(line.text) or (inside and not classify.leaves_program(line.text))
        if not inside:
            # Forget the names that a line of the file deletes; a CP with an address is left to its author. The
            # parameter 1, which deletes global variables, is an address on an MDrivePlus.
            word, rest = classify.word_of(line.text)
            parameter = "" if product.startswith("MD") else rest.partition(",")[0].strip()
            everything = word == "FD" or (word == "CP" and parameter == "1")
            for name in [each for each, is_a in known.items() if everything or (word == "CP" and is_a != GLOBAL)]:
                del known[name]
    return made


def _cleared(made: DownloadPlan, labels: Iterable[str], lines: Sequence[SourceLine]) -> str:
    mine = {declaration[1] for line in lines if (declaration := declared(line.text))}
    stay = {name for program in made.kept for name in program.declared("LB")}
    gone = ", ".join(name for name in labels if name not in mine | stay)
    which = ", ".join(str(program.start) for program in made.replaced)
    parts = [
        f"the program at {which} was cleared (CP)" if which else f"{', '.join(made.in_the_way)} went with CP",
        f"labels that the file does not have went with it: {gone}" if gone else "",
        f"stored again: the program at {', '.join(str(program.start) for program in made.kept)}" if made.kept else "",
    ]
    return "; ".join(part for part in parts if part)


# The download of a program: the host verifies every line, and restores the drive's echo mode in every case.
#
# Theory of operation. What the drive holds already comes first (`prepare`). Only EM=0 shows by its prompt whether a
# line was stored, or executed without a refusal. So a download of a program switches to EM=0. S would save that, and a
# file may set EM itself. So the host restores the echo mode before a line that saves, sets or starts anything. In
# program mode the drive stores every line, so ER cannot be read. A NAK in program mode means that the line was not
# stored. The host then leaves program mode and reads ER. It repeats the line only if the frame was damaged (ER=0), at
# the address of the last prompt. (MCode reference 5.1.98, 7.1; facts of real units.)


@dataclass
class _Memory:
    """What a download has stored: number of lines, the first label, spans of addresses."""

    programs: int
    """Number of programs in the file, each from PG to PG."""
    lines: int = 0
    label: str = ""
    spans: list[tuple[int, int]] = field(default_factory=list)
    ended: int = 0

    def put(self, line: SourceLine, at: int, following: int) -> None:
        if not line.number:
            return
        word, rest = classify.word_of(line.text)
        self.lines += 1
        self.label = self.label or (rest.upper() if word == "LB" else "")
        if self.spans and self.spans[-1][1] == at:
            at = self.spans.pop()[0]
        self.spans.append((at, following))

    def told(self, state: MCodeState) -> str:
        """Describe what is stored after a download that ended early."""
        if not self.lines:
            return "no line of the program is stored"
        places = ", ".join(f"{first} to {following - 1}" for first, following in self.spans)
        label = f", from label {self.label}" if self.label else ""
        count = counted(self.lines, "line is", "lines are")
        held = f"{count} stored (addresses {places}{label})"
        return held if self.ended == self.programs else f"{held}: the program in {who(state)} is incomplete"


def _note_cut_off(state: MCodeState, memory: _Memory) -> None:
    state.note(f"{who(state)}: the download was cut off: {memory.told(state)}")


def _where(line: SourceLine) -> str:
    return f"line {line.number}" if line.number else f"the program that stays: '{line.text}'"


def _one(state: MCodeState, line: SourceLine, memory: _Memory) -> Procedure[None]:
    text = line.text
    if state.programming:
        at = state.next_address
        yield from _stored(state, state.codec.request(state.address, text, Kind.PROGRAM))
        if state.programming:
            memory.put(line, at, state.next_address)
        else:
            memory.ended += 1
        return
    # Use EM=0 for the next line, or restore the echo mode before a line that saves, sets or starts anything.
    if _needs_own_echo(text):
        yield from restore_echo(state)
    elif state.codec.em != 0 and memory.programs > memory.ended:
        yield from echo_everything(state)
    request = state.codec.request(state.address, text)
    if classify.enters_program(text):
        state.may_be_in_program_mode()  # until the reply shows it: an interruption must leave program mode
        reply = yield request
        if not ends_in_program_mode(reply):
            # Raise the reason for a PG n without a program prompt.
            if reply.end in (End.REFUSED, End.NAK) or reply.prompt == ">":
                state.left_program_mode()
                code = yield from read_error(state)
                why = described(code, state) if code else "it did not go into program mode"
                raise Refused(f"{who(state)} refused '{request.text}': {why}", code)
            raise NoAnswer(f"{who(state)}: no reply to '{request.text}' ({reply.end.value})")
        state.entered_program_mode(int(reply.prompt))
    else:
        yield from MCodeOperations(state).immediate(request)


def _needs_own_echo(text: str) -> bool:
    """Whether a line may save the settings, change how the drive replies, or start a program that does."""
    if classify.enters_program(text):
        return False
    slow = classify.word_of(text)[0] in SLOW
    return slow or classify.kind_of(text) is Kind.SETTING or classify.starts_motion(text)


def _stored(state: MCodeState, request: Request) -> Procedure[None]:
    """Store a line in program mode, or end program mode with PG. `request` is of the kind PROGRAM."""
    leaving = request.text.upper() == "PG"
    for _ in range(1 + NAK_REPEATS):
        reply = yield request
        if reply.end is End.NAK and not leaving:
            yield from _again_at(state, request)
            continue
        if reply.end is End.DONE and ends_in_program_mode(reply) is not leaving:
            if leaving:
                state.left_program_mode()
            else:
                state.entered_program_mode(int(reply.prompt))
            return
        if leaving and reply.prompt == "?":
            state.left_program_mode()
            code = yield from read_error(state)
            raise Refused(f"{who(state)} ended program mode with {described(code or 0, state)}", code)
        if reply.end is End.REFUSED:
            # Its error can be read only outside of program mode.
            code = (yield from leave_program(state)) or (yield from read_error(state))
            why = described(code, state) if code else "its error register gives no reason"
            raise Refused(f"{who(state)} refused '{request.text}': {why}")
        raise NoAnswer(f"{who(state)}: it is not known whether '{request.text}' was stored ({reply.end.value})")
    raise NoAnswer(f"{who(state)}: '{request.text}' arrived damaged {1 + NAK_REPEATS} times; check the cabling")


def _again_at(state: MCodeState, request: Request) -> Procedure[None]:
    """Recover from a NAK in program mode: leave it, read ER, and return to the same address after a damaged frame."""
    address = state.next_address
    code: int | None = (yield from leave_program(state)) or (yield from read_error(state))
    if code != 0:
        why = described(code, state) if code else "the reason could not be read"
        raise Refused(f"{who(state)} refused '{request.text}': {why}", code)
    state.entered_program_mode(address)  # until the reply shows otherwise
    reply = yield state.codec.request(state.address, f"PG {address}")
    if not ends_in_program_mode(reply):
        raise NoAnswer(f"{who(state)} did not go back into program mode at {address}")


class MCodeDownload(MCodeReadout, ABC):
    """The program in an MCode drive: how a file is sent to it."""

    def download(
        self, lines: Sequence[SourceLine], held: Held | None, progress: Progress
    ) -> Procedure[Sequence[SourceLine]]:
        """Send the lines of a program file. Raises Refused or NoAnswer with the line's number and what is stored.

        `held`: what was just read from the drive; None: the host reads it now. Always leaves program mode. Returns the
        lines that it sent: programs of the drive that stay (lines of number 0), and the file.
        """
        state = self.state
        for line in lines:
            try:
                state.codec.request(state.address, line.text, Kind.PROGRAM)
            except Inexpressible as error:
                raise Inexpressible(f"{_where(line)}: {error}") from error
        if state.programming:
            raise Refused(f"{who(state)} is in program mode: leave it with PG first")
        if not lines:
            return ()
        yield from before_request(state, state.codec.request(state.address, lines[0].text))
        if held is None:
            concerned = any(declared(line.text) or classify.enters_program(line.text) for line in lines)
            held = (yield from self.read(lines, progress)) if concerned else Held()
        lines = yield from prepare(state, lines, held)
        memory, fate = _Memory(sum(classify.enters_program(line.text) for line in lines)), ""
        try:
            for done, line in enumerate(lines):
                progress(done, len(lines))
                fate = "cut off"
                try:
                    yield from _one(state, line, memory)
                except DriveError as error:
                    if isinstance(error, Stopped):  # its caller may have gone
                        _note_cut_off(state, memory)
                    fate, error.args = "told", (f"{_where(line)}: {error}; {memory.told(state)}",)
                    raise
            progress(len(lines), len(lines))
            fate = "done"
            return lines
        finally:
            if fate == "cut off":
                _note_cut_off(state, memory)
            # Leave program mode and restore the echo mode.
            done_all = fate == "done"
            try:
                if state.programming:
                    yield from take_out(state, "taken out of program mode; the program in it is incomplete")
                yield from restore_echo(state) if done_all else put_back(state)
            except DriveError as error:
                if done_all:
                    raise
                state.note(str(error))  # the download's own failure is the one to raise
