"""Conversations with an MCode drive: a typed line with everything that makes sure what came of it.

Theory of operation. Only EM=0 shows a refusal by itself (`?`), and a checksum does by NAK. Elsewhere a command that
prints nothing is followed by `PR EF`, and by `PR ER` when that is 1. Reading ER clears it, so an error that stood
from before is read and told first, or the next command would be blamed for it. After a NAK, ER tells a damaged
frame (0: safe to repeat) from a refusal. Nothing else is ever sent again. After an answer that did not come, a
mark is printed first: what comes before the mark is late and belongs to nobody.
(MCode reference 5.1.37, 5.1.39, 5.1.40, 7.1.)
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from dialects.base import End, Kind, Known, Motion, Priority, Reply, Request, Talk
from dialects.errors import NoAnswer, Refused
from dialects.mcode import errors, kinds

if TYPE_CHECKING:
    from dialects.mcode.dialect import MCode

REPEATS = 3
INTEGER = r"-?\d+"


def mcode(known: Known) -> MCode:
    """The drive's dialect, which in these conversations is always MCode."""
    return cast("MCode", known.dialect)


def who(known: Known) -> str:
    """How a drive is named in a message."""
    return known.address or "the drive"


def perform(known: Known, text: str) -> Talk[tuple[str, ...]]:
    """Send a line and find out what came of it; the printed lines. Raises Refused, NoAnswer or Stopped."""
    request = mcode(known).request(known.address, text)
    if known.address in ("*", "^"):
        yield from _broadcast(known, request)
        return ()
    if known.programming:
        return (yield from program_line(known, request))
    if kinds.enters_program(request.text):
        return (yield from _enter_program(known, request))
    if kinds.word_of(request.text)[0] == "PG":
        raise Refused(f"{who(known)} is not in program mode: 'PG' alone would enter it; say PG and an address")
    return (yield from immediate(known, request))


def immediate(known: Known, request: Request) -> Talk[tuple[str, ...]]:
    """A line that is executed at once, not stored."""
    yield from settle_accounts(known, request)
    reply = yield from answered(known, request)
    if request.kind is Kind.SETTING:
        yield from _adopt(known, request, reply)
        return ()
    if ends_in_program_mode(reply):
        known.programming = True
        raise Refused(
            f"{who(known)} is in program mode: '{request.text}' was stored at {_stored_at(reply)} and not "
            "executed; leave program mode with PG"
        )
    if request.kind is Kind.LIST:
        return (yield from _rest_of_list(known, request, reply))
    if request.kind is Kind.PRINT:
        if reply.end is End.SILENT:
            yield from _printed_nothing(known, request)
    elif not reply.acknowledged:
        yield from check_error_flag(known, request)
    if kinds.word_of(request.text)[0] == "IP":
        known.notes.append(f"{who(known)}: IP restored the saved settings; open it again if it falls silent")
    return reply.lines


def _printed_nothing(known: Known, request: Request) -> Talk[None]:
    """A print that printed nothing was refused, or (EM=2, where not even a line feed comes) is lost."""
    if mcode(known).em == 2:
        known.unsure = True
        yield from _mark(known, request)
    yield from check_error_flag(known, request)
    if mcode(known).em == 2:
        raise NoAnswer(f"{who(known)} printed nothing for '{request.text}', and has no error")


def settle_accounts(known: Known, request: Request) -> Talk[None]:
    """Clear up what stands from before, so that it is not mistaken for what comes of this request."""
    if known.unsure:
        yield from _mark(known, request)
    if known.error and request.kind is not Kind.PRINT:
        code = yield from read_error(known)
        if code:
            known.notes.append(f"{who(known)}: an error stood from before, now cleared: {described(code, known)}")


def answered(known: Known, request: Request) -> Talk[Reply]:
    """Send it; repeat it only where a NAK and ER=0 show that it was not executed."""
    for _ in range(1 + REPEATS):
        reply = yield request
        if reply.prompt:
            known.error = reply.prompt == "?"
        if reply.end is End.NAK:
            yield from _refused_unless_damaged(known, request)
            continue
        if reply.end is End.REFUSED:
            yield from refused(known, request)
        _raise_unless_answered(known, request, reply)
        return reply
    raise NoAnswer(
        f"{who(known)}: '{request.text}' arrived damaged {1 + REPEATS} times and was not executed; check the cabling"
    )


