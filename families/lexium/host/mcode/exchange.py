"""One request to an MCode drive, and proof of its outcome: signed prints, errors, the end of program mode."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

from multidrop.base.errors import DriveError, Inexpressible, NoAnswer, Refused, Stopped
from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.exchange import unanswered
from multidrop.dialects.state import who
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.classify import INTEGER, NOTHING
from multidrop.families.lexium.host.errors import described
from multidrop.families.lexium.host.mcode.framing import ACK, UNPRINTED
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import errors
from multidrop.families.lexium.manual.errors import ErrorNumber

# Signed prints: the host's questions, a person's prints, sync marks.
#
# Theory of operation. A reply carries neither its request's number nor a name. So the host appends an item to the
# values: the drive's own name (`PR P,DN`) if the drive prints it, otherwise a text with that name (`PR P,"~a"`). The
# first is better: a flipped bit in a request's address may send it to another drive. That drive prints a text exactly
# as it receives it, so the text would pass, but for `DN` it prints its own name. A sync mark also has a fresh number;
# everything before it is late. (MCode reference 5.1.33, 5.1.102; decision 0014.)


@dataclass(frozen=True)
class Sign:
    """The item of PR that signs a print, and its printed form."""

    item: str
    shown: str


def sign(state: MCodeState) -> Sign:
    return _sign(state.address, state.signs and state.codec.party)


@lru_cache(maxsize=256)
def _sign(address: str, by_name: bool) -> Sign:
    if by_name:
        return Sign("DN", as_printed(address))
    text = _tag(address)
    return Sign(f'"{text}"', text)


def fresh_mark(state: MCodeState, address: str, party: bool) -> Sign:
    """Return a fresh sync mark: the signature of a drive at this address, with the next number."""
    number = state.next_sync_mark() % 10000
    if state.signs and party:
        return Sign(f'"~{number}",DN', f"~{number}{as_printed(address)}")
    text = f"{_tag(address)}{number}"
    return Sign(f'"{text}"', text)


def as_printed(name: str) -> str:
    """Return a name as PR DN prints it."""
    return f'"{name}"'


def _tag(address: str) -> str:
    return f"~{address}" if address.isalnum() else "~"


def question(state: MCodeState, items: str, answer: str) -> Request:
    """Print values for the host's own use; `answer` is a regular expression for them."""
    own = sign(state)
    asked = state.codec.request(state.address, f"PR {items},{own.item}")
    return replace(asked, expect=f"({answer}){re.escape(own.shown)}", signed=True)


def value(state: MCodeState, reply: Reply) -> str:
    return reply.text.removesuffix(sign(state).shown)


def signed(state: MCodeState, request: Request) -> Request:
    """Sign a person's print; unchanged where it has no value, or no room."""
    own = sign(state)
    text = classify.with_item(request.text, own.item)
    if text is None:
        return request
    try:
        longer = state.codec.request(state.address, text)
    except Inexpressible:
        return request
    expect = f"{classify.print_form(request.text)}{re.escape(own.shown)}"
    return replace(longer, text=request.text, spoken=text, expect=expect, signed=True)


# One request to an MCode drive, and proof of its outcome.
#
# Theory of operation. Only EM=0 shows a refusal by itself (`?`); with a checksum NAK does. Otherwise the host sends
# `PR EF` after a command that prints nothing, and `PR ER` if EF is 1. Reading ER clears it. So the host reads and
# reports an earlier error first, or the next command would be blamed for it. After a NAK, ER identifies a damaged
# frame (0: safe to repeat) from a refusal. The host never repeats anything else. After a missing reply it prints a
# sync mark: everything before the mark is late and is discarded.
#
# Some units reply NAK to every command while an error is set, and execute the command. So the host clears the flag
# before a command. Where the flag may have been set since, a NAK does not tell whether the command was executed. A
# running program may set the flag at any time.
#
# Values are signed (see above): a running program prints numbers too, and another drive's reply may be late. (MCode
# reference 5.1.37, 5.1.39, 5.1.40, 7.1; facts of real units.)


NAK_REPEATS = 3
"""How often a line is sent again that the drive rejected as damaged: a NAK, and ER=0."""
QUESTION_REPEATS = 3
"""How often the host asks again for what reading does not change, if the reply is damaged or missing."""
UNKNOWN_WORDS = (ErrorNumber.UNKNOWN_VARIABLE, ErrorNumber.UNKNOWN_COMMAND)


