"""Asking an MCode drive something, and making sure what came of it.

Theory of operation. Only EM=0 shows a refusal by itself (`?`), and a checksum does by NAK. Elsewhere a command that
prints nothing is followed by `PR EF`, and by `PR ER` when that is 1. Reading ER clears it, so an error that stood
from before is read and told first, or the next command would be blamed for it. After a NAK, ER tells a damaged
frame (0: safe to repeat) from a refusal. Nothing else is ever sent again. After an answer that did not come, a
mark is printed first: what comes before the mark is late and belongs to nobody.

Some units answer every command with NAK while an error stands, and carry it out. So the flag is cleared before a
command is sent; where it may have been set since, a NAK does not tell whether the command was executed. A running
program may set the flag at any time.

Values are signed (`signs`), because a running program prints numbers too, and another drive's answer may be late.
(MCode reference 5.1.37, 5.1.39, 5.1.40, 7.1; facts of real units.)
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import NoReturn

from dialects.base import End, Kind, Known, Priority, Reply, Request, Talk
from dialects.errors import NoAnswer, Refused
from dialects.mcode import errors, kinds
from dialects.mcode.printed import INTEGER as INTEGER
from dialects.mcode.signs import fresh, question, value
from dialects.mcode.signs import mcode as mcode

REPEATS = 3


def who(known: Known) -> str:
    """How a drive is named in a message."""
    return known.address or "the drive"


def answered(known: Known, request: Request) -> Talk[Reply]:
    """Send it; repeat it only where a NAK and ER=0 show that it was not executed. Raises Refused or NoAnswer."""
    for _ in range(1 + REPEATS):
        stood = known.error
        reply = yield request
        if not reply.doubtful:
            note_error(known, reply)
        if reply.end is End.NAK and not reply.doubtful:
            yield from _refused_unless_damaged(known, request, stood)
            if reply.detail:
                _raise_damaged(known, request, reply)
            continue
        if reply.end is End.REFUSED:
            yield from refused(known, request)
        _raise_unless_answered(known, request, reply)
        return _beyond_doubt(known, request, reply)
    raise NoAnswer(
        f"{who(known)}: '{request.text}' arrived damaged {1 + REPEATS} times and was not executed; check the cabling"
    )


def note_error(known: Known, reply: Reply) -> None:
    """Write down what an answer says of the error flag."""
    if reply.prompt or reply.flagged:
        known.error = reply.flagged or reply.prompt == "?"


def lost(known: Known) -> None:
    """An answer did not come: it may be late, and what was asked may have arrived damaged and be an error by now."""
    known.unsure = known.error = True


def _raise_unless_answered(known: Known, request: Request, reply: Reply) -> None:
    if reply.end in (End.TIMEOUT, End.NAK):  # a NAK that may be another drive's
        lost(known)
        raise NoAnswer(unknown(known, request))
    if reply.end is End.DAMAGED:
        _raise_damaged(known, request, reply)
    if ends_in_program_mode(reply) and request.kind is not Kind.PROGRAM:
        known.programming = True
        raise Refused(
            f"{who(known)} is in program mode: '{request.text}' was stored before {reply.prompt.strip()} and not "
            "executed; leave program mode with PG"
        )


def _raise_damaged(known: Known, request: Request, reply: Reply) -> NoReturn:
    lost(known)
    raise NoAnswer(
        f"{who(known)}: the answer to '{request.text}' is damaged ({reply.detail}); it may have been executed "
        "and was not sent again"
    )


def _beyond_doubt(known: Known, request: Request, reply: Reply) -> Reply:
    """Where another drive's answer is outstanding: a sign of acceptance may be that one; a print is not believed."""
    if not reply.doubtful or request.signed:
        return reply
    if request.kind in (Kind.PRINT, Kind.LIST) and reply.lines:
        lost(known)
        raise NoAnswer(
            f"{who(known)}: '{reply.text}' came for '{request.text}', or late from another drive that did not answer; "
            "it is not taken for either; ask again in a while"
        )
    return replace(reply, acknowledged=False)


def unknown(known: Known, request: Request) -> str:
    """What is said of a command that was not answered."""
    return f"{who(known)} does not answer: it is not known whether '{request.text}' was executed; it was sent once"


def _refused_unless_damaged(known: Known, request: Request, stood: bool) -> Talk[None]:
    """After a NAK: ER tells a damaged frame (0) from a refusal, unless the error may have been there before.

    `stood`: the flag was set, or not known to be clear, when it was sent.
    """
    code = yield from read_error(known)
    if code == 0:
        return
    once = f"it is not known whether '{request.text}' was executed; it was sent once"
    if code is None:
        raise NoAnswer(f"{who(known)} said NAK, and why could not be read: {once}")
    if request.kind not in (Kind.PRINT, Kind.LIST):
        if stood or code in errors.BY_ITSELF:
            raise NoAnswer(f"{who(known)} said NAK, maybe for {described(code, known)}, now cleared: {once}")
        if (yield from _runs(known)):
            raise NoAnswer(f"{who(known)} said NAK, and {described(code, known)} may be its running program's: {once}")
    raise Refused(f"{who(known)} refused '{request.text}': {described(code, known)}", code)


