"""Program mode: between `PG n` and `PG` the drive stores every line, so nothing else may be said to it.

Only EM=0 shows by its prompt (an address) that a drive is in program mode, so it is used for as long as that lasts.
Every line's prompt is looked at: a drive that was restarted is not in program mode any more, and executes what it is
sent. Where an answer did not come, an empty line, which is neither stored nor executed, asks for the prompt first.
(MCode reference 5.1.98; facts of real units.)
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

from dialects.base import End, Kind, Known, Reply, Request, Talk
from dialects.errors import DriveError, NoAnswer, Refused
from dialects.mcode import kinds
from dialects.mcode.asking import answered, ends_in_program_mode, lost, mcode, who
from dialects.mcode.finding import attend, find_again
from dialects.mcode.leaving import take_out as take_out
from dialects.mcode.wiring import set_wire

if TYPE_CHECKING:
    from dialects.mcode.dialect import MCode


def enter_program(known: Known, request: Request) -> Talk[tuple[str, ...]]:
    """PG n. Only EM=0 shows whether the drive went into program mode, so it is used until PG ends it."""
    request = yield from attend(known, request)
    try:
        if mcode(known).em != 0:
            yield from echo_everything(known)
    except DriveError:
        yield from put_back(known)
        raise
    request = replace(request, dialect=known.dialect)
    known.programming = True  # until the answer tells: nothing may slip in between
    try:
        reply = yield from answered(known, request)
        if not ends_in_program_mode(reply):
            raise Refused(f"{who(known)} did not go into program mode after '{request.text}'")
    except Refused:
        known.programming = False
        yield from put_back(known)
        raise
    except DriveError:
        yield from take_out(known, "made sure that it is not in program mode")
        yield from put_back(known)
        raise
    known.notes.append(f"{who(known)}: program mode: every line is stored until PG")
    return ()


def echo_everything(known: Known) -> Talk[None]:
    """EM=0 for a while; `known.restore` keeps what it was."""
    known.restore = known.dialect
    yield from set_wire(known, mcode(known).request(known.address, "EM=0"))


def restore_echo(known: Known) -> Talk[None]:
    """Back to the echo mode that was there before `echo_everything`."""
    if known.restore is None:
        return
    mode = cast("MCode", known.restore).em
    asked = yield from attend(known, mcode(known).request(known.address, f"EM={mode}"))
    if mcode(known).em != mode:
        yield from set_wire(known, asked)
    known.restore = None


def put_back(known: Known) -> Talk[None]:
    """The same after something else went wrong, which is what is told; this is a note."""
    try:
        yield from restore_echo(known)
    except DriveError as error:
        known.notes.append(f"{who(known)}: its echo mode may be EM=0 now: {error}")
    finally:
        known.restore = None


def program_line(known: Known, request: Request) -> Talk[tuple[str, ...]]:
    """A line while the drive is in program mode: it is stored, and nothing else may be asked."""
    if (known.unsure or known.stale) and not kinds.leaves_program(request.text):
        yield from _make_sure(known, request, "was not sent")
    reply = yield replace(request, kind=Kind.PROGRAM)
    if reply.end in (End.TIMEOUT, End.DAMAGED):
        lost(known)
        raise NoAnswer(f"{who(known)}: it is not known whether '{request.text}' was stored ({reply.end.value})")
    leaving, inside = kinds.leaves_program(request.text), ends_in_program_mode(reply)
    if leaving and not inside:
        yield from _left(known, reply)
    elif reply.end in (End.REFUSED, End.NAK):
        yield from _make_sure(known, request, "was refused or executed")
        raise Refused(
            f"{who(known)} refused '{request.text}' in program mode; it is not stored; after PG, PR ER says why"
        )
    elif not inside:
        yield from _left(known, reply)
        raise Refused(f"{who(known)} was not in program mode any more: '{request.text}' was executed and not stored")
    return ()


def _left(known: Known, reply: Reply) -> Talk[None]:
    known.programming = False
    known.error = reply.prompt == "?"
    try:
        yield from restore_echo(known)
    finally:
        known.restore = None


def _make_sure(known: Known, request: Request, fate: str) -> Talk[None]:
    """See by its prompt that the drive is still in program mode. Raises NoAnswer or Refused where it is not."""
    reply = yield Request(known.address, "", Kind.PROGRAM, known.dialect)
    if ends_in_program_mode(reply):
        known.unsure = known.stale = False
        return
    known.unsure = True
    if reply.prompt == "?":
        raise Refused(
            f"{who(known)} shows an error, and not whether it is in program mode: '{request.text}' {fate}; say PG"
        )
    if not reply.prompt:
        yield from find_again(known, request)
    known.unsure = False
    yield from _left(known, reply)
    raise Refused(f"{who(known)} is not in program mode any more: '{request.text}' {fate}")
