"""The readings of one drive: values with their times, and the state that they allow to claim."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from itertools import takewhile
from typing import NamedTuple

from multidrop.dialects.by_hand import Variable
from multidrop.dialects.values import Conditions, Pace, Readings
from multidrop.drives.events import Conditioned, Sample, Silent
from multidrop.shell.events import Agreed, Diverged, Phase, Predicted, SettingsRead, TwinEnded, TwinEvent, VariablesRead
from multidrop.tui.figures import NATIVE, Figures
from multidrop.tui.text import age

SPAN = 20.0
"""Seconds of samples that the plot keeps."""
SHORTEST_PERIOD = 0.25
"""Seconds below which no value counts as old, however fast it is polled: people cannot read faster."""
SWITCHES = ("lim-", "lim+")
"""Functions of lamps that end the travel."""
BEHIND = 2.0
"""Seconds between the last sample and the last prediction, after which the prediction counts as old."""
AGED = 1.5
"""Seconds beyond two periods after which conditions count as old."""
LIVELY = 3.0
"""Seconds of faster polling after a line was sent to a drive."""


class ReadoutState(Enum):
    """The state of a drive or a bus: a sign, a word, a role."""

    UNKNOWN = ("·", "open", "dim")
    AT_REST = ("■", "at rest", "text")
    """Of a line: every drive of it was read at rest, and no program runs."""
    NO_CURRENT = ("□", "no current", "strong")
    """At rest without current to hold the load: disabled, or switched off. Of a line: one of its drives."""
    DWELL = ("▷", "dwell", "motion")
    """At rest in a program, which can move the drive at any time. Of a line: a program runs in one of its drives."""
    MOVING = ("▶", "moving", "motion")
    STORING = ("◆", "storing", "strong")
    SILENT = ("?", "silent", "error")
    LOST = ("✗", "lost", "error")
    TROUBLE = ("✗", "error", "error")
    """Of a line: a drive of it has an error or a limit."""
    DIFFERS = ("≠", "twin", "error")
    """Of a line: a drive of it differs from its twin."""

    def __init__(self, sign: str, word: str, role: str) -> None:
        self.sign, self.word, self.role = sign, word, role


READ = (ReadoutState.MOVING, ReadoutState.AT_REST, ReadoutState.DWELL, ReadoutState.NO_CURRENT)
"""The states that were read of a drive, which can be outdated."""


class PlottedPoint(NamedTuple):
    """A sample as plotted."""

    at: float
    position: int
    velocity: int


@dataclass
class Travelled:
    """The range of positions of an axis, and the positions at which its limit switches were active."""

    low: int | None = None
    high: int | None = None
    at_switch: dict[str, int] = field(default_factory=dict)
    """By the function of the switch: `lim+` and `lim-`."""

    def reach(self, sample: Sample, before: PlottedPoint | None, pace: Pace | None) -> None:
        """Take a position; forget all earlier ones if the drive cannot have moved there, so it counts otherwise now."""
        position = sample.position
        if before is not None and pace is not None and sample.velocity == before.velocity == 0:
            took = sample.at - before.at
            farthest = pace.initial * took + max(pace.acceleration, pace.deceleration) * took * took / 4
            if abs(position - before.position) > 2 * farthest + 1:
                self.low = self.high = None
                self.at_switch.clear()
        self.low = position if self.low is None else min(self.low, position)
        self.high = position if self.high is None else max(self.high, position)

    def learn(self, conditions: Conditions, position: int) -> None:
        for lamp in conditions.lamps:
            if lamp.on and lamp.function in SWITCHES:
                self.at_switch[lamp.function] = position


@dataclass
class ProgramFacts:
    """The program in a drive as last read, and the last place of an observed one."""

    lines: tuple[tuple[int, str], ...] = ()
    read_at: float | None = None
    """None: not read in this session."""
    line: int | None = None
    """The address at which it was seen; None: not known, or no program runs."""
    phase: Phase = Phase.EXECUTES
    break_point: str = ""
    seen_at: float = -math.inf
    name: str = ""
    """The program that ran or was paused when that was last read, or `running`; empty: none."""
    ran: bool = False
    """One ran then, which can move the drive."""
    known_at: float = -math.inf
    """When that was read, with the conditions or to confirm a stop."""
    stopped_at: float = -math.inf
    """Time of the last stop: no program that was read before it is known to run."""

    @property
    def runs(self) -> bool:
        return self.ran and not self.past

    @property
    def past(self) -> bool:
        return self.known_at <= self.stopped_at


@dataclass
class TwinReadout:
    """The twin of an axis: its last prediction, and since when the two are apart."""

    predicted: Predicted | None = None
    diverged: Diverged | None = None
    """None: they agree."""

    def behind(self, last: PlottedPoint | None) -> bool:
        """True if the samples have gone on without predictions."""
        return self.predicted is not None and last is not None and last.at - self.predicted.at > BEHIND

    def take(self, event: Predicted | Diverged | Agreed) -> None:
        """Take an event of this axis's twin."""
        if isinstance(event, Predicted):
            self.predicted = event
        else:
            self.diverged = event if isinstance(event, Diverged) else None