def send_until_answered(state: MCodeState, request: Request) -> Procedure[Reply]:
    """Send a request; repeat it only after a NAK with ER=0. Raises Refused or NoAnswer."""
    for _ in range(1 + NAK_REPEATS):
        flag_may_be_set = state.error
        reply = yield from send_once(state, request)
        if not reply.doubtful:
            note_error(state, reply)
        if reply.end is End.NAK and not reply.doubtful:
            yield from _raise_refusal_unless_damaged(state, request, flag_may_be_set)
            if reply.detail:
                state.reply_lost()
                raise unanswered(who(state), request, replace(reply, end=End.DAMAGED))
            continue
        if reply.end is End.REFUSED:
            yield from raise_refusal(state, request)
        if reply.end in (End.TIMEOUT, End.DAMAGED, End.NAK):  # the NAK may be another drive's
            state.reply_lost()
            raise unanswered(who(state), request, reply)
        if ends_in_program_mode(reply) and request.kind is not Kind.PROGRAM:
            state.may_be_in_program_mode()
            raise Refused(
                f"{who(state)} is in program mode: '{request.text}' was stored before {reply.prompt.strip()} and not "
                "executed; leave program mode with PG"
            )
        # While the reply of another drive is outstanding, this one may be that. So an unsigned reply proves nothing: do
        # not count it as an acknowledgement, and do not show what it prints.
        if not reply.doubtful or request.signed:
            return reply
        if request.kind in (Kind.PRINT, Kind.LIST) and reply.lines:
            state.reply_lost()
            raise NoAnswer(
                f"{who(state)}: '{reply.text}' came for '{request.text}', or late from another drive that did not "
                "reply; it counts for neither; ask again later"
            )
        return replace(reply, acknowledged=False)
    raise NoAnswer(
        f"{who(state)}: '{request.text}' arrived damaged {1 + NAK_REPEATS} times and was not executed; check the "
        "cabling"
    )


def send_once(state: MCodeState, request: Request) -> Procedure[Reply]:
    """Send a request once.

    Without a checksum, noise may change the request into another one. If a stop cuts it off, that error stays unread.
    """
    try:
        return (yield request)
    except Stopped:
        if not state.codec.checksum:
            state.error_possible()
        raise


def send_persons_line(state: MCodeState, request: Request) -> Procedure[Reply]:
    """Send a person's line as `send_until_answered` does.

    If a stop cuts it off, the error flag may stay set: nothing has read it.
    """
    try:
        return (yield from send_until_answered(state, request))
    except Stopped:
        state.error_possible()
        raise


def note_error(state: MCodeState, reply: Reply) -> None:
    """Record what a reply shows of the error flag."""
    if reply.prompt or reply.flagged:
        state.error_flag_read(reply.flagged or reply.prompt == "?")


def check_printed(state: MCodeState, reply: Reply, refusal: str = "") -> None:
    """Raise NoAnswer unless the drive printed, or Refused with the reason, where one is given."""
    note_error(state, reply)
    if refusal and reply.end is End.REFUSED and not reply.doubtful:
        raise Refused(f"{who(state)} {refusal}")
    if reply.end is not End.DONE:
        state.error_possible()  # noise may have made a print of it that the drive refuses
        if reply.end is not End.NAK:
            state.reply_lost()
        raise NoAnswer(f"{who(state)} does not reply ({reply.end.value})")


def printed_value(state: MCodeState, items: str, form: str) -> Procedure[str]:
    """Print values for the host's own use. Raises NoAnswer where nothing is printed, Refused."""
    reply = yield from send_until_answered(state, question(state, items, form))
    check_printed(state, reply)
    return value(state, reply)


def _raise_refusal_unless_damaged(state: MCodeState, request: Request, flag_may_be_set: bool) -> Procedure[None]:
    """Tell a damaged frame (ER=0) from a refusal after a NAK, unless the error may be an earlier one.

    `flag_may_be_set`: the flag was set, or not known to be clear, when the request was sent.
    """
    others_heard = state.others_heard
    code, acknowledged = yield from _read_error(state)
    outcome_unknown = f"it is not known whether '{request.text}' was executed; it was sent once"
    if acknowledged:  # by the drive, late: the NAK was noise
        raise NoAnswer(f"{who(state)} replied NAK, and an ACK came later: {outcome_unknown}")
    if code == 0:
        return
    if code is None:
        raise NoAnswer(f"{who(state)} replied NAK, and the reason could not be read: {outcome_unknown}")
    _check_cause(state, request, code, others_heard)
    if request.kind not in (Kind.PRINT, Kind.LIST):
        if flag_may_be_set or _came_by_itself(request, code):
            raise NoAnswer(
                f"{who(state)} replied NAK, maybe for {described(code, state)}, now cleared: {outcome_unknown}"
            )
        if (yield from _runs(state)):
            raise NoAnswer(
                f"{who(state)} replied NAK, and {described(code, state)} may be its running program's: "
                f"{outcome_unknown}"
            )
    raise Refused(f"{who(state)} refused '{request.text}': {described(code, state)}", code)