def _raise_unless_answered(known: Known, request: Request, reply: Reply) -> None:
    if reply.end is End.TIMEOUT:
        known.unsure = True
        raise NoAnswer(_unknown(known, request))
    if reply.end is End.DAMAGED:
        known.unsure = True
        raise NoAnswer(
            f"{who(known)}: the answer to '{request.text}' is damaged ({reply.detail}); it may have been executed "
            "and was not sent again"
        )


def _unknown(known: Known, request: Request) -> str:
    return f"{who(known)} does not answer: it is not known whether '{request.text}' was executed; it was sent once"


def _refused_unless_damaged(known: Known, request: Request) -> Talk[None]:
    code = yield from read_error(known)
    if code is None:
        raise NoAnswer(f"{who(known)} did not take '{request.text}', and why could not be read; it was not executed")
    if code:
        raise Refused(f"{who(known)} refused '{request.text}': {described(code, known)}", code)


def refused(known: Known, request: Request) -> Talk[None]:
    """The drive said `?` or has set EF: read why, and raise it."""
    code = yield from read_error(known)
    if not code:
        raise Refused(f"{who(known)} refused '{request.text}'; its error register gives no reason", code)
    raise Refused(f"{who(known)} refused '{request.text}': {described(code, known)}", code)


def described(code: int, known: Known) -> str:
    """Number, text and what to do."""
    family = "LMM" if known.product.startswith("LMM") else "LMD"
    advice = errors.hint(code)
    return f"error {code}: {errors.text(code, family)}" + (f" ({advice})" if advice else "")


def check_error_flag(known: Known, request: Request) -> Talk[None]:
    """`PR EF` behind a command that shows no refusal by itself: the only acknowledgement there is."""
    asked = mcode(known).request(known.address, "PR EF")
    try:
        reply = yield from answered(known, replace(asked, expect="[01]"))
    except NoAnswer:
        raise NoAnswer(_unknown(known, request)) from None
    if reply.end is End.SILENT and mcode(known).em == 2:
        known.unsure = True
        raise NoAnswer(_unknown(known, request))
    if reply.end is End.SILENT:
        raise NoAnswer(
            f"{who(known)} prints nothing after '{request.text}': it may be in program mode; open it again to find out"
        )
    if reply.text == "1":
        yield from refused(known, request)
    known.error = False


def read_error(known: Known) -> Talk[int | None]:
    """ER, which reading clears; None where the answer is missing or damaged (never asked twice for that)."""
    request = replace(mcode(known).request(known.address, "PR ER"), expect=INTEGER)
    for _ in range(1 + REPEATS):
        reply = yield request
        if reply.end is End.NAK:
            continue
        if reply.end is End.DONE:
            known.error = False
            return int(reply.text)
        known.unsure = True
        return None
    return None


def _mark(known: Known, request: Request) -> Talk[None]:
    """Print something that nobody else prints: all that comes in front of it is late."""
    if not (yield from print_mark(known, request.priority)):
        fate = "was sent once" if request.kind is Kind.PRINT and mcode(known).em == 2 else "was not sent"
        raise NoAnswer(f"{who(known)} does not answer: '{request.text}' {fate}")
    known.unsure = False


def print_mark(known: Known, priority: Priority) -> Talk[tuple[str, ...] | None]:
    """Have the drive print a fresh mark; the lines that came before it, with the mark, or None."""
    known.marks += 1
    mark = f"~{known.address}{known.marks % 10000}"
    asked = mcode(known).request(known.address, f'PR "{mark}"')
    reply = yield replace(asked, expect=re.escape(mark), gather=True, priority=priority)
    return reply.lines if reply.end is End.DONE else None


def _rest_of_list(known: Known, request: Request, reply: Reply) -> Talk[tuple[str, ...]]:
    """EM 1 to 3 give a list no end: a mark printed behind it does."""
    lines = reply.lines
    if mcode(known).em != 0:
        rest = yield from print_mark(known, request.priority)
        if rest is None:
            known.unsure = True
            raise NoAnswer(f"{who(known)}: the list may be incomplete: its end was not seen; ask again")
        lines += rest[:-1]
        if not lines:
            yield from check_error_flag(known, request)
    return tuple(line for line in lines if line)


