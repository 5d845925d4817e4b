"""Conversations in program mode: between `PG n` and `PG` the drive stores every line.

Only EM=0 shows program mode by its prompt (an address), so the host uses EM=0 as long as program mode lasts. It checks
the prompt of every line: a drive that was restarted is out of program mode and executes what it receives. After a
missing reply the host first sends an empty line, which is neither stored nor executed, and reads the prompt. (MCode
reference 5.1.98; facts of real units.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from multidrop.dialects.codec import End, Kind, Procedure, Reply, Request
from multidrop.dialects.errors import DriveError, NoAnswer, Refused
from multidrop.dialects.mcode.host import classify
from multidrop.dialects.mcode.host.before_request import before_request, find_again
from multidrop.dialects.mcode.host.exchange import answered, ends_in_program_mode, question, value
from multidrop.dialects.mcode.host.exchange import take_out as take_out
from multidrop.dialects.mcode.host.identity import set_wire
from multidrop.dialects.mcode.host.state import MCodeState, who
from multidrop.dialects.state import Owed


def enter_program(state: MCodeState, request: Request) -> Procedure[tuple[str, ...]]:
    """Send PG n in EM=0, the only mode that shows whether the drive entered program mode."""
    request = yield from before_request(state, request)
    try:
        if state.codec.em != 0:
            yield from echo_everything(state)
    except DriveError:
        yield from put_back(state)
        raise
    request = replace(request, codec=state.codec)
    state.may_be_in_program_mode()  # until the reply shows it: no other line may slip in
    try:
        reply = yield from answered(state, request)
        if not ends_in_program_mode(reply):
            raise Refused(f"{who(state)} did not go into program mode after '{request.text}'")
    except Refused:
        state.left_program_mode()
        yield from put_back(state)
        raise
    except DriveError:
        yield from take_out(state, "made sure that it is not in program mode")
        yield from put_back(state)
        raise
    state.remark(f"{who(state)}: program mode: every line is stored until PG")
    return ()


def echo_everything(state: MCodeState) -> Procedure[None]:
    """Set EM=0 for a while; `state.restore` records the previous mode and the drive before that."""
    if not state.serial:
        state.serial_read((yield from serial_number(state)))
    if state.restore is None:
        state.owes(Owed(state.codec.em, state.name, state.product, state.version, state.part, state.serial))
    yield from set_wire(state, state.codec.request(state.address, "EM=0"))


def serial_number(state: MCodeState) -> Procedure[str]:
    """Read the serial number; empty where the drive prints none, or may not know the word.

    Older products with Ethernet may not know it. A name or a checksum in use rules them out.
    """
    mode = state.codec
    if not (state.product.startswith("LM") or mode.party or mode.checksum):
        return ""
    try:
        reply = yield from answered(state, question(state, "SN", "[!-~][ -~]*"))
    except Refused:
        return ""
    if reply.end is not End.DONE:
        state.reply_lost()
        return ""
    return value(state, reply)


def restore_echo(state: MCodeState) -> Procedure[None]:
    """Restore the echo mode from before `echo_everything`."""
    if state.restore is None:
        return
    mode = state.restore.em
    asked = yield from before_request(state, state.codec.request(state.address, f"EM={mode}"))
    if state.codec.em != mode:
        yield from set_wire(state, asked)
    state.owes_nothing()


def put_back(state: MCodeState) -> Procedure[None]:
    """Restore the echo mode beside another task: a failure becomes a note.

    After a refusal the host gives up. Without a reply the echo mode stays owed.
    """
    try:
        yield from restore_echo(state)
    except DriveError as error:
        if isinstance(error, Refused):
            state.owes_nothing()
        state.note(f"{who(state)}: its echo mode may be EM=0 now: {error}")


def put_back_found(state: MCodeState, owed: Sequence[Owed]) -> Procedure[None]:
    """Restore, in this very drive only, what our last use of the port left, and report it."""
    alike = [each for each in owed if each.like(state)]
    if not alike or state.settings_unknown:
        return
    if any(each.serial for each in alike):
        state.serial_read((yield from serial_number(state)))
    mine = next((each for each in alike if each.serial == state.serial), None)
    if mine is None or state.codec.em != 0:  # another host has set it since
        return
    state.owes(mine)
    yield from put_back(state)
    if state.restore is None and state.codec.em == mine.em:
        state.note(
            f"{who(state)}: an interrupted download or program mode left EM=0; EM={mine.em} is set again; check "
            "the program in it"
        )


def program_line(state: MCodeState, request: Request) -> Procedure[tuple[str, ...]]:
    """Send a line in program mode: the drive stores it, and nothing else may be asked."""
    if (state.reply_pending or state.settings_unknown) and not classify.leaves_program(request.text):
        yield from _make_sure(state, request, "was not sent")
    reply = yield replace(request, kind=Kind.PROGRAM)
    if reply.end in (End.TIMEOUT, End.DAMAGED):
        state.reply_lost()
        raise NoAnswer(f"{who(state)}: it is not known whether '{request.text}' was stored ({reply.end.value})")
    leaving, inside = classify.leaves_program(request.text), ends_in_program_mode(reply)
    if leaving and not inside:
        yield from _left(state, reply)
    elif reply.end in (End.REFUSED, End.NAK):
        yield from _make_sure(state, request, "was refused or executed")
        raise Refused(
            f"{who(state)} refused '{request.text}' in program mode; it is not stored; after PG, PR ER says why"
        )
    elif not inside:
        yield from _left(state, reply)
        raise Refused(f"{who(state)} was not in program mode any more: '{request.text}' was executed and not stored")
    return ()


def _left(state: MCodeState, reply: Reply) -> Procedure[None]:
    state.left_program_mode()
    state.error_flag_read(reply.prompt == "?")
    yield from restore_echo(state)


def _make_sure(state: MCodeState, request: Request, fate: str) -> Procedure[None]:
    """Verify by its prompt that the drive is still in program mode. Raises NoAnswer or Refused where it is not."""
    reply = yield Request(state.address, "", Kind.PROGRAM, state.codec)
    if ends_in_program_mode(reply):
        state.synchronised()
        state.settings_confirmed()
        return
    state.reply_outstanding()
    if reply.prompt == "?":
        raise Refused(
            f"{who(state)} shows an error, and not whether it is in program mode: '{request.text}' {fate}; type PG"
        )
    if not reply.prompt:
        yield from find_again(state, request)
    state.synchronised()
    yield from _left(state, reply)
    raise Refused(f"{who(state)} is not in program mode any more: '{request.text}' {fate}")