@dataclass
class Readout:
    """The values read from one drive, and their times."""

    last: PlottedPoint | None = None
    silent_since: float | None = None
    """Infinite: the line of a drive that was never read is silent."""
    touched: float = -math.inf
    """Time when a line was last sent to the drive: earlier values may be outdated."""
    failed_at: float = -math.inf
    """Time when a line for the drive last failed: its error is known."""
    failure: tuple[str, float] | None = None
    """The last error that the drive gave with its number, and when."""
    sent: tuple[str, float] | None = None
    """The last line for this drive alone, and when."""
    moved_at: float = -math.inf
    """Time at which an axis was last read in motion."""
    period: float = 0.0
    """Seconds between the requested polls; 0: as fast as the wire allows."""
    points: deque[PlottedPoint] = field(default_factory=lambda: deque(maxlen=4096))
    axis: str = ""
    """The axis of these values; empty if the drive has only one."""
    trouble: str = ""
    """The trouble of this axis, in words."""
    others: dict[str, Readout] = field(default_factory=dict)
    """The drive's further axes."""
    program: ProgramFacts = field(default_factory=ProgramFacts)
    conditions: Conditions | None = None
    """The conditions of this axis as last read."""
    conditioned_at: float = -math.inf
    watched: float = 0.0
    """Seconds between two readings of the conditions."""
    travel: Travelled = field(default_factory=Travelled)
    settings: Readings | None = None
    """Every setting, as last read in this session."""
    settings_at: float = -math.inf
    variables: tuple[Variable, ...] | None = None
    """The variables of its programs, as last read in this session."""
    variables_at: float = -math.inf
    twin: TwinReadout | None = None
    """The twin of this axis; None: none runs."""
    figures: Figures = NATIVE
    """The form in which its numbers are shown."""
    sparks: dict[object, tuple[object, str]] = field(default_factory=dict)
    """The small curves that were drawn last, by what each shows, and the time of each."""

    @property
    def axes(self) -> list[Readout]:
        """All axes of the drive, the first one first."""
        return [self, *self.others.values()]

    def show_in(self, figures: Callable[[str], Figures]) -> None:
        """Show the numbers of each axis, by its name, in these figures from now on."""
        for axis in self.axes:
            axis.figures = figures(axis.axis)

    def take(self, sample: Sample) -> None:
        """Take the reply to a poll. The axis of the first sample becomes the first axis."""
        if self.last is None:
            self.axis = sample.axis
        if sample.velocity:
            self.moved_at = sample.at
        if sample.program is not None:
            for program in (each.program for each in self.axes):
                program.name = (program.name or "running") if sample.program else ""
                program.ran, program.known_at = sample.program, sample.at
        if sample.axis != self.axis:
            self.others.setdefault(sample.axis, Readout()).take(sample)
            return
        self.trouble = sample.trouble
        before, pace = self.last, self.conditions.pace if self.conditions is not None else None
        self.travel.reach(sample, before, pace)
        self.last = PlottedPoint(sample.at, sample.position, sample.velocity)
        self.silent_since = None
        self.points.append(self.last)
        while self.points[0].at < sample.at - SPAN - 2:
            self.points.popleft()

    def repeats(self, sample: Sample) -> bool:
        """True if a sample of a drive at rest says what the one before it said."""
        known = self if sample.axis == self.axis else self.others.get(sample.axis)
        if known is None or known.last is None or known.silent_since is not None or self.touched > known.last.at:
            return False
        before = (known.last.position, known.last.velocity, known.trouble)
        ran = known.program.ran if sample.program is None else sample.program
        return (*before, known.program.ran) == (sample.position, 0, sample.trouble, ran) and sample.velocity == 0

    def condition(self, at: float, conditions: Sequence[Conditions]) -> None:
        """Take the conditions of every axis; those of the first one are this readout's."""
        runs = next((each.runs for each in conditions if each.runs is not None), None)
        for number, condition in enumerate(conditions):
            axis = self if number == 0 else self.others.setdefault(condition.axis, Readout(axis=condition.axis))
            axis.conditions, axis.conditioned_at, axis.watched = condition, at, self.watched
            if runs is not None:
                axis.program.name, axis.program.ran, axis.program.known_at = condition.program, runs, at
            if axis.last is not None and axis.last.velocity == 0:
                axis.travel.learn(condition, axis.last.position)

    def recurs(self, event: Conditioned) -> bool:
        """True if conditions say what those before said, which were not outdated yet."""
        known = [axis.conditions for axis in self.axes if axis.conditions is not None]
        current = not self.aged(self.conditioned_at) and event.at - self.conditioned_at < 2 * max(self.watched, 1.0)
        return current and known == list(event.conditions)

    def note(self, event: Sample | Silent | Conditioned) -> None:
        if isinstance(event, Sample):
            self.take(event)
        elif isinstance(event, Conditioned):
            self.condition(event.at, event.conditions)
        else:
            self.no_answer(event.at)

    def compare(self, event: TwinEvent) -> None:
        if isinstance(event, TwinEnded):
            for each in self.axes:
                each.twin = None
            return
        if self.last is None and self.twin is None:
            self.axis = event.axis  # a prediction that comes before its sample
        axis = self if event.axis == self.axis else self.others.setdefault(event.axis, Readout(axis=event.axis))
        axis.twin = axis.twin or TwinReadout()
        axis.twin.take(event)

    def predicted(self, event: Predicted) -> bool:
        """True if the prediction of a drive at rest says what the one before it said."""
        known = self if event.axis == self.axis else self.others.get(event.axis)
        if known is None or known.twin is None or (before := known.twin.predicted) is None:
            return False
        return event.velocity == 0 and before._replace(at=event.at) == event

    def take_read(self, event: SettingsRead | VariablesRead) -> None:
        """Take settings or variables that were read; after a restart both are unknown again."""
        if isinstance(event, VariablesRead):
            self.variables, self.variables_at = event.variables, event.at
            return
        self.settings, self.settings_at = event.readings if event.known else None, event.at
        self.variables = self.variables if event.known else None

    def no_answer(self, at: float) -> None:
        """Note that the drive did not reply to a poll."""
        if self.silent_since is None:
            self.silent_since = at if self.last is None else self.last.at

    def old(self, now: float) -> bool:
        """True if the last value is older than twice its period, or than a line that may have changed it."""
        if self.last is None:
            return True
        return now - self.last.at > 2 * max(self.period, SHORTEST_PERIOD) or self.overtaken(now)

    @property
    def stopped_since(self) -> bool:
        """True if a stop came after the last value was read."""
        return self.last is not None and self.last.at <= self.program.stopped_at

    def overtaken(self, now: float) -> bool:
        """True if a line was sent after the last value was read, and the next value is not about to arrive."""
        return self.last is not None and self.touched > self.last.at and now - self.last.at > SHORTEST_PERIOD

    def aged(self, now: float) -> bool:
        return self._aged(self.conditioned_at, now)

    def program_aged(self, now: float) -> bool:
        return self._aged(self.program.known_at, now)

    def _aged(self, at: float, now: float) -> bool:
        return at <= self.program.stopped_at or now - at > 2 * max(self.watched, 1.0) + AGED

    def busy(self, now: float) -> bool:
        """True if the drive moves, or may have started: a reason to poll it more often."""
        return now - self.touched < LIVELY or self._moves

    @property
    def in_trouble(self) -> bool:
        """True if an axis has an error or a limit, as last read."""
        return any(each.trouble or (each.conditions is not None and each.conditions.error) for each in self.axes)

    @property
    def differs(self) -> bool:
        return any(each.twin is not None and each.twin.diverged is not None for each in self.axes)

    @property
    def no_current(self) -> str:
        """The reason for which this axis has no current at rest, as last read."""
        return self.conditions.no_current if self.conditions is not None else ""

    @property
    def own_state(self) -> ReadoutState:
        if self.last is not None and self.last.velocity != 0:
            return ReadoutState.MOVING
        if self.program.runs and not (self.conditions is not None and self.conditions.disabled):
            return ReadoutState.DWELL
        return ReadoutState.NO_CURRENT if self.no_current else ReadoutState.AT_REST

    @property
    def _moves(self) -> bool:
        return any(each.last is not None and each.last.velocity != 0 for each in self.axes)

    def rate(self, now: float) -> float:
        return sum(1 for _ in takewhile(lambda point: point.at >= now - 2, reversed(self.points))) / 2

    def state(self, *, storing: bool = False) -> ReadoutState:
        if storing:
            return ReadoutState.STORING
        if self.silent_since is not None:
            return ReadoutState.SILENT
        if self.last is None:
            return ReadoutState.UNKNOWN
        if self._moves:
            return ReadoutState.MOVING
        states = [each.own_state for each in self.axes]
        return ReadoutState.NO_CURRENT if ReadoutState.NO_CURRENT in states else states[0]

    def words(self, now: float, *, storing: bool = False) -> str:
        """The state in words, with its duration, or with its age if it may be outdated."""
        state = self.state(storing=storing)
        if state is ReadoutState.SILENT and self.silent_since is not None and math.isfinite(self.silent_since):
            return f"silent {age(now - self.silent_since)}"
        if state is ReadoutState.UNKNOWN:
            return "not read yet"
        if state in READ and self.last is not None and self.old(now):
            return f"{'moving' if state is ReadoutState.MOVING else 'at rest'} {age(now - self.last.at)} ago"
        return state.word
