"""Program mode: between `PG n` and `PG` the drive stores every line, so nothing else may be said to it.

Only EM=0 shows by its prompt (an address) that a drive is in program mode, so it is used for as long as that lasts.
Every line's prompt is looked at: a drive that was restarted is not in program mode any more, and executes what it is
sent. Where an answer did not come, an empty line, which is neither stored nor executed, asks for the prompt first.
(MCode reference 5.1.98; facts of real units.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dialects.base import End, Kind, Known, Owed, Reply, Request, Talk
from dialects.errors import DriveError, NoAnswer, Refused
from dialects.mcode import kinds
from dialects.mcode.asking import answered, ends_in_program_mode, lost, mcode, who
from dialects.mcode.finding import attend, find_again
from dialects.mcode.leaving import take_out as take_out
from dialects.mcode.signs import question, value
from dialects.mcode.wiring import set_wire


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
    known.remarks.append(f"{who(known)}: program mode: every line is stored until PG")
    return ()


def echo_everything(known: Known) -> Talk[None]:
    """EM=0 for a while; `known.restore` says what it was and whose, before that is changed."""
    if not known.serial:
        known.serial = yield from serial_number(known)
    if known.restore is None:
        known.restore = Owed(mcode(known).em, known.name, known.product, known.version, known.part, known.serial)
    yield from set_wire(known, mcode(known).request(known.address, "EM=0"))


def serial_number(known: Known) -> Talk[str]:
    """What the drive says to `PR SN`; empty where it says nothing, or may not know the word.

    Of the older products those with Ethernet may not, which a name or a checksum in use rules out.
    """
    mode = mcode(known)
    if not (known.product.startswith("LM") or mode.party or mode.checksum):
        return ""
    try:
        reply = yield from answered(known, question(known, "SN", "[!-~][ -~]*"))
    except Refused:
        return ""
    if reply.end is not End.DONE:
        lost(known)
        return ""
    return value(known, reply)


def restore_echo(known: Known) -> Talk[None]:
    """Back to the echo mode that was there before `echo_everything`."""
    if known.restore is None:
        return
    mode = known.restore.em
    asked = yield from attend(known, mcode(known).request(known.address, f"EM={mode}"))
    if mcode(known).em != mode:
        yield from set_wire(known, asked)
    known.restore = None


def put_back(known: Known) -> Talk[None]:
    """The same where something else is told or done besides: what goes wrong is a note.

    What a drive refuses is given up; where it did not answer, its echo mode stays owed.
    """
    try:
        yield from restore_echo(known)
    except DriveError as error:
        if isinstance(error, Refused):
            known.restore = None
        known.notes.append(f"{who(known)}: its echo mode may be EM=0 now: {error}")


def put_back_found(known: Known, owed: Sequence[Owed]) -> Talk[None]:
    """At opening: restore what our last use of the port has left, in this very drive only, and say so."""
    alike = [each for each in owed if each.like(known)]
    if not alike or known.stale:
        return
    if any(each.serial for each in alike):
        known.serial = yield from serial_number(known)
    mine = next((each for each in alike if each.serial == known.serial), None)
    if mine is None or mcode(known).em != 0:  # somebody has set it since
        return
    known.restore = mine
    yield from put_back(known)
    if known.restore is None and mcode(known).em == mine.em:
        known.notes.append(
            f"{who(known)}: a download or program mode that was cut off had left EM=0; EM={mine.em} is back; check "
            "the program in it"
        )


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
    yield from restore_echo(known)


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
