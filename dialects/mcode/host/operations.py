"""Conversations with an MCode drive: what a person types, lists, motion, flags. How one asks stands in `asking`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from dialects.base import DriveState, End, Kind, Motion, Priority, Procedure, Reply, Request
from dialects.errors import NoAnswer, Refused
from dialects.mcode.host import classify
from dialects.mcode.host.comm_settings import set_wire
from dialects.mcode.host.exchange import (
    INTEGER,
    answered,
    check_error_flag,
    lost,
    mark,
    mcode,
    note_error,
    print_mark,
    who,
)
from dialects.mcode.host.program_mode import enter_program, program_line, put_back
from dialects.mcode.host.resync import attend
from dialects.mcode.host.signatures import Sign, question, sign, signed, value
from dialects.mcode.manual.mnemonic import EXPANDED

if TYPE_CHECKING:
    from dialects.mcode.host.codec import MCode

GLOBAL = ("*", "^")
INPUTS = (1, 2, 3, 4)
EXPANDED_INPUTS = (*INPUTS, 9, 10, 11, 12)
"""The inputs that IN has, the lowest bit first."""
STATUS = ("P", "V", "MV", "BY", "EF", "IN")
"""What tells a drive's state, in the order in which it is printed."""


def perform(state: DriveState, text: str) -> Procedure[tuple[str, ...]]:
    """Send a line and find out what came of it; the printed lines. Raises Refused, NoAnswer or Stopped."""
    request = mcode(state).request(state.address, text)
    if state.address in GLOBAL:
        yield from _broadcast(state, request)
        return ()
    if state.programming:
        return (yield from program_line(state, request))
    if state.restore is not None:
        yield from put_back(state)
        request = mcode(state).request(state.address, text)
    if classify.enters_program(request.text):
        return (yield from enter_program(state, request))
    if classify.word_of(request.text)[0] == "PG":
        raise Refused(f"{who(state)} is not in program mode: 'PG' alone would enter it; say PG and an address")
    return (yield from immediate(state, request))


def immediate(state: DriveState, request: Request) -> Procedure[tuple[str, ...]]:
    """A line that is executed at once, not stored."""
    request = yield from attend(state, request)
    if request.kind is Kind.SETTING:
        yield from set_wire(state, request)
        return ()
    if request.kind is Kind.PRINT:
        return (yield from _print(state, request))
    state.running = state.running or classify.word_of(request.text)[0] == "EX"
    reply = yield from answered(state, request)
    if request.kind is Kind.LIST:
        return (yield from _rest_of_list(state, request, reply))
    if not reply.acknowledged:
        yield from check_error_flag(state, request, silent=reply.end is End.SILENT)
    return reply.lines


def _print(state: DriveState, request: Request) -> Procedure[tuple[str, ...]]:
    """What a person has printed, signed so that it is told from everybody else's lines."""
    request = signed(state, request)
    reply = yield from answered(state, request)
    if reply.end is End.SILENT:
        yield from _printed_nothing(state, request)
    own = sign(state).shown if request.signed else ""
    return tuple(line.removesuffix(own) for line in reply.lines)


def _printed_nothing(state: DriveState, request: Request) -> Procedure[None]:
    """A print that printed nothing was refused, or (EM=2, where not even a line feed comes) is lost."""
    if mcode(state).em == 2:
        state.reply_pending = True
        yield from mark(state, request)
    yield from check_error_flag(state, request)
    if not classify.may_be_blank(request.text, request.expect):
        raise NoAnswer(f"{who(state)} printed nothing for '{request.text}', and has no error")


def _rest_of_list(state: DriveState, request: Request, reply: Reply) -> Procedure[tuple[str, ...]]:
    """EM 1 to 3 give a list no end: a mark printed behind it does."""
    lines = reply.lines
    if mcode(state).em != 0:
        rest = yield from print_mark(state, request.priority)
        if rest is None:
            lost(state)
            raise NoAnswer(f"{who(state)}: the list may be incomplete: its end was not seen; ask again")
        lines += rest[:-1]
        if not lines:
            yield from check_error_flag(state, request)
    return tuple(line for line in lines if line)


