"""Recording a macro from lines and the times at which they were typed. Reads no clock.

A pause of a person says how long it took that day. So a wait may stand in its place, for a text, an input, or the end
of a motion. It says what was waited for, and it fails in time.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from multidrop.base.errors import Diagnostic
from multidrop.base.text import visible
from multidrop.macros.model import Macro, MacroStep, check_name, escape

LONG = 1.0
"""The shortest pause in whose place a wait is offered, s."""
REACTION = 5.0
"""The time in which a person reacts to what ended the pause, s."""
SHORTEST_WAIT = 10
"""The shortest time limit of a wait that is offered, s."""
MOST_KEPT_EVENTS = 10_000
"""The number of events that are kept of each kind."""
_FIXED = re.compile(r"[^\d\"'{}\s][^\d\"'{}]*")
_WAITS = ("/wait", "/sleep")


@dataclass(frozen=True)
class WaitOffer:
    """A wait in place of the pause before a step; steps count from 1."""

    step: int
    line: str
    pause: float

    @property
    def text(self) -> str:
        return f"before step {self.step}, {self.line} for the pause of {self.pause:.1f} s"


@dataclass
class Observed:
    """The actions of drives during a recording, with times, s."""

    texts: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=MOST_KEPT_EVENTS))
    """Each line that a drive printed by itself."""
    inputs: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=MOST_KEPT_EVENTS))
    """Each change of an input, as a condition: `@press:a I1=1`."""
    moving: deque[tuple[float, bool]] = field(default_factory=lambda: deque(maxlen=MOST_KEPT_EVENTS))
    """Each reading of a velocity: whether it was not 0."""


def offers(lines: Sequence[Recorded], observed: Observed) -> list[WaitOffer]:
    waits, moved = [], False
    for number, (before, line) in enumerate(zip(lines, lines[1:], strict=False), 2):
        waited = _is_wait(before)
        moved = before.starts or (moved and not waited)
        if line.at - before.at < LONG or waited or _is_wait(line):
            continue
        if wait := _ended_by(before.at, line.at, moved, observed):
            pause = line.at - before.at
            waits.append(WaitOffer(number, f"{wait} {max(SHORTEST_WAIT, math.ceil(3 * pause))}", pause))
            moved = False
    return waits


def with_waits(macro: Macro, found: Sequence[WaitOffer]) -> Macro:
    """The macro with the waits in place of those pauses."""
    waits = {offer.step: offer.line for offer in found}
    steps: list[MacroStep] = []
    for number, step in enumerate(macro.steps, 1):
        if number in waits:
            steps.append(MacroStep(0.0, escape(waits[number])))
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


def _is_wait(line: Recorded) -> bool:
    return line.line.split()[:1] in ([word] for word in _WAITS)


REPLIES = 20
"""The number of replies that a step keeps."""
LONGEST_KEPT_TEXT = 200
"""The characters of a reply that a step keeps."""


@dataclass(eq=False)
class Recorded:
    """One line under recording."""

    line: str
    at: float
    drive: str = ""
    starts: bool = False
    heard: list[str] = field(default_factory=list)

    def came_back(self, texts: Iterable[str]) -> None:
        self.heard += texts

    @property
    def replies(self) -> tuple[str, ...]:
        """The replies, cut to a length that people read."""
        kept = []
        for text in map(visible, self.heard[:REPLIES]):
            kept.append(
                text if len(text) <= LONGEST_KEPT_TEXT else f"{text[:LONGEST_KEPT_TEXT]}... ({len(text)} characters)"
            )
        more = len(self.heard) - REPLIES
        return (*kept, *([f"... {more} more"] if more > 0 else []))


class Recorder:
    """Records one macro at a time. Times are seconds of any one clock."""

    def __init__(self) -> None:
        self.name = ""
        """The macro under recording; empty: none."""
        self.before: bytes | None = None
        """The bytes of its file when the recording began; None without a file."""
        self._begun = ""
        self._recorded: list[Recorded] = []
        self.observed = Observed()
        """The actions of drives since the recording began."""

    def start(self, name: str, now: float, before: bytes | None = None, time: str = "") -> None:
        """Begin. `time`: the time of day, for the file.

        Raises Diagnostic for an invalid name, and while another macro is recorded. The time from `now` to the first
        line is not recorded: a macro starts with its first line.
        """
        check_name(name)
        if self.name:
            raise Diagnostic(f"the macro {self.name} is being recorded", hint="stop that recording first")
        self.name, self.before, self._begun, self._recorded, self.observed = name, before, time, [], Observed()

    def record(self, line: str, now: float, drive: str = "", starts: bool = False) -> Recorded:
        """Record a line, its braces doubled so that playing returns it; what comes back is added to the result.

        `starts`: it can start motion or a program. Without a recording nothing is kept.
        """
        recorded = Recorded(escape(line), now, drive, starts)
        if self.name:
            self._recorded.append(recorded)
        return recorded

    def macro(self) -> Macro:
        """The macro recorded so far, times rounded to ms. Call `discard` once it is stored.

        Raises Diagnostic if nothing was typed, and ends the recording.
        """
        name = self.name
        if not name:
            raise Diagnostic("no macro is being recorded", hint="start one first")
        if not self._recorded:
            self.discard()
            raise Diagnostic(f"nothing was typed for the macro {name}", hint="it is not stored; record it again")
        first = before = self._recorded[0].at
        steps = []
        for (
            recorded
        ) in self._recorded:  # offsets from the first line are rounded, not gaps: a long macro does not drift
            gap = round(recorded.at - first, 3) - round(before - first, 3)
            steps.append(MacroStep(max(0.0, round(gap, 3)), recorded.line, recorded.drive, recorded.replies))
            before = recorded.at
        return Macro(name, tuple(steps), recorded=self._begun)

    @property
    def offers(self) -> list[WaitOffer]:
        return offers(self._recorded, self.observed)

    def discard(self) -> None:
        self.name, self.before, self._recorded = "", None, []
