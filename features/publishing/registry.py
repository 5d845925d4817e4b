"""The registry of values: what each drive of each open line did last, and the outlets that are told of it.

Theory of operation. The drives are polled while the registry runs. `values` has the last value of each key, and each
new one goes to every outlet, so a broker, a scraper and a client of another protocol have the same values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.base.text import real
from multidrop.dialects.units import Takes
from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.events import Changed, Conditioned, Lost, Sample, Silent
from multidrop.shell.events import OnBus, SessionEvent
from multidrop.shell.session import Session

ONLINE, LOST, BYE = "online", "lost", "bye"
"""Plain words: the states of this program, and of a line."""
MOVING, AT_REST, NO_CURRENT, SILENT = "moving", "at rest", "no current", "silent"
"""The states of a drive; or LOST, with its line. NO_CURRENT: an axis is at rest, and nothing holds its load."""
STATES = (MOVING, AT_REST, NO_CURRENT, SILENT, LOST)
Fields = Mapping[str, int | float | str]
"""`value`, and more facts."""


class ValueKey(NamedTuple):
    """`position`, `velocity`, `state` or `error` of an axis of a drive.

    A drive whose axes have names has a state and an error of each, and its own, which have none.
    """

    bus: str
    address: str
    what: str
    axis: str = ""


class PublishedValue(NamedTuple):
    """A value, and when its drive was asked: by the clock of the session, and as the time of day."""

    at: float
    time: datetime
    fields: Fields

    @property
    def number(self) -> int | float | str:
        return self.fields["value"]


class Outlet:
    """A way out of this program: a broker, or a server. One that is asked for values is told nothing."""

    text: str
    """The URL, as it is in use."""

    async def listen(self) -> None:
        """Take what must be free, before a line is opened. Raises TransportLost."""

    async def begin(self) -> None:
        """Begin, once the lines are open. Raises TransportLost or Diagnostic."""

    def line(self, bus: str, word: str) -> None:
        """Take the new state of a line."""

    def value(self, key: ValueKey, value: PublishedValue) -> None:
        """Take a new value."""

    async def end(self) -> str:
        """End; return a summary for a person, which may be empty."""
        return ""


def error_of(conditions: Iterable[Conditions]) -> Fields:
    """A drive's error: that of the first axis that has one; 0: none."""
    failing = next((condition for condition in conditions if condition.error), None)
    if failing is None:
        return {"value": 0, "text": ""}
    unread = failing.cause or "set; to read its number would clear it"
    text = unread if failing.error == UNREAD else failing.error_text
    return {"value": failing.error, "text": text, "axis": failing.axis}


DEFAULT = "2"
"""The usual rate, samples a second of each drive."""
SLOWEST_RATE, FASTEST_RATE = 0.01, 50.0
CONDITIONS = 1.0
"""Seconds between two readings of conditions on a line, of one drive after the other."""


def parse_rate(text: str) -> float:
    """The period between two samples of a drive, s. Raises Diagnostic."""
    rate = real(text) or 0.0
    if not SLOWEST_RATE <= rate <= FASTEST_RATE:
        valid = f"valid: {SLOWEST_RATE:g} to {FASTEST_RATE:g} samples a second of each drive"
        raise Diagnostic(f"invalid rate {text!r}", "--rate", valid)
    return 1 / rate


@dataclass
class SampleLimit:
    """The limit of one drive's samples. A poll may come early by half a period; the rate stays."""

    period: float
    due: float = float("-inf")

    def passes(self, at: float) -> bool:
        """Whether a sample is published; count it if so."""
        if at < self.due - self.period / 2:
            return False
        self.due = max(self.due, at) + self.period
        return True


Put = Callable[[str, str, float, Fields], None]
"""Takes a value: `position`, its axis, its time, and its facts."""
Given = Callable[[str, float, Takes], tuple[float, str] | None]


class DriveValues:
    """Makes the values of a drive of what its bus reports."""

    def __init__(self, put: Put, period: float, given: Given = lambda axis, number, takes: None) -> None:
        """`period`: between two samples, s. `given`: a number of an axis in its unit, and the unit."""
        self._put, self._period, self._given = put, period, given
        self._limits: dict[str, SampleLimit] = {}
        self._moving: dict[str, bool] = {}
        """By axis."""
        self._no_current: dict[str, bool] = {}
        """By axis: no current at rest, as last read."""
        self._program: str | None = None
        """None: not known."""
        self._said: dict[tuple[str, str], Fields] = {}
        """The last state and error, by what, and axis."""

    def take(self, event: Sample | Silent | Conditioned) -> None:
        if isinstance(event, Sample):
            self._sample(event)
        elif isinstance(event, Silent):
            self._say_state(event.at, SILENT)
        else:
            self._program = next((condition.program for condition in event.conditions if condition.program), "")
            self._no_current = {condition.axis: bool(condition.no_current) for condition in event.conditions}
            if known := self._said.get(("state", "")):
                self._say_state(event.at, str(known["value"]) if known["value"] in (SILENT, LOST) else "")
            self._say("error", "", event.at, error_of(event.conditions))
            for condition in event.conditions:
                if condition.axis:
                    self._say("error", condition.axis, event.at, error_of([condition]))

    def lost(self, at: float) -> None:
        self._program = None
        self._moving = dict.fromkeys(self._moving, False)
        self._say_state(at, LOST)

    def _sample(self, sample: Sample) -> None:
        at, axis = sample.at, sample.axis
        self._moving[axis] = sample.velocity != 0
        if sample.program is not None and sample.program != bool(self._program):
            self._program = "running" if sample.program else ""
        self._say_state(at)
        if not self._limits.setdefault(axis, SampleLimit(self._period)).passes(at):
            return
        for what, value, takes in (
            ("position", sample.position, Takes.PLACE),
            ("velocity", sample.velocity, Takes.VELOCITY),
        ):
            given = self._given(axis, value, takes)
            fields: Fields = {} if given is None else {"quantity": given[0], "unit": given[1]}
            self._put(what, axis, at, {"value": value, "axis": axis, **fields})

    def _say_state(self, at: float, unread: str = "") -> None:
        """Say the state of the drive, and of its axes if they have names. `unread`: the reason for not knowing it."""
        for axis in ("", *filter(None, self._moving)):
            of = [axis] if axis else [*self._moving]
            currentless = [self._no_current.get(axis)] if axis else self._no_current.values()
            rest = NO_CURRENT if any(currentless) else AT_REST
            word = unread or (MOVING if any(self._moving[each] for each in of) else rest)
            self._say(
                "state",
                axis,
                at,
                {"value": word} if self._program is None else {"value": word, "program": self._program},
            )

    def _say(self, what: str, axis: str, at: float, fields: Fields) -> None:
        if fields != self._said.get((what, axis)):
            self._said[what, axis] = fields
            self._put(what, axis, at, fields)


