"""Programs to a drive: every line seen to be taken, and the drive left as it was found, whatever happens.

Theory of operation. What of the file exists in the drive already is seen to first (`replacing`). Only EM=0 shows by its
prompt whether a line was stored, so a download switches to it for program mode, and back before anything else: S would
save EM=0 else, and a file may set EM itself. In program mode nothing but the program's lines may go to the drive; ER
cannot be read there. A NAK in program mode means that the line was not stored: the drive is taken out of program mode,
ER read, and only a damaged frame (0) is sent again, to the address that the last prompt named.
(MCode reference 5.1.98, 7.1; facts of real units.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from dialects.base import End, Kind, Known, Progress, Reply, Request, SourceLine, Talk
from dialects.errors import DriveError, Inexpressible, NoAnswer, Refused
from dialects.mcode import kinds
from dialects.mcode.asking import (
    REPEATS,
    described,
    ends_in_program_mode,
    mcode,
    read_error,
    who,
)
from dialects.mcode.finding import attend
from dialects.mcode.leaving import leave_program, take_out
from dialects.mcode.programming import echo_everything, put_back, restore_echo
from dialects.mcode.replacing import prepare
from dialects.mcode.talk import immediate


@dataclass
class _Memory:
    """What a download has put into program memory: how many lines, the first label, spans of addresses."""

    programs: int
    """How many programs, from PG to PG, the file has."""
    lines: int = 0
    label: str = ""
    spans: list[tuple[int, int]] = field(default_factory=list)
    ended: int = 0

    def put(self, text: str, at: int, following: int) -> None:
        """A line is stored from one address up to another."""
        word, rest = kinds.word_of(text)
        self.lines += 1
        self.label = self.label or (rest.upper() if word == "LB" else "")
        if self.spans and self.spans[-1][1] == at:
            at = self.spans.pop()[0]
        self.spans.append((at, following))

    def told(self, known: Known) -> str:
        """What is to be said of it where the download ended early."""
        if not self.lines:
            return "no line of the program is stored"
        places = ", ".join(f"{first} to {following - 1}" for first, following in self.spans)
        label = f", from label {self.label}" if self.label else ""
        count = f"{self.lines} lines are" if self.lines > 1 else "1 line is"
        held = f"{count} stored (addresses {places}{label})"
        return held if self.ended == self.programs else f"{held}: the program in {who(known)} is incomplete"


def download(known: Known, lines: Sequence[SourceLine], progress: Progress) -> Talk[None]:
    """Send a program file's lines. Raises Refused or NoAnswer with the file's line and what of it is stored.

    Leaves program mode always.
    """
    for line in lines:
        try:
            mcode(known).request(known.address, line.text)
        except Inexpressible as error:
            raise Inexpressible(f"line {line.number}: {error}") from error
    if known.programming:
        raise Refused(f"{who(known)} is in program mode: leave it with PG first")
    if not lines:
        return
    yield from attend(known, mcode(known).request(known.address, lines[0].text))
    lines = yield from prepare(known, lines)
    memory, fate = _Memory(sum(kinds.enters_program(line.text) for line in lines)), ""
    try:
        for done, line in enumerate(lines):
            progress(done, len(lines))
            fate = "cut off"
            try:
                yield from _one(known, line.text, memory)
            except DriveError as error:
                fate, error.args = "told", (f"line {line.number}: {error}; {memory.told(known)}",)
                raise
        progress(len(lines), len(lines))
        fate = "done"
    finally:
        if fate == "cut off":
            known.notes.append(f"{who(known)}: the download was cut off: {memory.told(known)}")
        yield from _left_as_found(known, done_all=fate == "done")


def _left_as_found(known: Known, done_all: bool) -> Talk[None]:
    """Out of program mode, in the echo mode that was there."""
    try:
        if known.programming:
            yield from take_out(known, "taken out of program mode; the program in it is incomplete")
        yield from restore_echo(known) if done_all else put_back(known)
    except DriveError as error:
        if done_all:
            raise
        known.notes.append(str(error))  # what went wrong before is what is told


def _one(known: Known, text: str, memory: _Memory) -> Talk[None]:
    if not known.programming and kinds.enters_program(text) and mcode(known).em != 0:
        yield from echo_everything(known)
    request = mcode(known).request(known.address, text)
    if known.programming:
        at = known.stored
        yield from _stored(known, request)
        if known.programming:
            memory.put(text, at, known.stored)
        else:
            memory.ended += 1
            yield from restore_echo(known)
    elif kinds.enters_program(text):
        known.programming = True  # until the answer tells: whatever comes in between must be cleaned up
        reply = yield request
        if not ends_in_program_mode(reply):
            yield from _not_entered(known, request, reply)
        known.stored = _address(reply)
    else:
        yield from immediate(known, request)


def _address(reply: Reply) -> int:
    return int(reply.prompt.strip())


def _not_entered(known: Known, request: Request, reply: Reply) -> Talk[None]:
    """PG n that did not show a program prompt: say why, and count on the worst."""
    if reply.end in (End.REFUSED, End.NAK) or reply.prompt == ">":
        known.programming = False
        code = yield from read_error(known)
        why = described(code, known) if code else "it did not go into program mode"
        raise Refused(f"{who(known)} refused '{request.text}': {why}", code)
    raise NoAnswer(f"{who(known)}: no answer to '{request.text}' ({reply.end.value})")


def _stored(known: Known, request: Request) -> Talk[None]:
    """A line in program mode, or the PG that ends it."""
    request = replace(request, kind=Kind.PROGRAM)
    leaving = request.text.upper() == "PG"
    for _ in range(1 + REPEATS):
        reply = yield request
        if reply.end is End.NAK and not leaving:
            yield from _again_at(known, request)
            continue
        if reply.end is End.DONE and ends_in_program_mode(reply) is not leaving:
            known.programming = not leaving
            known.stored = 0 if leaving else _address(reply)
            return
        if leaving and reply.prompt == "?":
            known.programming = False
            code = yield from read_error(known)
            raise Refused(f"{who(known)} ended program mode with {described(code or 0, known)}", code)
        if reply.end is End.REFUSED:
            raise Refused(f"{who(known)} refused '{request.text}': {(yield from _why(known))}")
        raise NoAnswer(f"{who(known)}: it is not known whether '{request.text}' was stored ({reply.end.value})")
    raise NoAnswer(f"{who(known)}: '{request.text}' arrived damaged {1 + REPEATS} times; check the cabling")


def _why(known: Known) -> Talk[str]:
    """The reason for a refusal in program mode, which can only be read outside of it."""
    code = (yield from leave_program(known)) or (yield from read_error(known))
    return described(code, known) if code else "its error register gives no reason"


def _again_at(known: Known, request: Request) -> Talk[None]:
    """After a NAK in program mode: out, ask why, and where the frame was damaged in again at the same address."""
    address = known.stored
    code: int | None = (yield from leave_program(known)) or (yield from read_error(known))
    if code != 0:
        why = described(code, known) if code else "the reason could not be read"
        raise Refused(f"{who(known)} refused '{request.text}': {why}", code)
    known.programming = True  # until the answer tells, as above
    reply = yield mcode(known).request(known.address, f"PG {address}")
    if not ends_in_program_mode(reply):
        raise NoAnswer(f"{who(known)} did not go back into program mode at {address}")
