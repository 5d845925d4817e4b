"""What a controller holds of programs: its lines and variables; ending programs; a file compared with the lines.

A controller writes each line of a program to its flash at once. (PMX-2ED-SA manual 7.19, 7.20.)
"""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Diagnostic, Refused
from multidrop.dialects.family import Progress
from multidrop.dialects.files import SourceLine, split_lines
from multidrop.dialects.held import Difference, Held, Stored
from multidrop.dialects.pmx.host.download import BLANK, read_line
from multidrop.dialects.pmx.host.exchange import answered, number, who
from multidrop.dialects.pmx.host.operations import OK, PROGRAMS, moving
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual import program_file
from multidrop.dialects.pmx.manual.script_compiler import EMPTY, LINES
from multidrop.dialects.pmx.manual.script_words import VARIABLES

RUNS = (1, 2)
"""The states of a program that runs or waits to go on."""


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
    running = []
    for program in PROGRAMS:
        if (yield from number(state, f"SASTAT{program}")) in RUNS:
            running.append(program)
    moves = yield from moving(state)
    if not running:
        if moves:
            raise Refused(f"{who(state)} moves: stop it first (nothing was written)")
        return False
    for program in running:
        yield from _command(state, f"SR{program}=0")
    if (yield from moving(state)):
        yield from _command(state, "STOP")
    return True


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
    """Return the lines of a file: it gives variables no values."""
    return tuple(split_lines(text.removesuffix("\x1a").removesuffix("\n")))
