"""The feed of a publisher: samples, states, errors and transcripts of every drive of every open line."""

from __future__ import annotations

import asyncio
import json
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from typing import NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.text import counted, visible
from multidrop.dialects.units import Takes
from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.bus import Bus
from multidrop.drives.events import Changed, Conditioned, Lost, Sample, Silent, Unsolicited
from multidrop.shell.events import Entered, Failed, Notified, OnBus, Printed, SessionEvent
from multidrop.shell.log.files import Entry, line_of
from multidrop.shell.publishing.broker import Message
from multidrop.shell.publishing.publisher import Publisher
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import shortened

RESERVED = "+#/%"
"""The wildcards and the separator of MQTT, and the sign of an escape."""
UNNAMED = "!"
"""The level of a drive without an address; it is also a drive's name from the factory."""


def escape(name: str) -> str:
    """Make one level of a topic of a name; unquoting gives the name again.

    Escaped by percent signs, as in URLs: reserved, control and direction characters, and a `$` at the beginning.
    """
    if name in ("", UNNAMED):
        return UNNAMED if not name else _percent(name)
    first = _percent("$") if name.startswith("$") else ""
    return first + "".join(
        _percent(each) if each in RESERVED or not _plain(each) else each for each in name[bool(first) :]
    )


def _plain(character: str) -> bool:
    """Whether MQTT takes a character: no control or direction character, no half of one, no non-character."""
    return visible(character) == character and ord(character) & 0xFFFE != 0xFFFE and character not in _NON_CHARACTERS


_NON_CHARACTERS = frozenset(map(chr, range(0xFDD0, 0xFDF0)))


def _percent(text: str) -> str:
    return "".join(f"%{byte:02X}" for byte in text.encode("utf-8", "surrogatepass"))


@dataclass(frozen=True)
class Topics:
    """The topics under a prefix."""

    prefix: str

    @property
    def status(self) -> str:
        return f"{self.prefix}/status"

    def bus_status(self, bus: str) -> str:
        return f"{self.prefix}/{escape(bus)}/status"

    def transcript(self, bus: str) -> str:
        return f"{self.prefix}/{escape(bus)}/transcript"

    def drive(self, bus: str, address: str, what: str) -> str:
        return f"{self.prefix}/{escape(bus)}/{escape(address)}/{what}"


ONLINE, LOST, BYE = "online", "lost", "bye"
"""Plain words: the states of this program, and of a line."""
MOVING, AT_REST, NO_CURRENT, SILENT = "moving", "at rest", "no current", "silent"
"""The states of a drive; or LOST, with its line. NO_CURRENT: an axis is at rest, and nothing holds its load."""
Fields = Mapping[str, int | float | str]
"""`value`, and more facts."""


def value_text(time: datetime, fields: Fields) -> str:
    """A value with its time. An axis without a name is left out."""
    found = {name: each for name, each in fields.items() if (name, each) != ("axis", "")}
    return json.dumps({"time": time.isoformat(timespec="microseconds"), **found})


def error_of(conditions: Iterable[Conditions]) -> Fields:
    """A drive's error: that of the first axis that has one; 0: none."""
    found = next((each for each in conditions if each.error), None)
    if found is None:
        return {"value": 0, "text": ""}
    text = "set; to read its number would clear it" if found.error == UNREAD else found.error_text
    return {"value": found.error, "text": text, "axis": found.axis}


def program_of(conditions: Iterable[Conditions]) -> str:
    return next((each.program for each in conditions if each.program), "")


def line_text(entry: Entry) -> str:
    """A line of a transcript: an entry of the session log, shortened."""
    return line_of(replace(entry, text=shortened(entry.text))).decode().rstrip("\n")


DEFAULT = "2"
"""The usual rate, samples a second of each drive."""
SLOWEST, FASTEST = 0.01, 50.0
UNCHANGED = 5.0
"""The time after which a value that has not changed is published again, s."""
LINES = 20.0
"""Lines a second of one transcript."""
BURST = 100.0
"""Lines of one transcript that are published at once after a pause."""


def parse_rate(text: str) -> float:
    """The period between two samples of a drive, s. Raises Diagnostic."""
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not SLOWEST <= rate <= FASTEST:
        valid = f"valid: {SLOWEST:g} to {FASTEST:g} samples a second of each drive"
        raise Diagnostic(f"invalid rate {text!r}", "--rate", valid)
    return 1 / rate


class Point(NamedTuple):
    """A value and its time."""

    at: float
    value: int


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


@dataclass
class Curve:
    """The published points of one value."""

    shown: Point | None = None
    held: Point | None = None
    """The newest point that was not published, as its value was that of the one before."""

    def take(self, point: Point) -> Iterator[Point]:
        """Yield the points to publish now.

        A change is published with the point before it, so that a chart shows when it began.
        """
        if self.shown is not None and point.value == self.shown.value and point.at - self.shown.at < UNCHANGED:
            self.held = point
            return
        if self.held is not None and point.value != self.held.value:
            yield self.held
        self.shown, self.held = point, None
        yield point


