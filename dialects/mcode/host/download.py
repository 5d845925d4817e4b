"""The download of a program: the host verifies every line, and restores the drive's echo mode in every case.

Theory of operation. What the drive holds already comes first (`replacing`). Only EM=0 shows by its prompt
whether a line was stored, or executed without a refusal. So a download of a program switches to EM=0. S would save
that, and a file may set EM itself. So the host restores the echo mode before a line that saves, sets or starts
anything. In program mode the drive stores every line, so ER cannot be read. A NAK in program mode means that the line
was not stored. The host then leaves program mode and reads ER. It repeats the line only if the frame was damaged
(ER=0), at the address of the last prompt. (MCode reference 5.1.98, 7.1; facts of real units.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from multidrop.dialects.codec import End, Kind, Procedure, Reply, Request
from multidrop.dialects.errors import DriveError, Inexpressible, NoAnswer, Refused, Stopped
from multidrop.dialects.family import Progress
from multidrop.dialects.files import SourceLine
from multidrop.dialects.held import Held
from multidrop.dialects.mcode.host import classify
from multidrop.dialects.mcode.host.attend import attend
from multidrop.dialects.mcode.host.exchange import REPEATS, ends_in_program_mode, read_error
from multidrop.dialects.mcode.host.holding import read
from multidrop.dialects.mcode.host.leave_program import leave_program, take_out
from multidrop.dialects.mcode.host.operations import immediate
from multidrop.dialects.mcode.host.program_mode import echo_everything, put_back, restore_echo
from multidrop.dialects.mcode.host.replacing import concerns_programs, prepare
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import described, who


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
        """Record a line of the file that was stored from one address up to another."""
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
        count = f"{self.lines} lines are" if self.lines > 1 else "1 line is"
        held = f"{count} stored (addresses {places}{label})"
        return held if self.ended == self.programs else f"{held}: the program in {who(state)} is incomplete"


def download(
    state: MCodeState, lines: Sequence[SourceLine], held: Held | None, progress: Progress
) -> Procedure[Sequence[SourceLine]]:
    """Send the lines of a program file. Raises Refused or NoAnswer with the line's number and what is stored.

    `held`: what was just read from the drive; None: the host reads it now. Always leaves program mode. Returns the
    lines that it sent: programs of the drive that stay (lines of number 0), and the file.
    """
    for line in lines:
        try:
            state.codec.request(state.address, line.text, Kind.PROGRAM)
        except Inexpressible as error:
            raise Inexpressible(f"{_where(line)}: {error}") from error
    if state.programming:
        raise Refused(f"{who(state)} is in program mode: leave it with PG first")
    if not lines:
        return ()
    yield from attend(state, state.codec.request(state.address, lines[0].text))
    if held is None:
        held = (yield from read(state, lines, progress)) if concerns_programs(lines) else Held()
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
        yield from _left_as_found(state, done_all=fate == "done")


def _note_cut_off(state: MCodeState, memory: _Memory) -> None:
    state.note(f"{who(state)}: the download was cut off: {memory.told(state)}")


def _left_as_found(state: MCodeState, done_all: bool) -> Procedure[None]:
    """Leave program mode and restore the echo mode."""
    try:
        if state.programming:
            yield from take_out(state, "taken out of program mode; the program in it is incomplete")
        yield from restore_echo(state) if done_all else put_back(state)
    except DriveError as error:
        if done_all:
            raise
        state.note(str(error))  # the download's own failure is the one to raise


def _where(line: SourceLine) -> str:
    """Name a line for a person."""
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
    yield from _choose_echo(state, text, memory)
    request = state.codec.request(state.address, text)
    if classify.enters_program(text):
        state.may_be_in_program_mode()  # until the reply shows it: an interruption must leave program mode
        reply = yield request
        if not ends_in_program_mode(reply):
            yield from _not_entered(state, request, reply)
        state.entered_program_mode(_address(reply))
    else:
        yield from immediate(state, request)


def _choose_echo(state: MCodeState, text: str, memory: _Memory) -> Procedure[None]:
    """Use EM=0 for the next line, or restore the echo mode before a line that saves, sets or starts anything."""
    if _needs_own_echo(text):
        yield from restore_echo(state)
    elif state.codec.em != 0 and memory.programs > memory.ended:
        yield from echo_everything(state)


def _needs_own_echo(text: str) -> bool:
    """Whether a line may save the settings, change how the drive replies, or start a program that does."""
    if classify.enters_program(text):
        return False
    slow = classify.word_of(text)[0] in classify.SLOW
    return slow or classify.kind_of(text) is Kind.SETTING or classify.starts_motion(text)


def _address(reply: Reply) -> int:
    return int(reply.prompt.strip())


def _not_entered(state: MCodeState, request: Request, reply: Reply) -> Procedure[None]:
    """Raise the reason for a PG n without a program prompt."""
    if reply.end in (End.REFUSED, End.NAK) or reply.prompt == ">":
        state.left_program_mode()
        code = yield from read_error(state)
        why = described(code, state) if code else "it did not go into program mode"
        raise Refused(f"{who(state)} refused '{request.text}': {why}", code)
    raise NoAnswer(f"{who(state)}: no reply to '{request.text}' ({reply.end.value})")


def _stored(state: MCodeState, request: Request) -> Procedure[None]:
    """Store a line in program mode, or end program mode with PG. `request` is of the kind PROGRAM."""
    leaving = request.text.upper() == "PG"
    for _ in range(1 + REPEATS):
        reply = yield request
        if reply.end is End.NAK and not leaving:
            yield from _again_at(state, request)
            continue
        if reply.end is End.DONE and ends_in_program_mode(reply) is not leaving:
            if leaving:
                state.left_program_mode()
            else:
                state.entered_program_mode(_address(reply))
            return
        if leaving and reply.prompt == "?":
            state.left_program_mode()
            code = yield from read_error(state)
            raise Refused(f"{who(state)} ended program mode with {described(code or 0, state)}", code)
        if reply.end is End.REFUSED:
            raise Refused(f"{who(state)} refused '{request.text}': {(yield from _why(state))}")
        raise NoAnswer(f"{who(state)}: it is not known whether '{request.text}' was stored ({reply.end.value})")
    raise NoAnswer(f"{who(state)}: '{request.text}' arrived damaged {1 + REPEATS} times; check the cabling")


def _why(state: MCodeState) -> Procedure[str]:
    """Read the reason for a refusal in program mode, which is possible only outside of it."""
    code = (yield from leave_program(state)) or (yield from read_error(state))
    return described(code, state) if code else "its error register gives no reason"


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
