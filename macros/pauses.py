"""Recorded pauses, and the waits that may stand in their place: for a text, an input, or the end of a motion.

A pause of a person says how long it took that day. A wait says what was waited for, and it fails in time.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from multidrop.macros.braces import escape
from multidrop.macros.model import Macro, Step

LONG = 1.0
"""The shortest pause in whose place a wait is offered, s."""
REACTION = 5.0
"""The time in which a person reacts to what ended the pause, s."""
LEAST = 10
"""The shortest time limit of a wait that is offered, s."""
KEPT = 10_000
"""The number of events that are kept of each kind."""
_FIXED = re.compile(r"[^\d\"'{}\s][^\d\"'{}]*")
_WAITS = ("/wait", "/sleep")


class Line(Protocol):
    """A line under recording."""

    @property
    def line(self) -> str:
        """Its text."""

    @property
    def at(self) -> float:
        """The time at which it was typed, s."""

    @property
    def starts(self) -> bool:
        """Whether it can start motion or a program."""


@dataclass(frozen=True)
class Offer:
    """A wait in place of the pause before a step; steps count from 1."""

    step: int
    line: str
    pause: float

    @property
    def text(self) -> str:
        """The offer in words."""
        return f"before step {self.step}, {self.line} for the pause of {self.pause:.1f} s"


@dataclass
class Observed:
    """The actions of drives during a recording, with times, s."""

    texts: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=KEPT))
    """Each line that a drive printed by itself."""
    inputs: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=KEPT))
    """Each change of an input, as a condition: `@press:a I1=1`."""
    moving: deque[tuple[float, bool]] = field(default_factory=lambda: deque(maxlen=KEPT))
    """Each reading of a velocity: whether it was not 0."""


def offers(lines: Sequence[Line], observed: Observed) -> list[Offer]:
    """The waits that fit a recording, each in place of one pause."""
    found, moved = [], False
    for number, (before, line) in enumerate(zip(lines, lines[1:], strict=False), 2):
        waited = _is_wait(before)
        moved = before.starts or (moved and not waited)
        if line.at - before.at < LONG or waited or _is_wait(line):
            continue
        if wait := _ended_by(before.at, line.at, moved, observed):
            pause = line.at - before.at
            found.append(Offer(number, f"{wait} {max(LEAST, math.ceil(3 * pause))}", pause))
            moved = False
    return found


def with_waits(macro: Macro, found: Sequence[Offer]) -> Macro:
    """The macro with the waits in place of those pauses."""
    waits = {offer.step: offer.line for offer in found}
    steps: list[Step] = []
    for number, step in enumerate(macro.steps, 1):
        if number in waits:
            steps.append(Step(0.0, escape(waits[number])))
            step = replace(step, after=0.0)
        steps.append(step)
    return replace(macro, steps=tuple(steps))


def _ended_by(begin: float, end: float, moved: bool, observed: Observed) -> str:
    """The wait for what ended a pause; empty where nothing is known of it."""
    last = max(begin, end - REACTION)
    for at, text in reversed(observed.texts):
        if last <= at <= end and (match := max(_FIXED.findall(text), key=len, default="").strip()) and len(match) > 2:
            return f'/wait "{match}"'
    for at, condition in reversed(observed.inputs):
        if last <= at <= end:
            return f"/wait {condition}"
    readings = [moving for at, moving in observed.moving if begin <= at <= end]
    stood_up = any(readings) and not readings[-1]
    return "/wait stopped" if stood_up or (moved and not readings) else ""


def _is_wait(line: Line) -> bool:
    return line.line.split()[:1] in ([word] for word in _WAITS)
