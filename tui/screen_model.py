"""The screen's memory: session events, folded into records for transcripts and readouts for drives.

It stores what was printed and read, with times; it sends nothing and decides nothing. Each state is true at the time of
the last sample, and was read from the drive. A drive is stopped when its velocity was read as 0, silent when it did not
reply, and unknown until the first poll. A state that may be outdated stays, with its age, until the next one is read.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from dialects.conditions import Conditions, Pace
from dialects.parameters import Readings
from drives.events import Conditioned, Ended, Sample, Sent, Silent, Traffic, Unsolicited, Valued
from shell.events import (
    By,
    Bytes,
    Entered,
    Failed,
    Notified,
    OnBus,
    Output,
    Phase,
    Printed,
    ProgramRead,
    ProgramSeen,
    Progressed,
    SessionEvent,
    SettingsRead,
    StateChanged,
)
from shell.lines import EVERYONE
from tui import happenings
from tui.curves.look import Look
from tui.curves.trace import Traces
from tui.text import age
from tui.traffic import TrafficStore

KEPT = 50_000
"""Records that a transcript keeps."""
SPAN = 20.0
"""Seconds of samples that the plot keeps."""
SHORTEST = 0.25
"""Seconds below which no value counts as old, however fast it is polled: people cannot read faster."""
SWITCHES = ("lim-", "lim+")
"""Functions of lamps that end the travel."""
LIVELY = 3.0
"""Seconds of faster polling after a line was sent to a drive."""


class Record(NamedTuple):
    """One line. `mark` is a key of `gutter.MARKS`; `address` may be empty; `columns` marks text in columns."""

    at: float
    address: str
    mark: str
    text: str
    columns: bool = False
    mine: bool = True
    """A person typed the line, or the one that it answers."""
    help: str = ""
    """The line that explains it: `/help 35`."""


class State(Enum):
    """The state of a drive or a bus: a sign, a word, a role."""

    UNKNOWN = ("·", "open", "dim")
    IDLE = ("■", "idle", "text")
    STOPPED = ("■", "stopped", "text")
    MOVING = ("▶", "moving", "motion")
    STORING = ("◆", "storing", "strong")
    SILENT = ("?", "silent", "error")
    LOST = ("✗", "lost", "error")
    TROUBLE = ("✗", "error", "error")
    """Of a line: a drive of it has an error or a limit."""

    @property
    def sign(self) -> str:
        """The sign, one cell wide."""
        return self.value[0]

    @property
    def word(self) -> str:
        """The state in one word."""
        return self.value[1]

    @property
    def role(self) -> str:
        """The role that selects the style."""
        return self.value[2]


class Point(NamedTuple):
    """A sample as plotted."""

    at: float
    position: int
    velocity: int


@dataclass
class Travelled:
    """Where an axis was seen: the range of its positions, and the positions at which limit switches were active."""

    low: int | None = None
    high: int | None = None
    at_switch: dict[str, int] = field(default_factory=dict)
    """By the function of the switch: `lim+` and `lim-`."""

    def reach(self, sample: Sample, before: Point | None, pace: Pace | None) -> None:
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
        """Note the position of an axis at rest on a limit switch."""
        for lamp in conditions.lamps:
            if lamp.on and lamp.function in SWITCHES:
                self.at_switch[lamp.function] = position


@dataclass
class ProgramFacts:
    """What was read of the program in a drive, and where an observed one was seen last."""

    lines: tuple[tuple[int, str], ...] = ()
    read_at: float | None = None
    """None: not read in this session."""
    line: int | None = None
    """The address at which it was seen; None: not known, or no program runs."""
    phase: Phase = Phase.EXECUTES
    break_point: str = ""
    seen_at: float = -math.inf


@dataclass
class Readout:
    """The values read from one drive, and their times."""

    last: Point | None = None
    silent_since: float | None = None
    touched: float = -math.inf
    """Time when a line was last sent to the drive: earlier values may be outdated."""
    failed_at: float = -math.inf
    """Time when a line for the drive last failed: its error is known."""
    period: float = 0.0
    """Seconds between the requested polls; 0: as fast as the wire allows."""
    points: deque[Point] = field(default_factory=lambda: deque(maxlen=4096))
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

    @property
    def axes(self) -> list[Readout]:
        """All axes of the drive, the first one first."""
        return [self, *self.others.values()]

    def take(self, sample: Sample) -> None:
        """Take the reply to a poll. The axis of the first sample becomes the first axis."""
        if self.last is None:
            self.axis = sample.axis
        if sample.axis != self.axis:
            self.others.setdefault(sample.axis, Readout()).take(sample)
            return
        self.trouble = sample.trouble
        before, pace = self.last, self.conditions.pace if self.conditions is not None else None
        self.travel.reach(sample, before, pace)
        self.last = Point(sample.at, sample.position, sample.velocity)
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
        return before == (sample.position, 0, sample.trouble) and sample.velocity == 0

    def condition(self, at: float, conditions: Sequence[Conditions]) -> None:
        """Take the conditions of every axis; those of the first one are this readout's."""
        for number, each in enumerate(conditions):
            axis = self if number == 0 else self.others.setdefault(each.axis, Readout(axis=each.axis))
            axis.conditions, axis.conditioned_at, axis.watched = each, at, self.watched
            if axis.last is not None and axis.last.velocity == 0:
                axis.travel.learn(each, axis.last.position)

    def note(self, event: Sample | Silent | Conditioned) -> None:
        """Take what a bus has read."""
        if isinstance(event, Sample):
            self.take(event)
        elif isinstance(event, Conditioned):
            self.condition(event.at, event.conditions)
        else:
            self.no_answer(event.at)

    def no_answer(self, at: float) -> None:
        """Note that the drive did not reply to a poll."""
        if self.silent_since is None:
            self.silent_since = at if self.last is None else self.last.at

    def old(self, now: float) -> bool:
        """True if the last value is older than twice its period, or than a line that may have changed it."""
        if self.last is None:
            return True
        return now - self.last.at > 2 * max(self.period, SHORTEST) or self.overtaken(now)

    def overtaken(self, now: float) -> bool:
        """True if a line was sent after the last value was read, and the next value is not about to arrive."""
        return self.last is not None and self.touched > self.last.at and now - self.last.at > SHORTEST

    def busy(self, now: float) -> bool:
        """True if the drive moves, or may have started: a reason to poll it more often."""
        return now - self.touched < LIVELY or self._moves

    @property
    def in_trouble(self) -> bool:
        """Whether an axis has an error or a limit, as last read."""
        return any(each.trouble or (each.conditions is not None and each.conditions.error) for each in self.axes)

    @property
    def _moves(self) -> bool:
        return any(each.last is not None and each.last.velocity != 0 for each in self.axes)

    def rate(self, now: float) -> float:
        """Samples per second over the last two seconds."""
        recent = 0
        for point in reversed(self.points):
            if point.at < now - 2:
                break
            recent += 1
        return recent / 2

    def state(self, *, storing: bool = False) -> State:
        """The state that was last read."""
        if storing:
            return State.STORING
        if self.silent_since is not None:
            return State.SILENT
        if self.last is None:
            return State.UNKNOWN
        return State.MOVING if self._moves else State.STOPPED

    def words(self, now: float, *, storing: bool = False) -> str:
        """The state in words, with its duration, or with its age if it may be outdated."""
        state = self.state(storing=storing)
        if state is State.SILENT and self.silent_since is not None:
            return f"silent {age(now - self.silent_since)}"
        if state is State.UNKNOWN:
            return "not read yet"
        if state in (State.MOVING, State.STOPPED) and self.last is not None and self.old(now):
            ago = age(now - self.last.at)
            return f"{'moved' if state is State.MOVING else 'stood'} {ago}{'' if 'min' in ago else ' ago'}"
        return state.word


