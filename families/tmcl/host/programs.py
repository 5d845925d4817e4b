"""The program in a module: read line by line, downloaded and read back, run, stepped and observed.

Theory of operation. Between 132 and 133 a module stores every command but the control commands, from the address in
132 on; so nothing else goes to it, and each line is sent once. A line after the last one is overwritten with an empty
one, as the maker's IDE does, so that the rest of a longer program is not reached. Command 134 replies with the seven
bytes of a stored line, without status and command number; only an exchange that is in step can tell it from a late
reply, so a mark follows each doubtful one. What the module does is in global parameters 128 and 130.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, Refused, Stopped
from multidrop.base.files import SourceLine, lines_of_text
from multidrop.base.text import counted, whole
from multidrop.dialects.codec import Procedure
from multidrop.dialects.debugging import Debugging, Look, Neighbours, Stepped
from multidrop.dialects.family import Printed, Programs, Progress
from multidrop.dialects.program_files import Difference, Held, Stored, numbered
from multidrop.dialects.state import who
from multidrop.families.tmcl.host.codec import TmclState, call_of, line_in, parse_reply
from multidrop.families.tmcl.host.operations import (
    LACKS,
    TmclExchange,
    TmclOperations,
    read,
)
from multidrop.families.tmcl.manual import program_file
from multidrop.families.tmcl.manual.commands import Command, Global, TmclCall, parameter
from multidrop.families.tmcl.manual.instructions import EMPTY, MEMORY, ProgramWord, spelled

ERASED = 255
"""The number of a line in memory that was never written, in some modules."""
BLANK = 64
"""Empty lines in a row after which the memory is taken for empty: routines may begin at several addresses."""
OVER = TmclCall(EMPTY)


def read_line(state: TmclState, at: int) -> Procedure[TmclCall]:
    """Read one line of the memory. Raises Refused or NoAnswer."""
    request = state.codec.request(state.address, f"134 0, 0, {at}", TmclCall(Command.READ_PROGRAM, value=at))
    reply = yield from TmclExchange(state).answered(request)
    fields = parse_reply(reply.body)
    if fields is not None and (fields.module, fields.command) == (call_of(request.body)[0], Command.READ_PROGRAM):
        raise Refused(f"{who(state)} reads no line of its program to a host")
    call = line_in(reply.body)
    return OVER if call.command in (EMPTY, ERASED) else call


def read_memory(state: TmclState, last: int, progress: Progress) -> Procedure[Mapping[int, TmclCall]]:
    """Read the stored lines, at least up to address `last`."""
    memory: dict[int, TmclCall] = {}
    blank = at = 0
    while at < MEMORY and (blank < BLANK or at <= last):
        progress(at, min(max(at + BLANK - blank, last + 1), MEMORY))
        try:
            call = yield from read_line(state, at)
        except Refused as refused:
            if at and refused.code in LACKS:  # the end of a smaller memory
                break
            raise
        if call.command == EMPTY:
            blank += 1
        else:
            blank, memory[at] = 0, call
        at += 1
    return memory


def held_of(memory: Mapping[int, TmclCall]) -> Held:
    return Held(tuple(Stored(at, spelled(call)) for at, call in sorted(memory.items())))


def calls_of(held: Held) -> dict[int, TmclCall]:
    """The lines of the memory that `held_of` wrote."""
    made = program_file.assembled(numbered([line.text for line in held.lines]))
    return {line.at: placed.call for line, placed in zip(held.lines, made.lines, strict=True)}


def _line(state: TmclState, call: TmclCall) -> tuple[Any, TmclCall]:
    return state.codec.request(state.address, spelled(call), call), call


def _leave(state: TmclState) -> Procedure[None]:
    """End a download that failed; a failure of this is noted, for the download's own is the one to raise."""
    try:
        yield from TmclExchange(state).store(*_line(state, TmclCall(Command.END_DOWNLOAD)))
    except DriveError as error:
        state.note(str(error))


def _incomplete(state: TmclState, done: int, total: int) -> str:
    if not done:
        return f"no line of the file is known to be stored in {who(state)}"
    return f"{done} of {total} lines are stored: the program in {who(state)} is incomplete"