def _broadcast(state: DriveState, request: Request) -> Procedure[None]:
    """Nobody answers; so nothing is said to all that must be seen to work."""
    if classify.word_of(request.text)[0] == "PG":
        raise Refused(f"'{request.text}' to all drives would have all of them store what is said next; name one")
    state.settings_unknown = classify.setting_of(request.text) is not None
    yield request
    state.remarks.append(f"{state.address}: no drive answers a command to all; nothing says whether it was executed")


def _not_in_program(state: DriveState, what: str) -> None:
    """Raises Refused where the drive would store the question."""
    if state.programming:
        raise Refused(f"{who(state)} is in program mode and would store it: PG ends that, then {what}")


def listing(state: DriveState, start: str) -> Procedure[tuple[str, ...]]:
    """The program from a label or address, or all of it."""
    _not_in_program(state, "list it")
    return (yield from perform(state, f"L {start}".rstrip()))


def motion(state: DriveState, priority: Priority) -> Procedure[tuple[Motion, ...]]:
    """Position and velocity in one print, so that they belong together and the wire is used half as long.

    The drive's sign stands between them, so that another drive's answer is not taken for this one's.
    """
    _not_in_program(state, "ask again")
    yield from attend(state, replace(_motion(mcode(state), state.address, sign(state)), priority=priority))
    request = replace(_motion(mcode(state), state.address, sign(state)), priority=priority)
    reply = yield request
    note_error(state, reply)
    if reply.end is not End.DONE:
        if reply.end is not End.NAK:
            lost(state)
        raise NoAnswer(f"{who(state)} does not answer ({reply.end.value})")
    found = re.fullmatch(request.expect or "", reply.text)
    assert found is not None
    return (Motion(int(found[1]), int(found[2])),)


def status(state: DriveState) -> Procedure[tuple[str, ...]]:
    """Motion, program, error and inputs in words, from one print; nothing is cleared.

    Every product has the words that are asked: an error could start the drive's error subroutine.
    """
    if state.programming:
        return ("program mode: lines are stored, not executed; PG ends it",)
    asked = '" ",'.join(f"{word}," for word in STATUS).rstrip(",")
    pattern = " ".join((INTEGER, INTEGER, "[01]", "[01]", "[01]", r"\d{1,4}"))
    yield from attend(state, question(state, asked, pattern))
    reply = yield from answered(state, question(state, asked, pattern))
    position, velocity, moving, busy, error, inputs = (int(each) for each in value(state, reply).split())
    state.error = error == 1
    points = EXPANDED_INPUTS if state.product in EXPANDED else INPUTS
    return in_words(position, velocity, moving, busy, error, inputs, points=points)


def in_words(
    position: int, velocity: int, moving: int, busy: int, error: int, inputs: int, *, points: Sequence[int] = INPUTS
) -> tuple[str, ...]:
    """What P, V, MV, BY, EF and IN say, a line for each matter; `points` are the inputs of IN, lowest bit first."""
    return (
        f"moving: V={velocity}, P={position}" if moving or velocity else f"at rest: P={position}",
        "program: running" if busy else "program: none runs",
        "error: one stands (EF=1); PR ER names it and clears it" if error else "error: none",
        "inputs: " + ", ".join(f"{n} {'high' if inputs >> i & 1 else 'low'}" for i, n in enumerate(points)),
    )


@lru_cache(maxsize=256)
def _motion(codec: MCode, address: str, own: Sign) -> Request:
    """Kept, as it is asked fifty times a second."""
    asked = codec.request(address, f"PR P,{own.item},V")
    return replace(asked, expect=f"({INTEGER}){re.escape(own.shown)}({INTEGER})", signed=True)


def flag(state: DriveState, name: str) -> Procedure[bool]:
    """A flag as the drive prints it."""
    _not_in_program(state, "ask again")
    yield from attend(state, question(state, name, "[01]"))
    reply = yield from answered(state, question(state, name, "[01]"))
    return value(state, reply) == "1"