def raise_refusal(state: MCodeState, request: Request, acknowledged: bool = False) -> Procedure[None]:
    """Read and raise the error after `?` or EF=1.

    The error need not come from this line: a limit, a stall or the running program sets EF too. `acknowledged`: an ACK
    of the line came late.
    """
    others_heard = state.others_heard
    code = yield from read_error(state)
    if not code:
        gone = "could not be read" if code is None else "is gone from ER; a subroutine of OE may have read it"
        raise NoAnswer(
            f"{who(state)} showed an error that {gone}: it is not known whether '{request.text}' was executed"
        )
    if acknowledged:
        raise NoAnswer(
            f"{who(state)}: {described(code, state)}, now cleared; an ACK of '{request.text}' came, too: it is not "
            "known whether it was executed"
        )
    _check_cause(state, request, code, others_heard)
    # A drive may lack a variable that the manual has.
    elsewhere = code in UNKNOWN_WORDS and not classify.uses_own_name(request.text)
    if elsewhere or _came_by_itself(request, code):
        other = "is of another line" if elsewhere else "came by itself"
        raise Refused(
            f"{who(state)}: {described(code, state)}; it refused '{request.text}', or that {other} and it was executed",
            code,
            certain=False,
        )
    caveat = "; a program runs, whose error it may be" if (yield from _runs(state)) else ""
    refusal = f"{who(state)} refused '{request.text}': {described(code, state)}{caveat}"
    raise Refused(refusal, code, certain=not caveat or classify.refused_by_tables(request.text, state.product))


def _check_cause(state: MCodeState, request: Request, code: int, others_heard: bool) -> None:
    """Raise NoAnswer for an error that is another line's, or may be.

    Another program has sent that line, on the same port or the same drives, or noise has made it of ours. A port that
    is lent makes a half-sent line harmless. `others_heard`: bytes came without a request since the flag was known to be
    clear.
    """
    if classify.refused_by_tables(request.text, state.product):
        return
    if not classify.may_cause(request.text, code, state.product):
        why = f"which '{request.text}' cannot cause: another program may use the line, or it was disturbed"
    elif others_heard and not state.running:
        why = "and bytes came without a question: another program may use the line"
    else:
        return
    raise NoAnswer(
        f"{who(state)}: {described(code, state)}, now cleared, {why}; it is not known whether '{request.text}' was "
        "executed; it was sent once"
    )


def _came_by_itself(request: Request, code: int) -> bool:
    """Whether an error may be none of a request: a fault of the machine."""
    return code in errors.BY_ITSELF


def _runs(state: MCodeState) -> Procedure[bool]:
    reply = yield question(state, "BY", "[01]")
    if reply.end is not End.DONE:
        state.reply_lost()
    return reply.end is End.DONE and value(state, reply) == "1"


def check_error_flag(state: MCodeState, request: Request, silent: bool = False) -> Procedure[bool]:
    """Read EF after a command that shows no refusal by itself; return whether its ACK or line end came late.

    `silent`: nothing was received. Outside of EM=2 that is normal only with CK=2 while a program runs, or after E has
    ended it. Otherwise the command was lost.
    """
    silent = silent and state.codec.em != 2
    state.error_possible()  # until it is read: a stop may come in between
    asked = question(state, 'EF," ",BY' if silent else "EF", "[01] [01]" if silent else "[01]")
    try:
        reply = yield from send_until_answered(state, asked)
    except NoAnswer:
        raise unanswered(who(state), request) from None
    if reply.end is End.SILENT:
        state.reply_lost()
    if reply.end is End.SILENT and state.codec.em == 2:
        raise unanswered(who(state), request)
    if reply.end is End.SILENT:
        raise NoAnswer(
            f"{who(state)} prints nothing after '{request.text}', and it is not known whether that was executed: it "
            "may be in program mode; open it again to find out"
        )
    printed = value(state, reply)
    surplus = not reply.doubtful and _came_late(state, reply)
    if surplus and not silent:  # one of the two was the reply to another program
        state.came_unasked()
    late = silent and surplus
    if printed[:1] == "1":
        yield from raise_refusal(state, request, acknowledged=late and state.codec.checksum > 0)
    state.error_flag_read(False)
    runs, ends = printed[1:] == " 1", classify.word_of(request.text)[0] == "E"
    taken = not runs if ends else runs and state.codec.checksum == 2
    if silent and not taken and not late:
        state.settings_may_have_changed()  # or its settings make it silent
        raise unanswered(who(state), request)
    return late


def _came_late(state: MCodeState, reply: Reply) -> bool:
    """Whether the missing ACK or CRLF precedes the next reply, besides that reply's own."""
    if state.codec.checksum:
        return reply.raw.count(ACK) > 1
    return reply.raw.split(b"\r\n")[:-1].count(b"") > 1


