"""The programs in a controller: lines `SA0` to `SA1274`, read and written one by one, files of them, and observation.

The compiler gives a line its meaning; here a line is a short token. The host reads back every line that it writes,
since nothing else proves that the flash took it. A controller neither traces nor steps, and has no break points: SR
starts, pauses and continues a program, SASTAT reports it, and the host reads its program counter SPC now and then,
which is the address of a compiled line. (PMX-2ED-SA manual 7.19.1 to 7.19.3, table 9.0.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, NoAnswer, Refused, Stopped
from multidrop.base.files import SourceLine, lines_of_text
from multidrop.base.text import whole
from multidrop.dialects.codec import End, Procedure
from multidrop.dialects.debugging import Debugging, Look, Neighbours
from multidrop.dialects.family import Printed, Programs, Progress
from multidrop.dialects.program_files import Difference, Held, Stored
from multidrop.dialects.state import who
from multidrop.families.pmx.host.codec import PmxState
from multidrop.families.pmx.host.operations import (
    OK,
    PROGRAMS,
    PmxExchange,
    PmxOperations,
    number,
)
from multidrop.families.pmx.manual import program_file, script_checker
from multidrop.families.pmx.manual.program_file import RAW, Undecodable
from multidrop.families.pmx.manual.script_compiler import EMPTY, ERASED, MEMORY_LINES
from multidrop.families.pmx.manual.script_parser import VARIABLES
from multidrop.families.pmx.manual.table import PROBE, PROBED, lookup

RUNS = (1, 2)
"""The states of a program that runs or waits to go on."""
BLANK = 16
"""Number of empty lines in a row that mark the end of the stored programs."""


def read_line(state: PmxState, at: int) -> Procedure[str]:
    reply = yield from PmxExchange(state).answered(state.codec.request(state.address, f"SA{at}"))
    return reply.text.strip()


def _incomplete(state: PmxState, done: int, total: int) -> str:
    if done == total:
        return f"all {total} lines are stored; lines of a longer program may be left behind them"
    return f"{done} of {total} lines are stored: the program in {who(state)} is incomplete"


def _simulator_only(state: PmxState) -> Procedure[None]:
    """Probe with a command that only our simulator knows; a unit replies `?`, as to any unknown command."""
    reply = yield state.codec.request(state.address, PROBE)
    if reply.end is End.REFUSED or (reply.end is End.DONE and reply.text != PROBED):
        raise Refused(
            f"{who(state)}: nothing was written: the codes of this controller's registers are not public, so A-SCRIPT "
            "is compiled for the simulator only; a unit takes compiled lines (SA0=...) that came from one"
        )
    if reply.end is not End.DONE:
        state.reply_outstanding()
        raise NoAnswer(f"{who(state)} does not reply; nothing was written")


def _erase_behind(state: PmxState, at: int) -> Procedure[None]:
    """Erase the rest of a longer program after this one."""
    blank = 0
    while at < MEMORY_LINES and blank < BLANK:
        if (yield from read_line(state, at)) in EMPTY:
            blank += 1
        else:
            blank = 0
            yield from _write(state, 0, at, ERASED)
        at += 1


def _write(state: PmxState, source: int, at: int, token: str) -> Procedure[None]:
    try:
        yield from PmxExchange(state).answered(state.codec.request(state.address, f"SA{at}={token}"))
    except Refused as refused:
        raise Refused(f"line {source}: {refused}") from None
    written = yield from read_line(state, at)
    if written != token:
        raise NoAnswer(f"line {source}: {who(state)} has {written!r} at SA{at} after {token!r} was written")


def _command(state: PmxState, text: str) -> Procedure[None]:
    reply = yield from PmxExchange(state).answered(state.codec.request(state.address, text))
    if reply.text != OK:
        raise Refused(f"{who(state)} replied {reply.text!r} to '{text}'")


class PmxPrograms(Programs):
    """The programs in a PMX."""

    state: PmxState

    keeper = "controller"

    def listing(self, place: str = "") -> Printed:
        """List `SAn=TOKEN` for every stored line, from a number on."""
        lines: list[str] = []
        blank = 0
        for at in range(whole(place, 0, MEMORY_LINES) or 0, MEMORY_LINES):
            token = yield from read_line(self.state, at)
            blank = blank + 1 if token in EMPTY else 0
            lines.append(f"SA{at}={token}")
            if blank == BLANK:
                break
        return tuple(lines[: len(lines) - blank])

    def readable(self, held: Held) -> Sequence[str]:
        """Return the program as A-SCRIPT, or as compiled lines with a remark where a unit's own compiler made them."""
        listed = tuple(f"SA{line.at}={line.text}" for line in held.lines)
        try:
            return tuple(program_file.readable(listed))
        except Undecodable as problem:
            return (f"; compiled lines, as they are stored: {problem}", *listed)

    def read(self, lines: Sequence[SourceLine], progress: Progress) -> Procedure[Held]:
        """Read the stored lines, at least as far as these lines of a file go; then the variables, for a backup."""
        last = max((at for _, at, _ in program_file.compiled(lines)), default=-1) if lines else -1
        more = VARIABLES if lines else 0
        stored: list[Stored] = []
        blank = at = 0
        while at < MEMORY_LINES and (blank < BLANK or at <= last):
            progress(at, max(at + BLANK - blank, last + 1) + more)
            token = yield from read_line(self.state, at)
            blank = blank + 1 if token in EMPTY else 0
            stored += [] if token in EMPTY else [Stored(at, token)]
            at += 1
        names = []
        for variable in range(more):
            progress(at + variable, at + more)
            names.append(f"V{variable} = {(yield from number(self.state, f'V{variable}'))}")
        return Held(tuple(stored), tuple(names))

    def file(self, held: Held, raw: bool) -> Sequence[str]:
        return tuple(f"SA{line.at}={line.text}" for line in held.lines) if raw else self.readable(held)

    def size(self, lines: Sequence[SourceLine]) -> int:
        return len(program_file.compiled(lines))

    def end(self) -> Procedure[bool]:
        """End both programs, and slow the motors down that they have started; return whether a program ran.

        Raises Refused where a motor moves without a program.
        """
        lines = []
        for program in PROGRAMS:
            if (yield from number(self.state, f"SASTAT{program}")) in RUNS:
                lines.append(f"SR{program}=0")
        moves = yield from PmxOperations(self.state).moving()
        if not lines and moves:
            raise Refused(f"{who(self.state)} moves: stop it first (nothing was written)")
        for text in lines:
            yield from _command(self.state, text)
        if lines and (yield from PmxOperations(self.state).moving()):
            yield from _command(self.state, "STOP")
        return bool(lines)

    def download(
        self, lines: Sequence[SourceLine], held: Held | None, progress: Progress
    ) -> Procedure[Sequence[SourceLine]]:
        """Write a program and read back each line. Both programs must be idle. Raises Refused, NoAnswer or Diagnostic.

        Compiled lines (`SAn=TOKEN`, or `TOKEN` alone) are written unchanged. A-SCRIPT is compiled, and only our
        simulator can run the result: any other controller is refused before anything is written. It alone erases what
        follows it.
        """
        state = self.state
        raw = program_file.is_raw(lines)
        stored = program_file.compiled(lines)
        if not raw:
            yield from _simulator_only(state)
        for program in PROGRAMS:
            if (yield from number(state, f"SASTAT{program}")) in RUNS:
                raise Refused(f"{who(state)}: program {program} runs; SR{program}=0 ends it (nothing was written)")
        done, reported = 0, False
        try:
            for source, at, token in stored:
                yield from _write(state, source, at, token)
                done += 1
                progress(done, len(stored))
            if not raw:
                yield from _erase_behind(state, len(stored))
            reported = True
        except DriveError as error:
            reported = not isinstance(error, Stopped)  # the caller of a stopped one may have gone
            error.args = (f"{error}; {_incomplete(state, done, len(stored))}",)
            raise
        finally:
            if not reported:
                state.note(f"{who(state)}: the download was cut off: {_incomplete(state, done, len(stored))}")
        return lines

    def differences(self, lines: Sequence[SourceLine], held: Held, before: Held | None = None) -> Sequence[Difference]:
        """Compare the compiled lines of a file with the stored ones; a script is all that the controller holds."""
        there = dict(held.lines)
        stored = program_file.compiled(lines)
        differences = [
            Difference(source, f"SA{at}={token}", at, f"SA{at}={there.get(at, '')}")
            for source, at, token in stored
            if there.get(at, "") != token and not (token in EMPTY and at not in there)
        ]
        if not program_file.is_raw(lines):
            differences += [Difference(0, "", at, f"SA{at}={token}") for at, token in held.lines if at >= len(stored)]
        return tuple(differences)

    def start(self, lines: Sequence[SourceLine], label: str) -> str:
        marks = {token for _, _, token in program_file.compiled(lines) if token.startswith("PS")} or {"PS0"}
        if f"PS{label}" not in marks:
            hint = f"programs: {', '.join(sorted(mark[2:] for mark in marks))}"
            raise Diagnostic(f"no program {label} in the file", "", hint)
        return f"SR{label}=1"

    def annotated(self, text: str, held: Held) -> Sequence[str]:
        """Return the lines of a script: it shows no numbers of lines. Compiled lines are better read as a script."""
        return () if program_file.is_raw(program_file.read(text, "program")) else lines_of_text(text)