@dataclass
class LineLimit:
    """The limit of one transcript: so many lines a second, more of them after a pause."""

    left: float = BURST
    at: float = field(default=float("-inf"))
    dropped: int = 0
    """The lines that were not published since the last one that was."""

    def passes(self, now: float) -> bool:
        """Whether a line is published now; count it either way."""
        self.left = min(BURST, self.left + (now - self.at) * LINES)
        self.at = now
        if self.left < 1:
            self.dropped += 1
            return False
        self.left -= 1
        return True

    def missing(self, now: float) -> int:
        """The number of dropped lines, once one may be published in their place; 0 otherwise."""
        if not self.dropped or self.left + (now - self.at) * LINES < 1:
            return 0
        self.left, self.at = self.left + min(BURST, (now - self.at) * LINES) - 1, now
        dropped, self.dropped = self.dropped, 0
        return dropped


Put = Callable[[str, float, bool, Fields], None]
"""Publishes a value: `position`, its time, whether it is retained, and its facts."""


Given = Callable[[str, float, Takes], tuple[float, str] | None]


class DriveFeed:
    """The values of a drive that were published, and what is published next."""

    def __init__(self, put: Put, period: float, given: Given = lambda axis, number, takes: None) -> None:
        """`period`: between two samples, s. `given`: a number of an axis in its unit, and the unit."""
        self._put, self._period, self._given = put, period, given
        self._limits: dict[str, SampleLimit] = {}
        self._curves: dict[tuple[str, str], Curve] = {}
        """By what, and axis."""
        self._moving: dict[str, bool] = {}
        """By axis."""
        self._program: str | None = None
        """None: not known."""
        self._no_current = False
        """An axis has no current at rest, as last read."""
        self._state: Fields = {}
        self._error: Fields = {}

    def take(self, event: Sample | Silent | Conditioned) -> None:
        if isinstance(event, Sample):
            self._sample(event)
        elif isinstance(event, Silent):
            self._say_state(event.at, SILENT)
        else:
            self._program = program_of(event.conditions)
            self._no_current = any(each.no_current for each in event.conditions)
            if self._state:
                known = str(self._state["value"])
                self._say_state(event.at, self._motion() if self._moving and known != SILENT else known)
            if (error := error_of(event.conditions)) != self._error:
                self._error = error
                self._put("error", event.at, True, error)

    def lost(self, at: float) -> None:
        self._program = None
        self._moving.clear()
        self._say_state(at, LOST)

    def _sample(self, sample: Sample) -> None:
        at, axis = sample.at, sample.axis
        self._moving[axis] = sample.velocity != 0
        if sample.program is not None and sample.program != bool(self._program):
            self._program = "running" if sample.program else ""
        self._say_state(at, self._motion())
        if not self._limits.setdefault(axis, SampleLimit(self._period)).passes(at):
            return
        for what, value, takes in (
            ("position", sample.position, Takes.PLACE),
            ("velocity", sample.velocity, Takes.VELOCITY),
        ):
            for point in self._curves.setdefault((what, axis), Curve()).take(Point(at, value)):
                given = self._given(axis, point.value, takes)
                fields: Fields = {} if given is None else {"quantity": given[0], "unit": given[1]}
                self._put(what, point.at, False, {"value": point.value, "axis": axis, **fields})

    def _motion(self) -> str:
        if any(self._moving.values()):
            return MOVING
        return NO_CURRENT if self._no_current else AT_REST

    def _say_state(self, at: float, word: str) -> None:
        state: Fields = {"value": word} if self._program is None else {"value": word, "program": self._program}
        if state != self._state:
            self._state = state
            self._put("state", at, True, state)


KINDS = {Entered: "typed", Printed: "printed", Notified: "notice", Failed: "failed"}
CONDITIONS = 1.0
"""Seconds between two readings of conditions on a line, of one drive after the other."""
LOOK = 1.0
"""Seconds between two looks at what waits."""
HEARTBEAT = 30.0
"""Seconds between two messages of each state: a broker may publish the will of an earlier process late."""