def read_error(state: MCodeState) -> Procedure[int | None]:
    """Read ER, which clears it; None where the reply is missing or damaged (the host does not ask again)."""
    code, _ = yield from _read_error(state)
    return code


def _read_error(state: MCodeState) -> Procedure[tuple[int | None, bool]]:
    """Read ER, and whether the ACK of the request before it came late, or may have been taken for another drive's."""
    request, late = question(state, "ER", INTEGER), False
    for _ in range(1 + QUESTION_REPEATS):
        reply = yield request
        late = late or reply.surplus or reply.doubtful
        if reply.end is End.NAK and not reply.detail:
            continue
        if reply.end is End.DONE:
            code = int(value(state, reply))
            state.error_flag_read(False, code)
            return code, late
        state.reply_lost()
        return None, late
    return None, late


def discard_late_replies(state: MCodeState, priority: Priority) -> Procedure[bool]:
    """Have the drive print a fresh mark after a lost reply; return whether the mark came.

    What comes before the mark is late or printed by a program: it belongs to no request.
    """
    return (yield from mark_printed(state, priority, rows=NOTHING))


def require_mark(state: MCodeState, request: Request) -> Procedure[None]:
    """Do as `discard_late_replies`, for `request`. Raises NoAnswer if the mark does not come."""
    if not (yield from discard_late_replies(state, request.priority)):
        state.reply_lost()
        fate = "was sent once" if request.kind is Kind.PRINT and state.codec.em == 2 else "was not sent"
        raise NoAnswer(f"{who(state)} does not reply: '{request.text}' {fate}")
    state.synchronised()


def mark_printed(state: MCodeState, priority: Priority, rows: str | None = None) -> Procedure[bool]:
    """Have the drive print a fresh mark; return whether the mark came. `rows`: as for a Request."""
    reply = yield _mark_request(state, priority, rows)
    return reply.end is End.DONE


def rest_of_list(state: MCodeState, priority: Priority) -> Procedure[tuple[str, ...] | None]:
    """Have the drive print a fresh mark after a list; return the lines before it, or None where some may be missing."""
    reply = yield _mark_request(state, priority)
    if reply.end is not End.DONE or reply.collided:  # a damaged line may be one of the list
        state.reply_lost()
        return None
    return reply.lines[:-1]


def lacks_lines(reply: Reply, lines: Iterable[str]) -> bool:
    """Whether the reply to a list shows that one of its lines was damaged: a drive lists characters that print."""
    return bool(reply.collided) or any(UNPRINTED.search(line) for line in lines)


def _mark_request(state: MCodeState, priority: Priority, rows: str | None = None) -> Request:
    """Return the request that has the drive print a fresh mark."""
    own = fresh_mark(state, state.address, state.codec.party)
    asked = state.codec.request(state.address, f"PR {own.item}")
    return replace(asked, expect=re.escape(own.shown), gather=True, rows=rows, signed=True, priority=priority)


def ends_in_program_mode(reply: Reply) -> bool:
    """Whether the prompt is an address: the drive stores what it receives."""
    return reply.prompt[:1].isdigit()


# Leaving program mode, whatever the state of the drive and of the wire (MCode reference 5.1.98).


NOT_PROGRAMMING = ErrorNumber.NOT_IN_PROGRAM_MODE
"""The error of PG alone outside of program mode (section 10)."""
MOST_PG_SENT = 6
"""How often PG is sent at most to leave program mode."""


def leave_program(state: MCodeState) -> Procedure[int]:
    """Send PG until a prompt, an error or a printed mark shows the end of program mode; one PG too many does no harm.

    Returns the error that this found and cleared, 0 for none.
    """
    for sent in range(MOST_PG_SENT):
        request = replace(state.codec.request(state.address, "PG"), kind=Kind.PROGRAM)
        reply = yield request
        code: int | None = 0
        if ends_in_program_mode(reply):
            continue
        if reply.end in (End.DONE, End.SILENT):
            state.left_program_mode()
        elif reply.end in (End.REFUSED, End.NAK):
            code = yield from read_error(state)  # None: stored, so still in program mode; 0: damaged frame
            if code:
                state.left_program_mode()
        else:
            if (yield from mark_printed(state, request.priority)):
                state.left_program_mode()
        if not state.programming:
            if sent and not code:  # the error of a PG too many, which may be late
                state.error_possible()
            return code if code and code != NOT_PROGRAMMING else 0
    raise NoAnswer(f"{who(state)} could not be taken out of program mode: type PG, then open it again")


def take_out(state: MCodeState, remark: str) -> Procedure[None]:
    """Leave program mode, and note that. Where a stop prevents it, the mode is read before the next line."""
    try:
        code = yield from leave_program(state)
    except DriveError:
        state.reply_outstanding()
        raise
    error = f"; {described(code, state)}, now cleared" if code else ""
    state.note(f"{who(state)}: {remark}{error}")