class TmclPrograms(Programs):
    """The program in a TMCL module."""

    state: TmclState

    remark = "//"
    keeper = "module"

    def listing(self, place: str = "") -> Printed:
        held = yield from self.read((), lambda done, total: None)
        first = whole(place, 0, MEMORY) or 0
        return tuple(f"{line.at}  {line.text}" for line in held.lines if line.at >= first)

    def readable(self, held: Held) -> Sequence[str]:
        """List each line with its address and, where a jump goes there, its label."""
        calls = calls_of(held)
        texts = [line for line in program_file.disassembled(calls) if not line.endswith(":")]
        labels = {line.removesuffix(":") for line in program_file.disassembled(calls) if line.endswith(":")}
        width = max(
            (len(program_file.label_of(at)) + 2 for at in calls if program_file.label_of(at) in labels), default=0
        )
        return tuple(
            f"{at}  {f'{name}:' if (name := program_file.label_of(at)) in labels else '':{width}}{texts[at].strip()}"
            for at in sorted(calls)
        )

    def read(self, lines: Sequence[SourceLine], progress: Progress) -> Procedure[Held]:
        return held_of(
            (yield from read_memory(self.state, len(program_file.compiled(lines)) if lines else -1, progress))
        )

    def file(self, held: Held, raw: bool) -> Sequence[str]:
        """The lines of a file that gives this memory: with labels, or `raw` with addresses."""
        calls = calls_of(held)
        if not raw:
            return tuple(program_file.disassembled(calls))
        return tuple(spelled(calls.get(at, OVER)) for at in range(max(calls, default=-1) + 1))

    def size(self, lines: Sequence[SourceLine]) -> int:
        return len(program_file.compiled(lines))

    def end(self) -> Procedure[bool]:
        """End the program, and stop the motors that it has started; whether it ran.

        Raises Refused where a motor moves without a program.
        """
        state = self.state
        runs = yield from TmclOperations(state).busy()
        moves = yield from TmclOperations(state).moving()
        if not runs and moves:
            raise Refused(f"{who(state)} moves: stop it first (nothing was sent)")
        if runs:
            yield from TmclOperations(state).perform("128 0, 0, 0")
            for motor in range(max(state.motors, 1)):
                yield from TmclOperations(state).perform(f"MST {motor}")
                with suppress(Refused):  # a module without reference search
                    yield from TmclOperations(state).perform(f"RFS STOP, {motor}")
        return runs

    def download(
        self, lines: Sequence[SourceLine], held: Held | None, progress: Progress
    ) -> Procedure[Sequence[SourceLine]]:
        """Store a program from address 0 on, and an empty line after it. Raises Refused or NoAnswer.

        Ends download mode in every case. `held`: what was just read; its lines beyond the file stay.
        """
        state = self.state
        stored = program_file.compiled(lines)
        if state.programming:
            raise Refused(f"{who(state)} is in download mode; 133 0, 0, 0 ends that (nothing was sent)")
        if not stored:
            return lines
        if (yield from TmclOperations(state).busy()):
            raise Refused(f"{who(state)}: its program runs; 128 0, 0, 0 ends it (nothing was sent)")
        sent = [(line.source, line.call) for line in stored] + [(0, OVER)] * (len(stored) < MEMORY)
        done, fate = 0, "cut off"
        try:
            yield from TmclExchange(state).store(*_line(state, TmclCall(Command.DOWNLOAD)), by_hand=False)
            for source, call in sent:
                progress(done, len(stored))
                try:
                    yield from TmclExchange(state).store(*_line(state, call))
                except DriveError as error:
                    error.args = (f"line {source}: {error}" if source else str(error),)
                    raise
                done += bool(source)
            yield from TmclExchange(state).store(*_line(state, TmclCall(Command.END_DOWNLOAD)))
            fate = "done"
        except DriveError as error:
            fate = "cut off" if isinstance(error, Stopped) else "told"  # the caller of a stopped one may have gone
            error.args = (f"{error}; {_incomplete(state, done, len(stored))}",)
            raise
        finally:
            if fate == "cut off":
                state.note(f"{who(state)}: the download was cut off: {_incomplete(state, done, len(stored))}")
            if state.programming:
                yield from _leave(state)
        progress(len(stored), len(stored))
        if rest := [line.at for line in held.lines if line.at > len(stored)] if held is not None else []:
            count = counted(len(rest), "line")
            state.remark(
                f"{who(state)}: {count} from address {rest[0]} on stay as they were: the file does not reach them"
            )
        return lines

    def differences(self, lines: Sequence[SourceLine], held: Held, before: Held | None = None) -> Sequence[Difference]:
        """Compare the lines of a file with the stored ones, and see that an empty line follows them."""
        stored, there = program_file.compiled(lines), {line.at: line.text for line in held.lines}
        differences = [
            Difference(line.source, text, line.at, there.get(line.at, spelled(OVER)))
            for line in stored
            if (text := spelled(line.call)) != there.get(line.at, spelled(OVER))
        ]
        if stored and (more := there.get(len(stored))) is not None:
            differences.append(Difference(0, "", len(stored), more))
        return tuple(differences)

    def start(self, lines: Sequence[SourceLine], label: str) -> str:
        made = program_file.assembled(lines)
        address = made.labels.get(label.upper(), whole(label, 0, max(len(made.lines) - 1, 0)))
        if address is None or address >= len(made.lines):
            raise Diagnostic(
                f"no label {label} in the file", "", f"labels: {', '.join(made.labels) or 'none; 0 is its first line'}"
            )
        return program_file.run_at(address)

    def annotated(self, text: str, held: Held) -> Sequence[str]:
        """The lines of a file, each with its address where it gives a line of the memory."""
        lines = lines_of_text(text)
        made = program_file.assembled(numbered(lines))
        places = {line.source: line.at for line in made.lines}
        width = len(str(len(made.lines)))
        return tuple(f"{places.get(number, ''):>{width}}  {line}".rstrip() for number, line in enumerate(lines, 1))


