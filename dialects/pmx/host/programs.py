"""The programs in a controller: lines `SA0` to `SA1274`, read and written one by one, and files of them.

The compiler gives a line its meaning; here a line is a short token. The host reads back every line that it writes,
since nothing else proves that the flash took it. (PMX-2ED-SA manual 7.19.1, table 9.0.)
"""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.codec import End, Procedure
from multidrop.dialects.errors import Diagnostic, DriveError, NoAnswer, Refused, Stopped
from multidrop.dialects.family import Programs, Progress
from multidrop.dialects.files import SourceLine, split_lines
from multidrop.dialects.pmx.host.codec import PmxState
from multidrop.dialects.pmx.host.exchange import answered, number, who
from multidrop.dialects.pmx.host.operations import OK, PROGRAMS, moving
from multidrop.dialects.pmx.manual import program_file
from multidrop.dialects.pmx.manual.program_file import Undecodable
from multidrop.dialects.pmx.manual.script_compiler import EMPTY, ERASED, LINES
from multidrop.dialects.pmx.manual.script_words import VARIABLES
from multidrop.dialects.pmx.manual.table import PROBE, PROBED
from multidrop.dialects.program_files import Difference, Held, Stored
from multidrop.dialects.text import whole

RUNS = (1, 2)
"""The states of a program that runs or waits to go on."""
BLANK = 16
"""Number of empty lines in a row that mark the end of the stored programs."""


def listing(state: PmxState, start: str = "") -> Procedure[tuple[str, ...]]:
    """List `SAn=TOKEN` for every stored line, from a number on."""
    found: list[str] = []
    blank = 0
    for at in range(whole(start, 0, LINES) or 0, LINES):
        token = yield from read_line(state, at)
        blank = blank + 1 if token in EMPTY else 0
        found.append(f"SA{at}={token}")
        if blank == BLANK:
            break
    return tuple(found[: len(found) - blank])


def read_line(state: PmxState, at: int) -> Procedure[str]:
    reply = yield from answered(state, state.codec.request(state.address, f"SA{at}"))
    return reply.text.strip()


def download(
    state: PmxState,
    lines: Sequence[SourceLine],
    held: Held | None,  # noqa: ARG001
    progress: Progress,
) -> Procedure[Sequence[SourceLine]]:
    """Write a program and read back each line. Both programs must be idle. Raises Refused, NoAnswer or Diagnostic.

    Compiled lines (`SAn=TOKEN`, or `TOKEN` alone) are written unchanged. A-SCRIPT is compiled, and only our simulator
    can run the result: any other controller is refused before anything is written. It alone erases what follows it.
    """
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
    while at < LINES and blank < BLANK:
        if (yield from read_line(state, at)) in EMPTY:
            blank += 1
        else:
            blank = 0
            yield from _write(state, 0, at, ERASED)
        at += 1


def _write(state: PmxState, source: int, at: int, token: str) -> Procedure[None]:
    try:
        yield from answered(state, state.codec.request(state.address, f"SA{at}={token}"))
    except Refused as refused:
        raise Refused(f"line {source}: {refused}") from None
    written = yield from read_line(state, at)
    if written != token:
        raise NoAnswer(f"line {source}: {who(state)} has {written!r} at SA{at} after {token!r} was written")


def read(state: PmxState, lines: Sequence[SourceLine], progress: Progress) -> Procedure[Held]:
    """Read the stored lines, at least as far as these lines of a file go; then the variables, for a backup of them."""
    last = max((at for _, at, _ in program_file.compiled(lines)), default=-1) if lines else -1
    more = VARIABLES if lines else 0
    found: list[Stored] = []
    blank = at = 0
    while at < LINES and (blank < BLANK or at <= last):
        progress(at, max(at + BLANK - blank, last + 1) + more)
        token = yield from read_line(state, at)
        blank = blank + 1 if token in EMPTY else 0
        found += [] if token in EMPTY else [Stored(at, token)]
        at += 1
    names = []
    for variable in range(more):
        progress(at + variable, at + more)
        names.append(f"V{variable} = {(yield from number(state, f'V{variable}'))}")
    return Held(tuple(found), tuple(names))