RUNNING, PAUSED = 1, 2
"""Values of SASTAT."""
START, PAUSE, CONTINUE = 1, 2, 3
"""Values of SR."""
NO_STEP = "a PMX has no single step: /break now pauses a program, /continue goes on"
NO_BREAK = "a PMX has no break points: /break now pauses a program; program test --break has them"


def _rows(held: tuple[Stored, ...]) -> tuple[Stored, ...]:
    try:
        script = program_file.readable(f"SA{row.at}={row.text}" for row in held)
    except Undecodable:
        script = []
    if not script:
        return held
    source = script_checker.read("\n".join(script), "program").source
    first = {line: at for at, line in reversed(list(enumerate(source)))}
    return tuple(Stored(first[line], script[line - 1]) for line in sorted(first))


def _status(state: PmxState, program: str) -> Procedure[int]:
    return (yield from number(state, f"SASTAT{_program(program)}"))


def _program(place: str) -> str:
    """The number of a program; 0 where none is named."""
    if (place or "0") not in ("0", "1"):
        raise Diagnostic(f"no program {place}", "", "valid: 0 or 1")
    return place or "0"


class PmxDebugging(Debugging):
    """Observes the programs of a PMX."""

    state: PmxState

    no_break = NO_BREAK
    no_step = NO_STEP

    def listing(self) -> Procedure[tuple[Stored, ...]]:
        """Read the compiled lines; where they can be decompiled, the statements at their first lines."""
        lines = yield from PmxPrograms(self.state).listing()
        return _rows(tuple(Stored(int(match[1]), match[2]) for line in lines if (match := RAW.fullmatch(line))))

    def rows(self, held: Held) -> Sequence[Stored]:
        return _rows(held.lines)

    def entry(self, rows: Sequence[Stored]) -> str:
        return "0"

    def address(self, rows: Sequence[Stored], place: str) -> int | None:
        return None

    def idle(self, place: str, neighbours: Neighbours | None) -> Procedure[None]:
        state = self.state
        if neighbours is None:
            raise Inexpressible(f"{who(state)}: {NO_STEP}; nothing was sent")
        if (yield from _status(state, place)) in (RUNNING, PAUSED):
            raise Refused(f"{who(state)}: program {place} runs already; not started; SR{place}=0 ends it")

    def trace(self, place: str) -> Procedure[None]:
        yield from PmxOperations(self.state).perform(f"SR{_program(place)}={START}")

    def waits(self, place: str, last: Stored | None) -> Procedure[None]:
        if (yield from _status(self.state, place)) != PAUSED:
            raise Refused(f"{who(self.state)}: program {_program(place)} is not paused; nothing was sent")

    def go_on(self, place: str) -> Procedure[None]:
        yield from PmxOperations(self.state).perform(f"SR{_program(place)}={CONTINUE}")

    def look(self, place: str) -> Procedure[Look]:
        status = yield from _status(self.state, place)
        active = status in (RUNNING, PAUSED)
        address = (yield from number(self.state, f"SPC{_program(place)}")) if active else None
        return Look(active, status == PAUSED, address)

    def break_now(self, place: str) -> Procedure[None]:
        state = self.state
        if (yield from _status(state, place)) != RUNNING:
            raise Refused(f"{who(state)}: program {_program(place)} does not run; nothing was sent")
        yield from PmxOperations(state).perform(f"SR{_program(place)}={PAUSE}")

    def names(self, names: Sequence[str]) -> None:
        for name in names:
            row = lookup(name)
            if row is None or "R" not in row.access:
                raise Diagnostic(
                    f"{name} cannot be watched: it reads no value", "", "valid: V0 to V63, PX, DI and others"
                )

    def values(self, names: Sequence[str]) -> Procedure[Mapping[str, str]]:
        values = {}
        for name in names:
            reply = yield from PmxExchange(self.state).answered(self.state.codec.request(self.state.address, name))
            values[name] = reply.text
        return values
