"""Conversations with an MCode drive: what a person types, lists, motion, flags. How one asks stands in `asking`."""

from __future__ import annotations

from dataclasses import replace

from dialects.base import End, Kind, Known, Motion, Priority, Reply, Request, Talk
from dialects.errors import NoAnswer, Refused
from dialects.mcode import kinds
from dialects.mcode.asking import (
    INTEGER,
    answered,
    check_error_flag,
    ends_in_program_mode,
    mark,
    mcode,
    print_mark,
    settle_accounts,
    who,
)
from dialects.mcode.programming import enter_program, program_line
from dialects.mcode.wiring import adopt


def perform(known: Known, text: str) -> Talk[tuple[str, ...]]:
    """Send a line and find out what came of it; the printed lines. Raises Refused, NoAnswer or Stopped."""
    request = mcode(known).request(known.address, text)
    if known.address in ("*", "^"):
        yield from _broadcast(known, request)
        return ()
    if known.programming:
        return (yield from program_line(known, request))
    if kinds.enters_program(request.text):
        return (yield from enter_program(known, request))
    if kinds.word_of(request.text)[0] == "PG":
        raise Refused(f"{who(known)} is not in program mode: 'PG' alone would enter it; say PG and an address")
    return (yield from immediate(known, request))


def immediate(known: Known, request: Request) -> Talk[tuple[str, ...]]:
    """A line that is executed at once, not stored."""
    yield from settle_accounts(known, request)
    reply = yield from answered(known, request)
    if request.kind is Kind.SETTING:
        yield from adopt(known, request, reply)
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
        yield from check_error_flag(known, request, silent=reply.end is End.SILENT)
    if kinds.word_of(request.text)[0] == "IP":
        known.notes.append(f"{who(known)}: IP restored the saved settings; open it again if it falls silent")
    return reply.lines


def _printed_nothing(known: Known, request: Request) -> Talk[None]:
    """A print that printed nothing was refused, or (EM=2, where not even a line feed comes) is lost."""
    if mcode(known).em == 2:
        known.unsure = True
        yield from mark(known, request)
    yield from check_error_flag(known, request)
    if not request.text.endswith(";"):  # which may print nothing, without a line end
        raise NoAnswer(f"{who(known)} printed nothing for '{request.text}', and has no error")


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


def _stored_at(reply: Reply) -> str:
    return f"the address before {reply.prompt.strip()}"


def _broadcast(known: Known, request: Request) -> Talk[None]:
    yield request
    known.notes.append(f"{known.address}: no drive answers a command to all; nothing says whether it was executed")


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