@dataclass
class BusFacts:
    """The records and values of one bus."""

    fresh: deque[Record] = field(default_factory=lambda: deque(maxlen=KEPT))
    """Records that no transcript has taken yet."""
    readouts: dict[str, Readout] = field(default_factory=dict)
    traffic: TrafficStore = field(default_factory=TrafficStore)

    def readout(self, address: str) -> Readout:
        """The readout of a drive, empty at first."""
        return self.readouts.setdefault(address, Readout())


class ScreenModel:
    """All facts on the screen, by bus.

    `current` names the bus for events without one; `opened` returns the names of the open buses.
    """

    def __init__(self, current: Callable[[], str], opened: Callable[[], Container[str]]) -> None:
        self.buses: dict[str, BusFacts] = {}
        self.traces, self.look = Traces(), Look()
        """What is plotted, and how a person looks at it."""
        self.changed = True
        """Buses, drives, selection or latch may have changed."""
        self.trouble = ""
        """The last failure or warning, for screens without a transcript."""
        self.progress = ""
        """The progress of the job that runs, in words."""
        self._current, self._opened = current, opened
        self._takers: dict[type, Callable[..., None]] = {
            Entered: self._entered,
            Printed: self._printed,
            Output: self._output,
            Notified: self._narrated,
            Failed: self._failed,
            OnBus: self._on_bus,
            Bytes: self._bytes,
            Progressed: self._progressed,
            ProgramRead: self._program_read,
            SettingsRead: self._settings_read,
            ProgramSeen: self._program_seen,
            StateChanged: self._state_changed,
        }

    def take(self, event: SessionEvent) -> None:
        """Fold one event in."""
        self._takers[type(event)](event)

    def quiet(self, event: SessionEvent) -> bool:
        """True if an event alone is no reason to paint: bytes on the wire, or values that are those before."""
        if not isinstance(event, OnBus):
            return False
        inner = event.event
        if isinstance(inner, Sample):
            return self.bus(event.bus).readout(inner.address).repeats(inner)
        return isinstance(inner, Traffic | Sent | Ended)

    def bus(self, name: str) -> BusFacts:
        """The facts of a bus; an empty name is the current one."""
        return self.buses.setdefault(name or self._current(), BusFacts())

    def page(self, name: str) -> deque[Record]:
        """The place for records of a bus; those of a bus that is not open go to the current page."""
        return self.bus(name if name in self._opened() else "").fresh

    def rename(self, before: str, now: str) -> None:
        """Know a bus by another name."""
        self.buses[now] = self.buses.pop(before, BusFacts())
        self.traces.rename(before, now)

    def forget(self, name: str) -> None:
        """Forget a closed bus."""
        self.buses.pop(name, None)
        self.traces.forget(name)

    def _entered(self, event: Entered) -> None:
        if event.bus:
            self._touch(self.bus(event.bus), event.address, event.at)
        mark = ">" if event.by is By.OPERATOR else "»"
        self.page(event.bus).append(Record(event.at, event.address, mark, event.line, mine=event.by is By.OPERATOR))

    def stopped(self, at: float) -> None:
        """Mark all values as possibly outdated after a stop, so that all drives are polled."""
        for facts in self.buses.values():
            self._touch(facts, EVERYONE[0], at)
        self.changed = True

    @staticmethod
    def _touch(facts: BusFacts, address: str, at: float) -> None:
        touched = facts.readouts.values() if address in EVERYONE else [facts.readout(address)]
        for readout in touched:
            readout.touched = at

    def _printed(self, event: Printed) -> None:
        self.page(event.bus).append(Record(event.at, event.address, "", event.text, mine=event.by is By.OPERATOR))

    def _output(self, event: Output) -> None:
        self.page("").append(Record(event.at, "", "", event.text, columns=event.columns))

    def _narrated(self, event: Notified) -> None:
        if event.warning:
            self.trouble = event.text
        mark = "!" if event.warning else "."
        self.page(event.bus).append(Record(event.at, "", mark, event.text))

    def _failed(self, event: Failed) -> None:
        self.trouble = event.text
        if event.bus and event.address:
            self.bus(event.bus).readout(event.address).failed_at = event.at
        explained = "" if event.code is None else f"/help {event.code}"
        mine = event.by is By.OPERATOR
        self.page(event.bus).append(Record(event.at, event.address, "x", event.text, mine=mine, help=explained))

    def _on_bus(self, event: OnBus) -> None:
        inner = event.event
        if isinstance(inner, Sample | Valued):
            self.traces.take(event.bus, inner)
        if isinstance(inner, Sample | Silent | Conditioned):
            readout = self.bus(event.bus).readout(inner.address)
            happened = list(happenings.of(readout, inner))
            readout.note(inner)
            for each in happened:
                mark = "!" if each.warning else "."
                self.page(event.bus).append(Record(inner.at, inner.address, mark, each.text, help=each.help))
        elif self.bus(event.bus).traffic.take(inner):
            return
        elif isinstance(inner, Unsolicited):
            self.page(event.bus).extend([Record(inner.at, "", "<", text, mine=False) for text in inner.lines])

    def _bytes(self, event: Bytes) -> None:
        mark = "↑" if event.outgoing else "↓"
        self.page(event.bus).extend([Record(event.at, "", mark, row, columns=True, mine=False) for row in event.rows])

    def _progressed(self, event: Progressed) -> None:
        self.progress = "" if event.over else event.text

    def _program_read(self, event: ProgramRead) -> None:
        program = self.bus(event.bus).readout(event.address).program
        program.lines, program.read_at = event.lines, event.at

    def _settings_read(self, event: SettingsRead) -> None:
        readout = self.bus(event.bus).readout(event.address)
        readout.settings, readout.settings_at = event.readings, event.at

    def _program_seen(self, event: ProgramSeen) -> None:
        program = self.bus(event.bus).readout(event.address).program
        program.line, program.phase, program.seen_at = event.line, event.phase, event.at
        program.break_point = event.break_point

    def _state_changed(self, event: StateChanged) -> None:
        self.changed = True


def bus_state(facts: BusFacts | None, addresses: list[str], lost: bool) -> State:
    """The state of a whole bus as last read: idle only if every drive was read as stopped."""
    if lost:
        return State.LOST
    if facts is None or not addresses:
        return State.UNKNOWN
    states = [facts.readout(address).state() for address in addresses]
    for telling in (State.MOVING, State.SILENT):
        if telling in states:
            return telling
    if any(facts.readout(address).in_trouble for address in addresses):
        return State.TROUBLE
    return State.IDLE if all(state is State.STOPPED for state in states) else State.UNKNOWN


def bus_old(facts: BusFacts | None, addresses: list[str], now: float) -> bool:
    """True if the state of a bus may be outdated."""
    return facts is not None and any(facts.readout(address).old(now) for address in addresses)
