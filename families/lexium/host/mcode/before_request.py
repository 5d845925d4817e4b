"""Before each request: what an earlier request left, and a drive that is not confirmed yet.

Theory of operation. A drive whose settings may have changed prints them before the next request. A drive may be only
expected at a place, by the user's hints or from last time. It first prints what it is and how it is set. Where that
does not fit, the host looks for it in the other place and reports what is different. Only then it sends the request.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from multidrop.base.errors import Inexpressible, NoAnswer
from multidrop.dialects.codec import End, Kind, Procedure, Request
from multidrop.dialects.exchange import limited, unanswered
from multidrop.dialects.state import who
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.errors import earlier_error
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.exchange import (
    discard_late_replies,
    printed_value,
    question,
    raise_refusal,
    read_error,
    value,
)
from multidrop.families.lexium.host.mcode.framing import NAK
from multidrop.families.lexium.host.mcode.identity import activate_party, asked, find, find_in_text, look_in, pinged
from multidrop.families.lexium.host.mcode.state import MCodeState, ReplyPlace
from multidrop.families.lexium.manual.mnemonic import ETHERNET

T = TypeVar("T")


def before_request(state: MCodeState, request: Request) -> Procedure[Request]:
    """Clear what earlier requests left, so that it is not taken for the outcome of this request.

    Returns the request in the drive's present form. Raises NoAnswer where the request was not sent.
    """
    if state.unconfirmed is not None:
        yield from _confirmed(state, request.text, "was not sent")
    elif state.settings_unknown:
        yield from _in_time_left(state, request.text, "was not sent", find_again(state, request))
    elif state.reply_pending:
        if not (yield from discard_late_replies(state, request.priority)):
            yield from find_again(state, request)
        state.synchronised()
    if _error_may_be_hidden(state, request):
        state.came_unasked()
    if request.kind is not Kind.PRINT and (state.error or state.running or state.others_heard):
        yield from _old_error(state, request)
    if request.codec == state.codec and request.address == state.address:
        return request
    renewed = state.codec.request(state.address, request.text)
    return replace(renewed, kind=request.kind, priority=request.priority)


def value_of(state: MCodeState, items: str, form: str) -> Procedure[str]:
    """Print values for the host's own use; `form` is a regular expression for them."""
    yield from before_request(state, question(state, items, form))
    return (yield from printed_value(state, items, form))


def _confirmed(state: MCodeState, text: str, fate: str) -> Procedure[None]:
    return (yield from _in_time_left(state, text, fate, confirm_drive(state, text, fate)))


def _in_time_left(state: MCodeState, text: str, fate: str, steps: Procedure[T]) -> Procedure[T]:
    """Look for the drive in the rest of the line's time, of which `first_print` may have used some. Raises NoAnswer."""
    try:
        return (yield from limited(who(state), text, fate, steps, state.looking))
    finally:
        state.looking.begins()


def confirm_drive(state: MCodeState, text: str, fate: str) -> Procedure[None]:
    """Read what an expected drive is and how it is set, and report differences. Raises NoAnswer where it is silent.

    `text`: the line that waits for it; `fate`: what has become of that line.
    """
    expected = state.unconfirmed
    assert expected is not None
    state.sought()
    replied = yield from (find(state, expected.place) if expected.stated else _find_anywhere(state, expected.place))
    if not replied:
        state.settings_may_have_changed()
        raise NoAnswer(f"{who(state)} does not reply: '{text}' {fate}")
    last, codec = expected.last, state.codec
    if last is None:
        return
    # Report another drive than last time's, or other settings.
    compared = (
        ("serial number", last.serial, state.serial),
        ("product", last.product, state.product),
        ("version", last.version, state.version),
    )
    changed = [f"{word} {then} then, {now} now" for word, then, now in compared if then and now and then != now]
    settings = (codec.party, codec.checksum, codec.em) != (last.party, last.checksum, last.em)
    if changed:
        state.note(f"{who(state)}: another drive replies than last time ({'; '.join(changed)})")
    elif settings or state.name != last.name:
        state.note(f"{who(state)}: its settings are not those of last time ({codec.shown}); they were read again")


def _find_anywhere(state: MCodeState, place: ReplyPlace) -> Procedure[bool]:
    """Look for a drive where it was last time, then in the other place: party mode, or none."""
    name = state.name or state.address
    if place.party:
        alone = ReplyPlace(False, "")
        return (yield from find_in_text(state, place)) or (yield from find(state, alone))
    if (yield from find(state, place)):
        return True
    yield from activate_party(state.codec)
    return bool(name) and (yield from find(state, ReplyPlace(True, name)))