def end(state: PmxState) -> Procedure[bool]:
    """End both programs, and slow the motors down that they have started; return whether a program ran.

    Raises Refused where a motor moves without a program.
    """
    lines = []
    for program in PROGRAMS:
        if (yield from number(state, f"SASTAT{program}")) in RUNS:
            lines.append(f"SR{program}=0")
    moves = yield from moving(state)
    if not lines and moves:
        raise Refused(f"{who(state)} moves: stop it first (nothing was written)")
    for text in lines:
        yield from _command(state, text)
    if lines and (yield from moving(state)):
        yield from _command(state, "STOP")
    return bool(lines)


def _command(state: PmxState, text: str) -> Procedure[None]:
    reply = yield from answered(state, state.codec.request(state.address, text))
    if reply.text != OK:
        raise Refused(f"{who(state)} replied {reply.text!r} to '{text}'")


def differences(
    state: PmxState,  # noqa: ARG001
    lines: Sequence[SourceLine],
    held: Held,
    before: Held | None = None,  # noqa: ARG001
) -> tuple[Difference, ...]:
    """Compare the compiled lines of a file with the stored ones; a script is all that the controller holds."""
    there = dict(held.lines)
    stored = program_file.compiled(lines)
    found = [
        Difference(source, f"SA{at}={token}", at, f"SA{at}={there.get(at, '')}")
        for source, at, token in stored
        if there.get(at, "") != token and not (token in EMPTY and at not in there)
    ]
    if not program_file.is_raw(lines):
        found += [Difference(0, "", at, f"SA{at}={token}") for at, token in held.lines if at >= len(stored)]
    return tuple(found)


def to_send(state: PmxState, lines: Sequence[SourceLine], held: Held) -> Procedure[str]:
    """Return why a file must be sent; empty where the controller holds its lines."""
    yield from ()
    found = differences(state, lines, held)
    if not found:
        return ""
    return f"line {found[0].number} differs" if found[0].number else "the controller holds more lines"


def start(lines: Sequence[SourceLine], label: str) -> str:
    """Return the line that starts a program by its number. Raises Diagnostic where the file has no such program."""
    marks = {token for _, _, token in program_file.compiled(lines) if token.startswith("PS")} or {"PS0"}
    if f"PS{label}" not in marks:
        hint = f"programs: {', '.join(sorted(mark[2:] for mark in marks))}"
        raise Diagnostic(f"no program {label} in the file", "", hint)
    return f"SR{label}=1"


def annotated(text: str, held: Held) -> tuple[str, ...]:
    """Return the lines of a script: it shows no numbers of lines. Compiled lines are better read as a script."""
    made = refreshed(text, held)
    return () if program_file.is_raw(program_file.read(text, "program")) else made


def refreshed(text: str, _: Held) -> tuple[str, ...]:
    return tuple(split_lines(text.removesuffix("\x1a").removesuffix("\n")))


def readable(held: Held) -> tuple[str, ...]:
    """Return the program as A-SCRIPT, or as compiled lines with a remark where a unit's own compiler made them."""
    listed = tuple(f"SA{line.at}={line.text}" for line in held.lines)
    try:
        return tuple(program_file.readable(listed))
    except Undecodable as problem:
        return (f"; compiled lines, as they are stored: {problem}", *listed)


def upload(state: PmxState, raw: bool) -> Procedure[tuple[str, ...]]:
    """Return a file that can be downloaded: A-SCRIPT, or compiled lines (`raw`, or without A-SCRIPT)."""
    held = yield from read(state, (), lambda done, total: None)
    held.check_program(who(state))
    return file_of(state, held, raw)


def file_of(_: PmxState, held: Held, raw: bool) -> tuple[str, ...]:
    """Return the lines of a file that reproduces what a controller holds."""
    return tuple(f"SA{line.at}={line.text}" for line in held.lines) if raw else readable(held)


PROGRAM_FILES: Programs[PmxState] = Programs(
    listing=listing,
    readable=readable,
    upload=upload,
    read=read,
    file=file_of,
    executed=lambda lines: (),
    size=lambda lines: len(program_file.compiled(lines)),
    end=end,
    download=download,
    differences=differences,
    to_send=to_send,
    start=start,
    refreshed=refreshed,
    annotated=annotated,
)