# Observation


NO_PLACE = "does not report the address of its next line (global parameter 130)"
NO_BREAK = "TMCL has no break points: /break now halts a program; program test --break has them"


def address_of(place: str) -> int:
    """The address that a place names. Raises Diagnostic."""
    address = whole(place or "0", 0, MEMORY - 1)
    if address is None:
        raise Diagnostic(f"no line {place}", "", f"valid: an address, 0 to {MEMORY - 1}; /list shows them")
    return address


def counter(state: TmclState) -> Procedure[int | None]:
    """The address of the next line; None where the module does not tell."""
    try:
        return (yield from read(state, TmclCall(Command.GGP, Global.PROGRAM_COUNTER)))
    except Refused as refused:
        if refused.code in LACKS:
            return None
        raise


def watched_call(name: str) -> TmclCall:
    """The command that reads a watched name: `A`, `X`, a user variable `V5`, or an axis parameter `AP1`, `AP1/2`."""
    registers = {"A": 2, "X": 3}
    if name in registers:
        return TmclCall(Command.PROGRAM_STATUS, registers[name])
    if name.startswith("V") and (number := whole(name[1:], 0, 255)) is not None:
        return TmclCall(Command.GGP, number, 2)
    if (call := parameter(name)) is not None:
        if call.changed_by_reading:
            raise Diagnostic(f"{name} cannot be watched: reading it clears it", "", f"{call} reads it once")
        return call
    raise Diagnostic(f"{name} cannot be watched", "", "valid: A, X, V0 to V255, AP and a parameter, as AP1 or AP1/2")


class TmclDebugging(Debugging):
    """Observes the program of a TMCL module."""

    state: TmclState

    no_break = NO_BREAK

    def listing(self) -> Procedure[tuple[Stored, ...]]:
        return (yield from TmclPrograms(self.state).read((), lambda done, total: None)).lines

    def entry(self, rows: Sequence[Stored]) -> str:
        return "0"

    def address(self, rows: Sequence[Stored], place: str) -> int | None:
        return whole(place, 0, MEMORY - 1)

    def idle(self, place: str, neighbours: Neighbours | None) -> Procedure[None]:
        address = address_of(place)
        if neighbours is None and address:
            raise Inexpressible(
                f"{who(self.state)}: single step begins with line 0: no command sets another; nothing was sent"
            )
        if (yield from TmclOperations(self.state).busy()):
            raise Refused(f"{who(self.state)}: its program runs already; not started; 128 0, 0, 0 ends it")

    def trace(self, place: str) -> Procedure[None]:
        self.state.program_halted(False)
        yield from TmclOperations(self.state).perform(program_file.run_at(address_of(place)))

    def begin(self, place: str) -> Procedure[None]:
        yield from TmclOperations(self.state).perform("131 0, 0, 0")
        self.state.program_halted(True)

    def waits(self, place: str, last: Stored | None) -> Procedure[None]:
        if not self.state.halted or (yield from TmclOperations(self.state).busy()):
            raise Refused(f"{who(self.state)}: its program is not known to be halted; nothing was sent")

    def forget(self) -> None:
        self.state.program_halted(False)

    def step(self, rows: Sequence[Stored]) -> Procedure[Stepped]:
        """Execute the next line; a program that comes to STOP, or to its end, is over."""
        state = self.state
        at = yield from counter(state)
        if at is None:
            raise Inexpressible(f"{who(state)} {NO_PLACE}; nothing was sent")
        row = next((each for each in rows if each.at == at), Stored(at, ""))
        yield from TmclOperations(state).perform("130 0, 0, 0")
        state.program_halted(bool(row.text) and row.text != ProgramWord.STOP.name)
        return Stepped(row)

    def go_on(self, place: str) -> Procedure[None]:
        self.state.program_halted(False)
        yield from TmclOperations(self.state).perform("129 0, 0, 0")

    def look(self, place: str) -> Procedure[Look]:
        runs = yield from TmclOperations(self.state).busy()
        self.state.program_halted(self.state.halted and not runs)
        if not runs and not self.state.halted:
            return Look(False)
        return Look(True, self.state.halted, (yield from counter(self.state)))

    def break_now(self, place: str) -> Procedure[None]:
        if not (yield from TmclOperations(self.state).busy()):
            raise Refused(f"{who(self.state)}: its program does not run; nothing was sent")
        yield from TmclOperations(self.state).perform("128 0, 0, 0")
        self.state.program_halted(True)

    def names(self, names: Sequence[str]) -> None:
        for name in names:
            watched_call(name)

    def values(self, names: Sequence[str]) -> Procedure[Mapping[str, str]]:
        values = {}
        for name in names:
            try:
                values[name] = str((yield from read(self.state, watched_call(name))))
            except Refused as refused:
                if refused.code not in LACKS:
                    raise
        return values
