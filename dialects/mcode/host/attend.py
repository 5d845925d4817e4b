"""Before each request: what an earlier request left, and a drive that is not confirmed yet.

Theory of operation. A drive whose settings may have changed prints them before the next request. A drive may be only
expected at a place, by the user's hints or from last time. It first prints what it is and how it is set. Where that
does not fit, the host looks for it in the other place and reports what is different. Only then it sends the request.
"""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import End, Kind, Procedure, Request
from multidrop.dialects.errors import NoAnswer
from multidrop.dialects.mcode.host.exchange import read_error, synchronise
from multidrop.dialects.mcode.host.identity import find, find_in_text
from multidrop.dialects.mcode.host.resync import activate_party, look_in
from multidrop.dialects.mcode.host.signatures import question, value
from multidrop.dialects.mcode.host.state import MCodeState, Place
from multidrop.dialects.mcode.host.wording import described, who
from multidrop.dialects.state import Remembered


def attend(state: MCodeState, request: Request) -> Procedure[Request]:
    """Clear what earlier requests left, so that it is not taken for the outcome of this request.

    Returns the request in the drive's present form. Raises NoAnswer where the request was not sent.
    """
    if state.unconfirmed is not None:
        yield from confirm_drive(state, request.text, "was not sent")
    elif state.settings_unknown:
        yield from find_again(state, request)
    elif state.reply_pending:
        if not (yield from synchronise(state, request.priority)):
            yield from find_again(state, request)
        state.synchronised()
    if request.kind is not Kind.PRINT:
        yield from _old_error(state, request)
    if request.codec == state.codec and request.address == state.address:
        return request
    renewed = state.codec.request(state.address, request.text)
    return replace(renewed, kind=request.kind, priority=request.priority)


def confirm_drive(state: MCodeState, text: str, fate: str) -> Procedure[None]:
    """Read what an expected drive is and how it is set, and report differences. Raises NoAnswer where it is silent.

    `text`: the line that waits for it; `fate`: what has become of that line.
    """
    expected = state.unconfirmed
    assert expected is not None
    state.sought()
    found = yield from (find(state, expected.place) if expected.stated else _find_anywhere(state, expected.place))
    if not found:
        state.settings_may_have_changed()
        raise NoAnswer(f"{who(state)} does not reply: '{text}' {fate}")
    if expected.last is not None:
        _compare(state, expected.last)


def _find_anywhere(state: MCodeState, place: Place) -> Procedure[bool]:
    """Look for a drive where it was last time, then in the other place: party mode, or none."""
    name = state.name or state.address
    if place.party:
        alone = Place(False, "")
        return (yield from find_in_text(state, place)) or (yield from find(state, alone))
    if (yield from find(state, place)):
        return True
    yield from activate_party(state.codec)
    return bool(name) and (yield from find(state, Place(True, name)))


def _compare(state: MCodeState, last: Remembered) -> None:
    """Report another drive than last time's, or other settings."""
    both = (
        ("serial number", last.serial, state.serial),
        ("product", last.product, state.product),
        ("version", last.version, state.version),
    )
    changed = [f"{word} {then} then, {now} now" for word, then, now in both if then and now and then != now]
    codec = state.codec
    settings = (codec.party, codec.checksum, codec.em) != (last.party, last.checksum, last.em)
    if changed:
        state.note(f"{who(state)}: another drive replies than last time ({'; '.join(changed)})")
    elif settings or state.name != last.name:
        state.note(f"{who(state)}: its settings are not those of last time ({codec.shown}); they were read again")


def _old_error(state: MCodeState, request: Request) -> Procedure[None]:
    """Read and report an earlier error. Raises NoAnswer where it cannot be read.

    With a checksum an ACK is enough (decision 0001), so the host reads nothing after a command. But a program may have
    set the flag since, and then a NAK would not show its cause.
    """
    if state.running and state.codec.checksum and not state.error and request.kind is Kind.COMMAND:
        reply = yield question(state, 'EF," ",BY', "[01] [01]")
        if reply.end is End.DONE:
            printed = value(state, reply)
            state.program_read(error=printed[0] == "1", running=printed[-1] == "1")
        else:
            state.reply_lost()
    if not state.error:
        return
    code = yield from read_error(state)
    if code is None:
        raise NoAnswer(f"{who(state)}: an error may be set and could not be read; '{request.text}' was not sent")
    if code:
        state.note(f"{who(state)}: an old error, now cleared: {described(code, state)}")


def find_again(state: MCodeState, request: Request) -> Procedure[None]:
    """Read the drive's present settings. Raises NoAnswer where it is silent."""
    before = state.codec
    places = [Place(before.party, state.address, (0, 1) if before.checksum else (0,))]
    places += [Place(codec.party, address) for codec, address in state.candidates]
    if not (yield from look_in(state, places, request.priority)):
        state.settings_may_have_changed()
        raise NoAnswer(f"{who(state)} does not reply: '{request.text}' was not sent")
    state.left_program_mode()
    if state.reply_pending:
        yield from synchronise(state, request.priority)
    state.synchronised()
    if state.product and state.codec != before:
        state.note(
            f"{who(state)} has other settings now ({state.codec.shown}): it was restarted, or another host changed them"
        )
