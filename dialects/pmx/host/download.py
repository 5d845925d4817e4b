"""Compiled programs in a controller: lines `SA0` to `SA1274`, read and written one by one.

The compiler gives a line its meaning; here a line is a short token. The host reads back every line that it writes,
since nothing else proves that the flash took it. (PMX-2ED-SA manual 7.19.1, table 9.0.)
"""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.codec import End, Procedure
from multidrop.dialects.errors import DriveError, NoAnswer, Refused, Stopped
from multidrop.dialects.family import Progress
from multidrop.dialects.files import SourceLine
from multidrop.dialects.held import Held
from multidrop.dialects.numbers import whole
from multidrop.dialects.pmx.host.exchange import answered, number, who
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual import program_file
from multidrop.dialects.pmx.manual.script_compiler import EMPTY, ERASED, LINES
from multidrop.dialects.pmx.manual.table import PROBE, PROBED

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
    """Read one stored line."""
    request = state.codec.request(state.address, f"SA{at}")
    reply = yield from answered(state, request)
    return reply.text.strip()


def download(
    state: PmxState,
    lines: Sequence[SourceLine],
    held: Held | None,  # noqa: ARG001
    progress: Progress,
) -> Procedure[Sequence[SourceLine]]:
    """Write a program and read back each line. Both programs must be idle. Raises Refused, NoAnswer or Diagnostic.

    Compiled lines (`SAn=TOKEN`, or `TOKEN` alone) are written unchanged. A-SCRIPT is compiled, and only our simulator
    can run the result: any other controller is refused before anything is written.
    """
    raw = program_file.is_raw(lines)
    stored = program_file.compiled(lines)
    if not raw:
        yield from _simulator_only(state)
    for program in (0, 1):
        if (yield from number(state, f"SASTAT{program}")) in (1, 2):
            raise Refused(f"{who(state)}: program {program} runs; SR{program}=0 ends it (nothing was written)")
    yield from _write_all(state, stored, progress, alone=not raw)
    return lines


def _write_all(
    state: PmxState, stored: Sequence[tuple[int, int, str]], progress: Progress, alone: bool
) -> Procedure[None]:
    """Write the lines, and erase what follows them if they are `alone`; say what is stored if that ends early."""
    done, reported = 0, False
    try:
        for source, at, token in stored:
            yield from _write(state, source, at, token)
            done += 1
            progress(done, len(stored))
        if alone:
            yield from _erase_behind(state, len(stored))
        reported = True
    except DriveError as error:
        reported = not isinstance(error, Stopped)  # the caller of a stopped one may have gone
        error.args = (f"{error}; {_incomplete(state, done, len(stored))}",)
        raise
    finally:
        if not reported:
            state.note(f"{who(state)}: the download was cut off: {_incomplete(state, done, len(stored))}")


def _incomplete(state: PmxState, done: int, total: int) -> str:
    """Describe what is stored after a download that ended early."""
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
    request = state.codec.request(state.address, f"SA{at}={token}")
    try:
        yield from answered(state, request)
    except Refused as refused:
        raise Refused(f"line {source}: {refused}") from None
    written = yield from read_line(state, at)
    if written != token:
        raise NoAnswer(f"line {source}: {who(state)} has {written!r} at SA{at} after {token!r} was written")
