"""Conversations with a controller: typed commands, motion of both axes, programs, status in words."""

from __future__ import annotations

import re

from multidrop.dialects.codec import Priority, Procedure, Request
from multidrop.dialects.errors import Inexpressible, Refused
from multidrop.dialects.family import Motion, Referencing
from multidrop.dialects.pmx.host.codec import PmxState
from multidrop.dialects.pmx.host.exchange import answered, beyond_doubt, number, who
from multidrop.dialects.pmx.manual import status as words
from multidrop.dialects.pmx.manual.table import AXES, grouped

OK = "OK"
LATER = ("DN", "DB")
"""Words that take effect after STORE and a power cycle (6.2.2, 6.3)."""
HOMING = re.compile(r"(?:H|L|ZH|Z|HL)([XY])[+-]", re.ASCII)
SETS = re.compile(r"P([XY])=", re.ASCII)
PROGRAMS = (0, 1)
POINTS = (("DI", "inputs on"), ("DO", "outputs on"), ("EO", "motor drivers on"))


def perform(known: PmxState, text: str) -> Procedure[tuple[str, ...]]:
    """Send a command as typed; return the printed lines. Raises Refused, NoAnswer, Stopped or Inexpressible."""
    check(known, text)
    reply = yield from answered(known, known.codec.request(known.address, text))
    name, sets, _ = text.strip().partition("=")
    if sets and name in LATER:
        known.remark(f"{who(known)}: {name} acts after STORE and a power cycle")
    return () if reply.text == OK else reply.lines


def check(known: PmxState, text: str) -> None:
    """Raise Inexpressible for a command with a number in groups of digits."""
    if wrong := grouped(text):
        raise Inexpressible(f"'{text}': {wrong}; nothing was sent")


def motion(known: PmxState, priority: Priority) -> Procedure[tuple[Motion, ...]]:
    """Read position, speed and status of each axis; a poll skips the speed of an axis that rests."""
    doubts: list[Request] = []
    found = []
    for axis in AXES:
        position = yield from number(known, f"P{axis}", priority, doubts)
        state = yield from number(known, f"MST{axis}", priority, doubts)
        speed = 0
        if state & words.MOVING or priority is not Priority.POLL:
            speed = yield from number(known, f"PS{axis}", priority, doubts)
        found.append(Motion(position, speed, axis.lower(), words.trouble_words(state)))
    if doubts:
        yield from beyond_doubt(known, doubts[0])
    return tuple(found)


def referencing(known: PmxState, text: str) -> Referencing | None:
    """Find out whether a command homes an axis or sets its position. (7.10.)"""
    if found := HOMING.fullmatch(text.strip()):
        return Referencing(found[1].lower(), homing=True)
    found = SETS.match(text.strip())
    return Referencing(found[1].lower(), homing=False) if found else None


def homed(known: PmxState) -> Procedure[bool]:
    return not any(axis.trouble for axis in (yield from motion(known, Priority.OPERATOR)))


def moving(known: PmxState) -> Procedure[bool]:
    for axis in AXES:
        if (yield from number(known, f"MST{axis}")) & words.MOVING:
            return True
    return False


def busy(known: PmxState) -> Procedure[bool]:
    for program in PROGRAMS:
        if (yield from number(known, f"SASTAT{program}")) == 1:
            return True
    return False


def status(known: PmxState) -> Procedure[tuple[str, ...]]:
    lines = []
    for axis in AXES:
        state = yield from number(known, f"MST{axis}")
        loop = yield from number(known, f"SLS{axis}")
        lines.append(f"{axis}: {', '.join(words.status_words(state))}; StepNLoop {words.loop_words(loop)}")
    for program in PROGRAMS:
        lines.append(f"program {program}: {words.program_words((yield from number(known, f'SASTAT{program}')))}")
    for word, what in POINTS:
        bits = yield from number(known, word)
        on = ", ".join(str(n + 1) for n in range(bits.bit_length()) if bits >> n & 1)
        lines.append(f"{what}: {on or 'none'}")
    return tuple(lines)


def troubles(known: PmxState) -> Procedure[None]:
    """Note the errors that are set, with their remedies. Clears none."""
    for axis in AXES:
        try:
            state = yield from number(known, f"MST{axis}")
            loop = yield from number(known, f"SLS{axis}")
        except Refused:
            continue
        if state & words.LIMIT_ERROR:
            known.note(f"{who(known)}: {axis} has a {words.trouble_words(state)}; CLR{axis} clears it")
        if loop in words.LOOP_ERRORS:
            known.note(f"{who(known)}: StepNLoop of {axis} is in {words.loop_words(loop)}; CLR{axis} clears it")