class Registry:
    """The values of the drives of a session, from `begin` to `end`."""

    def __init__(self, session: Session, period: float) -> None:
        """`period`: between two samples of a drive, s."""
        self.session, self.period = session, period
        self.outlets: list[Outlet] = []
        self.values: dict[ValueKey, PublishedValue] = {}
        """The last value of each key."""
        self.words: dict[str, str] = {}
        """The state of each line: ONLINE or LOST."""
        self._lines: dict[str, _PublishedLine] = {}
        self._leave: Callable[[], None] = lambda: None
        self._time: tuple[float, datetime] | None = None
        """The time of the last value on both clocks: all values of one sample have the same time."""

    def begin(self) -> None:
        self._leave = self.session.subscribe(self._take, Lost, Changed, Sample, Silent, Conditioned)
        for bus in self.session.buses.values():
            self.add(bus)

    def add(self, bus: Bus) -> None:
        self._lines[bus.name] = _PublishedLine(self, bus)

    def end(self) -> None:
        self._leave()
        for line in self._lines.values():
            line.close()

    def drive(self, bus: str, address: str) -> DriveValues:
        return DriveValues(partial(self._put, bus, address), self.period, partial(self._in_units, bus, address))

    def warn(self, text: str) -> None:
        """Tell a person what outlets have to say."""
        self.session.notify(text, warning=True)

    def line(self, bus: str, word: str) -> None:
        self.words[bus] = word
        for outlet in self.outlets:
            outlet.line(bus, word)

    def current(self, key: ValueKey) -> bool:
        """Whether the drive of a value replies, as far as is known."""
        state = self.values.get(ValueKey(key.bus, key.address, "state"))
        return state is None or state.number not in (SILENT, LOST)

    def _in_units(self, bus: str, address: str, axis: str, number: float, takes: Takes) -> tuple[float, str] | None:
        drive = self.session.buses[bus].drives.get(address) if self.session.scaled else None
        return None if drive is None else self.session.units.given(drive, axis, number, takes)

    def _put(self, bus: str, address: str, what: str, axis: str, at: float, fields: Fields) -> None:
        if self._time is None or self._time[0] != at:
            self._time = (at, self.session.wall(at))
        key, value = ValueKey(bus, address, what, axis), PublishedValue(*self._time, fields)
        self.values[key] = value
        for outlet in self.outlets:
            outlet.value(key, value)

    def _take(self, event: SessionEvent) -> None:
        if isinstance(event, OnBus) and (line := self._lines.get(event.bus)) is not None:
            line.take(event.event)


class _PublishedLine:
    """One line: its state, and its drives, which are polled."""

    def __init__(self, registry: Registry, bus: Bus) -> None:
        self._registry, self._bus = registry, bus
        self._drives: dict[str, DriveValues] = {}
        self._ends: list[Callable[[], None]] = []
        self._strangers: set[Drive] = set()
        """The devices that did not identify themselves, and that were named."""
        self._look()

    def take(self, event: object) -> None:
        """Take what an event says about a drive, or about the line."""
        if isinstance(event, Lost):
            for drive in self._drives.values():
                drive.lost(event.at)
        elif isinstance(event, Changed):
            self._look()
        elif isinstance(event, Sample | Silent | Conditioned) and event.address in self._drives:
            self._drives[event.address].take(event)

    def close(self) -> None:
        while self._ends:
            self._ends.pop()()

    def _look(self) -> None:
        word = ONLINE if self._bus.lost is None else LOST
        if word != self._registry.words.get(self._bus.name):
            self._registry.line(self._bus.name, word)
        addresses = [address for address, drive in self._bus.drives.items() if not drive.state.stranger]
        for drive in self._bus.drives.values():
            if drive.state.stranger and drive not in self._strangers:
                self._strangers.add(drive)
                name = self._registry.session.display_name(drive)
                self._registry.warn(f"{name}: nothing is published, as {drive.state.stranger}")
        if addresses == list(self._drives):
            return
        self.close()
        for gone in self._drives.keys() - set(addresses):  # its state must not stay
            self._drives[gone].lost(self._bus.now())
        self._drives = {
            address: self._drives.get(address) or self._registry.drive(self._bus.name, address) for address in addresses
        }
        telemetry = self._bus.telemetry
        self._ends.append(telemetry.subscribe(addresses, self._registry.period).close)
        self._ends.append(telemetry.watch(addresses, len(addresses) * CONDITIONS).close)