def _error_may_be_hidden(state: MCodeState, request: Request) -> bool:
    """Whether another program's error would not show before a command: nothing of its replies comes here.

    A drive with EM=2 replies to no command, and one on a network only to the client that asks.
    """
    silent = state.codec.em == 2 or ETHERNET.match(state.product) is not None
    return silent and request.kind in (Kind.COMMAND, Kind.SETTING)


def _old_error(state: MCodeState, request: Request) -> Procedure[None]:
    """Read and report an earlier error. Raises NoAnswer where it cannot be read.

    With a checksum an ACK is enough (decision 0001), so the host reads nothing after a command. But a program may have
    set the flag since, and then a NAK would not show its cause. So may another host, if bytes came without a request.
    """
    checked = state.running and state.codec.checksum and request.kind is Kind.COMMAND
    if (checked or state.others_heard) and not state.error:
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
        state.note(f"{who(state)}: {earlier_error(code, state)}")


def find_again(state: MCodeState, request: Request) -> Procedure[None]:
    """Read the drive's present settings. Raises NoAnswer where it is silent."""
    before = state.codec
    places = [ReplyPlace(before.party, state.address, (0, 1) if before.checksum else (0,))]
    places += [ReplyPlace(codec.party, address) for codec, address in state.candidates]
    if not (yield from look_in(state, places, request.priority)):
        state.settings_may_have_changed()
        raise NoAnswer(f"{who(state)} does not reply: '{request.text}' was not sent")
    state.left_program_mode()
    if state.reply_pending:
        yield from discard_late_replies(state, request.priority)
    state.synchronised()
    if state.product and state.codec != before:
        state.note(
            f"{who(state)} has other settings now ({state.codec.shown}): it was restarted, or another host changed them"
        )


# A person's print that is the first line to a drive: its own exchange confirms the drive.
#
# Theory of operation. The user's hints, or last time, say where the drive replies. A ping shows that it still does,
# and whether it wants a checksum. The print is read in a form that every echo mode shows. Its sync mark bears the
# drive's name and a number that differs from last time's, so no other drive's and no earlier reply matches.
#
# No remembered setting replaces a reading of ES: until then a stop takes every form. (Decision 0027.)


LONGEST_MARK = '"~a0000"'


def first_print(state: MCodeState, request: Request) -> Procedure[tuple[str, ...] | None]:
    """Send a print to a drive that is not confirmed yet; return its lines.

    None: the print was not executed, and takes the usual path. Raises Refused or NoAnswer.
    """
    expected, pattern = state.unconfirmed, classify.plain_form(request.text)
    if expected is None or request.kind is not Kind.PRINT or pattern is None or not _fits(state, request):
        return None
    if not expected.replied:
        steps = _present(state, expected.place)
        state.looking.begins()
        place = yield from limited(who(state), request.text, "was not sent", steps, state.looking)
        if place is None:
            return None
        expected = replace(expected, place=place, replied=True)
    place = expected.place
    form = _form(state, place, place.checks[0])
    said, _reply = yield from asked(state, place.address, form, request.text[2:].strip(), pattern)
    if said:
        state.expected(expected)
        return (said,)
    yield from _confirmed(state, request.text, "was sent once, and it is not known whether it was executed")
    if not (state.codec.party == form.party and (state.codec.checksum > 0) == (form.checksum > 0)):
        return None
    if state.error:
        yield from raise_refusal(state, request)
    raise unanswered(who(state), request)


def _present(state: MCodeState, place: ReplyPlace) -> Procedure[ReplyPlace | None]:
    """Make sure that the drive replies; return the place with its checksum, None where that is not certain.

    This comes before the person's line, so that half a line in the drive's buffer does not spoil that one.
    """
    if place.party:
        place, replied = yield from pinged(state, place)
        return place if replied and len(place.checks) == 1 else None
    for checksum in place.checks:
        said, reply = yield from asked(state, "", _form(state, place, checksum), '"-"', "-")
        if said:
            return replace(place, checks=(checksum,))
        if not (NAK in reply.raw and state.codec.checksum):  # a NAK that was not expected needs more proof
            return None
    return None


def _form(state: MCodeState, place: ReplyPlace, checksum: int) -> MCode:
    """The form of a print that every echo mode shows."""
    return replace(state.codec, em=2, party=place.party, checksum=checksum, escape=None)


def _fits(state: MCodeState, request: Request) -> bool:
    try:
        replace(state.codec, checksum=1).request(state.address, f"{request.text},{LONGEST_MARK}")
    except Inexpressible:
        return False
    return True