def refused(known: Known, request: Request) -> Talk[None]:
    """The drive said `?` or has set EF: read why, and raise it.

    It need not be this line's doing: a limit that was reached, a stall, or the running program set EF just the same.
    """
    code = yield from read_error(known)
    if not code:
        gone = "could not be read" if code is None else "is gone from ER; a subroutine of OE may have read it"
        raise NoAnswer(
            f"{who(known)} showed an error that {gone}: it is not known whether '{request.text}' was executed"
        )
    if code in errors.BY_ITSELF:
        raise Refused(
            f"{who(known)}: {described(code, known)}; it refused '{request.text}', or that came by itself and it was "
            "executed",
            code,
        )
    caveat = "; a program runs, whose error it may be" if (yield from _runs(known)) else ""
    raise Refused(f"{who(known)} refused '{request.text}': {described(code, known)}{caveat}", code)


def _runs(known: Known) -> Talk[bool]:
    """Whether a program runs, as far as that can be told."""
    reply = yield question(known, "BY", "[01]")
    if reply.end is not End.DONE:
        lost(known)
    return reply.end is End.DONE and value(known, reply) == "1"


def described(code: int, known: Known) -> str:
    """Number, text and what to do."""
    advice = errors.hint(code, known.product)
    return f"error {code}: {errors.text(code, known.product)}" + (f" ({advice})" if advice else "")


def check_error_flag(known: Known, request: Request, silent: bool = False) -> Talk[None]:
    """`PR EF` behind a command that shows no refusal by itself: the only acknowledgement there is.

    `silent`: nothing at all came, which outside of EM=2 only a drive with CK=2 may do that runs a program (or has just
    ended it: E); elsewhere the command was lost on the way.
    """
    silent = silent and mcode(known).em != 2
    asked = question(known, 'EF," ",BY' if silent else "EF", "[01] [01]" if silent else "[01]")
    try:
        reply = yield from answered(known, asked)
    except NoAnswer:
        raise NoAnswer(unknown(known, request)) from None
    if reply.end is End.SILENT:
        lost(known)
    if reply.end is End.SILENT and mcode(known).em == 2:
        raise NoAnswer(unknown(known, request))
    if reply.end is End.SILENT:
        raise NoAnswer(
            f"{who(known)} prints nothing after '{request.text}', and it is not known whether that was executed: it "
            "may be in program mode; open it again to find out"
        )
    told = value(known, reply)
    if told[:1] == "1":
        yield from refused(known, request)
    known.error = False
    runs, ends = told[1:] == " 1", kinds.word_of(request.text)[0] == "E"
    taken = not runs if ends else runs and mcode(known).checksum == 2
    if silent and not taken and not _came_late(known, reply):
        known.stale = True  # or it is set in a way in which it says nothing
        raise NoAnswer(unknown(known, request))


def _came_late(known: Known, reply: Reply) -> bool:
    """Whether the ACK or CRLF that was missing stands in front of what was asked after it, besides that one's own."""
    if mcode(known).checksum:
        return reply.raw.count(b"\x06") > 1
    return reply.raw.split(b"\r\n")[:-1].count(b"") > 1


def read_error(known: Known) -> Talk[int | None]:
    """ER, which reading clears; None where the answer is missing or damaged (never asked twice for that)."""
    request = question(known, "ER", INTEGER)
    for _ in range(1 + REPEATS):
        reply = yield request
        if reply.end is End.NAK and not reply.detail:
            continue
        if reply.end is End.DONE:
            known.error = False
            return int(value(known, reply))
        lost(known)
        return None
    return None


def mark(known: Known, request: Request) -> Talk[None]:
    """Print something that nobody else prints: all that comes in front of it is late."""
    if not (yield from print_mark(known, request.priority)):
        lost(known)
        fate = "was sent once" if request.kind is Kind.PRINT and mcode(known).em == 2 else "was not sent"
        raise NoAnswer(f"{who(known)} does not answer: '{request.text}' {fate}")
    known.unsure = False


def print_mark(known: Known, priority: Priority) -> Talk[tuple[str, ...] | None]:
    """Have the drive print a fresh mark; the lines that came before it, with the mark, or None."""
    own = fresh(known, known.address, mcode(known).party)
    asked = mcode(known).request(known.address, f"PR {own.item}")
    reply = yield replace(asked, expect=re.escape(own.shown), gather=True, signed=True, priority=priority)
    return reply.lines if reply.end is End.DONE else None


def ends_in_program_mode(reply: Reply) -> bool:
    """Whether the prompt is an address: the drive stores what it is sent."""
    return reply.prompt[:1].isdigit()
