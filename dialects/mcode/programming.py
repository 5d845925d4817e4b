"""Program mode: between `PG n` and `PG` the drive stores every line, so nothing else may be said to it.

Only EM=0 shows by its prompt (an address) that a drive is in program mode, so it is used for as long as that lasts.
(MCode reference 5.1.98; facts of real units.)
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

from dialects.base import End, Kind, Known, Request, Talk
from dialects.errors import DriveError, NoAnswer, Refused
from dialects.mcode.asking import (
    REPEATS,
    answered,
    described,
    ends_in_program_mode,
    mcode,
    print_mark,
    read_error,
    settle_accounts,
    who,
)
from dialects.mcode.wiring import adopt

if TYPE_CHECKING:
    from dialects.mcode.dialect import MCode

NOT_PROGRAMMING = 46
"""What PG on its own is refused with by a drive that is not in program mode (section 10)."""


def enter_program(known: Known, request: Request) -> Talk[tuple[str, ...]]:
    """PG n. Only EM=0 shows whether the drive went into program mode, so it is used until PG ends it."""
    yield from settle_accounts(known, request)
    if mcode(known).em != 0:
        yield from echo_everything(known)
    request = replace(request, dialect=known.dialect)
    try:
        reply = yield from answered(known, request)
        if not ends_in_program_mode(reply):
            raise Refused(f"{who(known)} did not go into program mode after '{request.text}'")
    except Refused:
        yield from restore_echo(known)
        raise
    except DriveError:
        yield from take_out(known, "made sure that it is not in program mode")
        yield from restore_echo(known)
        raise
    known.programming = True
    known.notes.append(f"{who(known)}: program mode: every line is stored until PG")
    return ()


def echo_everything(known: Known) -> Talk[None]:
    """EM=0 for a while; `known.restore` keeps what it was."""
    known.restore = known.dialect
    asked = mcode(known).request(known.address, "EM=0")
    reply = yield from answered(known, asked)
    yield from adopt(known, asked, reply)


def restore_echo(known: Known) -> Talk[None]:
    """Back to the echo mode that was there before `echo_everything`."""
    if known.restore is None:
        return
    mode = cast("MCode", known.restore).em
    known.restore = None
    asked = mcode(known).request(known.address, f"EM={mode}")
    yield from settle_accounts(known, asked)
    reply = yield from answered(known, asked)
    yield from adopt(known, asked, reply)


def program_line(known: Known, request: Request) -> Talk[tuple[str, ...]]:
    """A line while the drive is in program mode: it is stored, and nothing else may be asked."""
    request = replace(request, kind=Kind.PROGRAM)
    reply = yield request
    leaving = request.text.upper() == "PG"
    if reply.end in (End.TIMEOUT, End.DAMAGED):
        raise NoAnswer(f"{who(known)}: it is not known whether '{request.text}' was stored ({reply.end.value})")
    refusal = reply.end in (End.REFUSED, End.NAK)
    if leaving and not ends_in_program_mode(reply):
        known.programming = False
        known.error = reply.prompt == "?"
        yield from restore_echo(known)
    elif refusal:
        raise Refused(
            f"{who(known)} refused '{request.text}' in program mode; it is not stored; after PG, PR ER says why"
        )
    return ()


def leave_program(known: Known) -> Talk[int]:
    """PG until a prompt, an error or a printed mark shows that it is out; storing a PG too many does no harm.

    Returns the error that was met on the way and is cleared by that, 0 where there was none.
    """
    for _ in range(2 * REPEATS):
        request = replace(mcode(known).request(known.address, "PG"), kind=Kind.PROGRAM)
        reply = yield request
        code: int | None = 0
        if ends_in_program_mode(reply):
            continue
        if reply.end in (End.DONE, End.SILENT):
            known.programming = False
        elif reply.end in (End.REFUSED, End.NAK):
            code = yield from read_error(known)  # None: stored, so still in; 0: the frame was damaged
            known.programming = not code
        else:
            known.programming = (yield from print_mark(known, request.priority)) is None
        if not known.programming:
            return code if code and code != NOT_PROGRAMMING else 0
    raise NoAnswer(f"{who(known)} could not be taken out of program mode: type PG, then open it again")


def take_out(known: Known, remark: str) -> Talk[None]:
    """Leave program mode and say so, with the error that stood there."""
    code = yield from leave_program(known)
    error = f"; {described(code, known)}, now cleared" if code else ""
    known.notes.append(f"{who(known)}: {remark}{error}")