class Feed:
    """Makes messages for a publisher of the events of a workspace, from `begin` to `end`."""

    def __init__(self, workspace: Session, publisher: Publisher, topics: Topics, period: float) -> None:
        """`period`: between two samples of a drive, s."""
        self._workspace, self._publisher, self._topics, self.period = workspace, publisher, topics, period
        self._lines: dict[str, _Line] = {}
        self._limits: defaultdict[str, LineLimit] = defaultdict(LineLimit)
        self._leave: Callable[[], None] = lambda: None
        self._task: asyncio.Task[None] | None = None
        self._time: tuple[float, datetime] | None = None
        """The time of the last value on both clocks: all values of one sample have the same time."""

    def begin(self) -> None:
        self._leave = self._workspace.subscribe(self._take)
        for bus in self._workspace.buses.values():
            self.add(bus)
        self._task = asyncio.get_running_loop().create_task(self._looking())

    def add(self, bus: Bus) -> None:
        self._lines[bus.name] = _Line(self, bus)

    def end(self) -> None:
        self._leave()
        for line in self._lines.values():
            line.close()
        if self._task is not None:
            self._task.cancel()

    def dropped(self, numbers: Counter[str]) -> None:
        for bus in self._lines:
            if number := numbers[bus]:
                missing = counted(number, "message is", "messages are")
                self._missing(bus, f"{missing} missing before this: no room was left while the broker was away")

    def put(self, topic: str, text: str, bus: str, retain: bool = False) -> None:
        self._publisher.put(Message(topic, text, retain, bus))

    def drive_feed(self, bus: str, address: str) -> DriveFeed:
        return DriveFeed(partial(self._put_value, bus, address), self.period, partial(self._in_units, bus, address))

    def _in_units(self, bus: str, address: str, axis: str, number: float, takes: Takes) -> tuple[float, str] | None:
        found = self._workspace.buses[bus].drives.get(address) if self._workspace.scaled else None
        return None if found is None else self._workspace.units.given(found, axis, number, takes)

    def _put_value(self, bus: str, address: str, what: str, at: float, retain: bool, fields: Fields) -> None:
        topic = self._topics.drive(bus, address, what)
        if self._time is None or self._time[0] != at:
            self._time = (at, self._workspace.wall(at))
        self.put(topic, value_text(self._time[1], fields), bus, retain)

    def status(self, bus: str, word: str) -> None:
        self.put(self._topics.bus_status(bus), word, bus, retain=True)

    async def _looking(self) -> None:
        """Look at what waits, and repeat the states now and then, until cancelled."""
        while True:
            for _ in range(round(HEARTBEAT / LOOK)):
                await asyncio.sleep(LOOK)
                now = self._workspace.now()
                for bus, limit in self._limits.items():
                    if number := limit.missing(now):
                        self._missing(
                            bus,
                            f"{counted(number, 'line is', 'lines are')} missing here: {LINES:g} a second are published",
                        )
                self._publisher.look()
            if self._publisher.connected:
                self._publisher.put(Message(self._topics.status, ONLINE, retain=True))
                for line in self._lines.values():
                    line.repeat()

    # Events

    def _take(self, event: SessionEvent) -> None:
        if isinstance(event, OnBus):
            if isinstance(event.event, Unsolicited):
                for text in event.event.lines:
                    self._line(event.bus, event.event.at, "unsolicited", text)
            elif (line := self._lines.get(event.bus)) is not None:
                line.take(event.event)
        elif isinstance(event, Entered | Printed | Notified | Failed):
            text = event.line if isinstance(event, Entered) else event.text
            by = event.by.value if isinstance(event, Entered) else ""
            warning = isinstance(event, Notified) and event.warning
            for bus in [event.bus] if event.bus else list(self._lines):  # a stop, or a verb, is of every line
                self._line(bus, event.at, KINDS[type(event)], text, getattr(event, "address", ""), by, warning)

    def _line(
        self, bus: str, at: float, kind: str, text: str, drive: str = "", by: str = "", warning: bool = False
    ) -> None:
        """Publish a line of a transcript, within its limit."""
        if bus in self._lines and self._limits[bus].passes(self._workspace.now()):
            entry = Entry(self._workspace.wall(at), kind, text, bus, drive, by, warning=warning)
            self.put(self._topics.transcript(bus), line_text(entry), bus)

    def _missing(self, bus: str, text: str) -> None:
        entry = Entry(self._workspace.wall(self._workspace.now()), "missing", text, bus, warning=True)
        self.put(self._topics.transcript(bus), line_text(entry), bus)


class _Line:
    """One line: its state, and its drives, which are polled."""

    def __init__(self, feed: Feed, bus: Bus) -> None:
        self._feed, self._bus = feed, bus
        self._drives: dict[str, DriveFeed] = {}
        self._ends: list[Callable[[], None]] = []
        self._word = ""
        self._look()

    def take(self, event: object) -> None:
        """Publish what an event says about a drive, or about the line."""
        if isinstance(event, Lost):
            for drive in self._drives.values():
                drive.lost(event.at)
        elif isinstance(event, Changed):
            self._look()
        elif isinstance(event, Sample | Silent | Conditioned) and event.address in self._drives:
            self._drives[event.address].take(event)

    def repeat(self) -> None:
        self._feed.status(self._bus.name, self._word)

    def close(self) -> None:
        while self._ends:
            self._ends.pop()()

    def _look(self) -> None:
        word = ONLINE if self._bus.lost is None else LOST
        if word != self._word:
            self._word = word
            self._feed.status(self._bus.name, word)
        addresses = list(self._bus.drives)
        if addresses == list(self._drives):
            return
        self.close()
        for gone in self._drives.keys() - set(addresses):  # its retained state must not stay
            self._drives[gone].lost(self._bus.now())
        self._drives = {
            each: self._drives.get(each) or self._feed.drive_feed(self._bus.name, each) for each in addresses
        }
        telemetry = self._bus.telemetry
        self._ends.append(telemetry.subscribe(addresses, self._feed.period).close)
        self._ends.append(telemetry.watch(addresses, len(addresses) * CONDITIONS).close)