def ends_in_program_mode(reply: Reply) -> bool:
    """Whether the prompt is an address: the drive stores what it is sent."""
    return reply.prompt[:1].isdigit()


def _stored_at(reply: Reply) -> str:
    return f"the address before {reply.prompt.strip()}"


def _broadcast(known: Known, request: Request) -> Talk[None]:
    yield request
    known.notes.append(f"{known.address}: no drive answers a command to all; nothing says whether it was executed")


def _adopt(known: Known, request: Request, reply: Reply) -> Talk[None]:
    """After a wire setting: see that the drive answers in the new way, and take that over."""
    before, address = known.dialect, known.address
    made = kinds.setting_of(request.text)
    if made is None:
        known.dialect, known.address = type(mcode(known))(), ""
        known.notes.append(f"{address or 'the drive'}: factory defaults: EM=0, PY=0, CK=0, name !")
    else:
        known.dialect = mcode(known).set(*made)
        if made[0] == "DN":
            known.name = made[1]
            known.address = made[1] if mcode(known).party else ""
        if made == ("PY", "1"):
            known.address = known.name
            yield from activate_party(mcode(known))
        if made == ("PY", "0"):
            known.address = ""
    flag = yield replace(mcode(known).request(known.address, "PR EF"), expect="[01]")
    if flag.end is not End.DONE:
        known.dialect, known.address = before, address
        yield from check_error_flag(known, request)
        raise Refused(f"{who(known)} did not take '{request.text}' over: it answers as before")
    if flag.text == "1":
        code = yield from read_error(known)
        raise Refused(f"{who(known)}: '{request.text}': {described(code or 0, known)}", code)


def activate_party(dialect: MCode) -> Talk[None]:
    """Two line feeds make party mode effective after PY=1 (5.1.105)."""
    for _ in range(2):
        yield Request("", "", Kind.QUIET, replace(dialect, checksum=0), settle=0.05)


def _enter_program(known: Known, request: Request) -> Talk[tuple[str, ...]]:
    """PG n. Only EM=0 shows whether the drive went into program mode, so it is used until PG ends it."""
    yield from settle_accounts(known, request)
    if mcode(known).em != 0:
        yield from echo_everything(known)
    request = replace(request, dialect=known.dialect)
    reply = yield from answered(known, request)
    if not ends_in_program_mode(reply):
        raise Refused(f"{who(known)} did not go into program mode after '{request.text}'")
    known.programming = True
    known.notes.append(f"{who(known)}: program mode: every line is stored until PG")
    return ()


def echo_everything(known: Known) -> Talk[None]:
    """EM=0 for a while; `known.restore` keeps what it was."""
    known.restore = known.dialect
    asked = mcode(known).request(known.address, "EM=0")
    reply = yield from answered(known, asked)
    yield from _adopt(known, asked, reply)


def restore_echo(known: Known) -> Talk[None]:
    """Back to the echo mode that was there before `echo_everything`."""
    if known.restore is None:
        return
    mode = cast("MCode", known.restore).em
    known.restore = None
    asked = mcode(known).request(known.address, f"EM={mode}")
    reply = yield from answered(known, asked)
    yield from _adopt(known, asked, reply)


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


def motion(known: Known, priority: Priority) -> Talk[tuple[Motion, ...]]:
    """Position and velocity in one print, so that they belong together and the wire is used half as long."""
    if known.unsure:
        if (yield from print_mark(known, priority)) is None:
            raise NoAnswer(f"{who(known)} does not answer")
        known.unsure = False
    asked = mcode(known).request(known.address, 'PR P," ",V')
    reply = yield replace(asked, expect=rf"{INTEGER} {INTEGER}", priority=priority)
    if reply.prompt:
        known.error = reply.prompt == "?"
    if reply.end is not End.DONE:
        known.unsure = known.unsure or reply.end in (End.TIMEOUT, End.DAMAGED)
        raise NoAnswer(f"{who(known)} does not answer ({reply.end.value})")
    position, velocity = reply.text.split(" ")
    return (Motion(int(position), int(velocity)),)


def flag(known: Known, name: str) -> Talk[bool]:
    """A flag as the drive prints it."""
    asked = replace(mcode(known).request(known.address, f"PR {name}"), expect="[01]")
    yield from settle_accounts(known, asked)
    reply = yield from answered(known, asked)
    return reply.text == "1"
