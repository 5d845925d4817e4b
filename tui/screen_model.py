"""The screen's memory: session events, folded into records for transcripts and readouts for drives.

It stores what was printed and read, with times; it sends nothing and decides nothing. Each state is true at the time of
the last sample, and was read from the drive. A drive is stopped when its velocity was read as 0, silent when it did not
reply, and unknown until the first poll. A state that may be outdated stays, with its age, until the next one is read.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from multidrop.dialects import Priority, Request
from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.events import (
    BusEvent,
    Conditioned,
    Ended,
    Rested,
    Sample,
    Sent,
    Silent,
    Traffic,
    Unsolicited,
    Valued,
)
from multidrop.shell import events
from multidrop.shell.line_syntax import EVERYONE
from multidrop.tui.curves.chart import ChartView
from multidrop.tui.curves.marks import MarkKind, PlotMark
from multidrop.tui.curves.samples import Traces
from multidrop.tui.figures import NATIVE, Figures
from multidrop.tui.readout import READ, Readout, ReadoutState

# Changes of a drive between two readings, in words: a limit, an error, the end of a program, silence.
#
# Only readings that are made anyway are compared, and the first one is the start. A line says what was read and no
# more: the cause is for a person to find.


LIMITS = {"lim+": "limit+", "lim-": "limit-"}
"""Lamps whose lighting is reported, by function."""
ALARMS = ("fault", "failed", "locked", "error", "overflow", "stall")
"""Words in a drive's own values that are reported when they appear."""


class Happening(NamedTuple):
    """One line; `warning` where it needs a person, and the line that shows more of it."""

    text: str
    warning: bool = False
    help: str = ""
    limit: str = ""
    """The limit that was reached, where it is that."""
    axis: str = ""


SILENT = Happening("no reply to polls", warning=True)
BACK = Happening("polls get a reply again")
LATE_AFTER = 2.5
"""Seconds between two readings after which a change between them has no single time, and no place."""
Between = Callable[[float, float], str]
"""Makes words of two times: ` (between 12:00:01 and 12:00:21)`."""


def changes_of(
    known: Readout, event: Sample | Silent | Conditioned, between: Between = lambda before, after: ""
) -> Iterator[Happening]:
    """Compare an event of a drive with what was read before it.

    A change that a late reading shows happened at any time since the one before: both times are named.
    """
    if isinstance(event, Silent):
        if known.silent_since is None:
            yield SILENT
    elif isinstance(event, Sample):
        if known.silent_since is not None:
            yield BACK
        axis = next((each for each in known.axes if each.axis == event.axis), None)
        if axis is not None and axis.last is not None and axis.trouble != event.trouble:
            text = event.trouble or f"cleared: {axis.trouble}"
            when = between(axis.last.at, event.at) if event.at - axis.last.at > LATE_AFTER else ""
            yield Happening(_named(text, event.axis) + when, warning=bool(event.trouble), axis=event.axis)
    else:
        for each, after in zip(known.axes, event.conditions, strict=False):
            late = each.conditions is not None and event.at - each.conditioned_at > LATE_AFTER
            when = between(each.conditioned_at, event.at) if late else ""
            for happening in _conditioned(each, after, known.failed_at, late):
                yield happening._replace(text=happening.text + when, axis=after.axis)


def _conditioned(known: Readout, after: Conditions, failed_at: float, late: bool) -> Iterator[Happening]:
    """The changes between two readings of an axis, most urgent first: limits, error, alarms, program, current."""
    before, last = known.conditions, known.last
    if before is None:
        return
    lit = {(lamp.name, lamp.function) for lamp in before.lamps if lamp.on}
    for lamp in after.lamps:
        if lamp.on and lamp.function in LIMITS and not lamp.output and (lamp.name, lamp.function) not in lit:
            place = "" if last is None or late else f" at {known.figures.place(last.position)}"
            stands = "; it is at rest" if last is not None and last.velocity == 0 and not late else ""
            limit = LIMITS[lamp.function]
            yield Happening(_named(f"{limit} reached{place}{stands}", after.axis), warning=True, limit=limit)
    told = failed_at >= known.conditioned_at or (after.error_text and after.error_text == known.trouble)
    if after.error and not before.error and not told:
        if after.error == UNREAD:
            yield Happening(_named(after.cause or "an error is set", after.axis), True, after.error_text)
        else:
            yield Happening(_named(f"{after.error_name}: {after.error_text}", after.axis), True)
    values = dict(before.more)
    for name, value in after.more:
        if value != values.get(name, "") and any(word in value for word in ALARMS):
            yield Happening(_named(f"{name}: {value}", after.axis), warning=True)
    if before.program and not after.program:
        which = "" if before.program == "running" else f" {before.program}"
        yield Happening(_named(f"the program{which} has ended", after.axis))
    if after.program and not before.program:
        text = "a program runs" if after.program == "running" else f"program {after.program}"
        yield Happening(_named(text, after.axis))
    if after.no_current and not before.no_current:
        yield Happening(_named(f"no current in the motor ({after.no_current}): nothing holds the load", after.axis))
    if before.no_current and not after.no_current:
        yield Happening(_named("current in the motor again", after.axis))
    if before.error and not after.error:
        yield Happening(_named("the error is cleared", after.axis))


def _named(text: str, axis: str) -> str:
    return f"{axis}: {text}" if axis else text


MOST_PIECES = 4000
"""Pieces that are kept."""
MOST_BYTES = 256 * 1024
"""Bytes that are kept."""
JOINED_WITHIN = 0.02
"""Seconds without a byte after which a received line is not continued: a slow line delivers single bytes."""
MOST_JOINED_BYTES = 256
"""Bytes of one piece that is continued."""


class TrafficPiece(NamedTuple):
    """Bytes that were written or read at once. `poll`: a request of ours that was not typed, or its reply."""

    at: float
    outgoing: bool
    data: bytes
    address: str = ""
    poll: bool = False


class TrafficStore:
    """The last pieces of one bus. `taken` counts all of them."""

    def __init__(self) -> None:
        self.pieces: deque[TrafficPiece] = deque(maxlen=MOST_PIECES)
        self.taken = 0
        self._bytes = 0
        self._last_at = 0.0
        self._departing: Request | None = None
        """The request whose bytes are written next."""
        self._in_flight: Request | None = None

    def take(self, event: BusEvent) -> bool:
        """Take an event of the bus; return whether it is one of traffic."""
        if isinstance(event, Traffic):
            request = self._departing if event.outgoing else self._in_flight
            if event.outgoing:
                self._departing = None
            poll = request is not None and request.priority is Priority.POLL
            address = request.address if request is not None else ""
            self._bytes += min(len(event.data), MOST_BYTES)
            while self.pieces and (len(self.pieces) == MOST_PIECES or self._bytes > MOST_BYTES):
                self._bytes -= len(self.pieces.popleft().data)
            piece = TrafficPiece(event.at, event.outgoing, event.data[-MOST_BYTES:], address, poll)
            last = self.pieces[-1] if self.pieces else None
            if (
                last is not None
                and not piece.outgoing
                and (last.outgoing, last.address, last.poll) == (False, piece.address, piece.poll)
                and not last.data.endswith(b"\n")
                and len(last.data) < MOST_JOINED_BYTES
                and piece.at - self._last_at < JOINED_WITHIN
            ):
                last = self.pieces.pop()
                piece = last._replace(data=last.data + piece.data)
            else:
                self.taken += 1
            self.pieces.append(piece)
            self._last_at = event.at
        elif isinstance(event, Sent):
            self._departing = self._in_flight = event.request
        elif isinstance(event, Ended):
            self._departing = self._in_flight = None
        else:
            return False
        return True


VERBS = "refused|replied|does|did|is|has|had|holds|cannot|moves"
"""Words after the name of a drive; without one of them, `a` is an article."""
MOST_MARKS = 1000
"""Marks that are kept of a line for its plots."""
MOST_FRESH_RECORDS = 50_000
"""Records that a transcript keeps."""


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
    private: bool = False
    """A remark of this screen to its person, which is shown nowhere else."""
    name: str = ""
    """The name that a person gave to the drive, which is shown in place of its address."""
    details: tuple[str, ...] = ()
    """Lines that are shown while the record is picked; its text then takes one row, cut if it is longer."""
    joins: int = 0
    """Not 0: it replaces an earlier record with this number that is still among the last ones."""


class StopSummary:
    """The drives of one stop that were read at rest so far, as one record."""

    def __init__(self, stop: int) -> None:
        self.stop, self.joins = stop, stop + 1
        self._places: dict[str, str] = {}
        """The positions of each drive, by its name."""

    def take(self, at: float, bus: str, rested: Rested, places: str) -> Record:
        """Add a drive; return the record of all drives so far."""
        self._places[rested.name] = places
        drives = [f"{name} {where}" for name, where in self._places.items()]
        head = f"{bus}: {len(drives)} of {rested.drives} at rest"
        return Record(at, "", "■", "   ".join((head, *drives)), details=tuple(drives), joins=self.joins)


@dataclass
class BusFacts:
    """The records and values of one bus."""

    fresh: deque[Record] = field(default_factory=lambda: deque(maxlen=MOST_FRESH_RECORDS))
    """Records that no transcript has taken yet."""
    readouts: dict[str, Readout] = field(default_factory=dict)
    marks: deque[PlotMark] = field(default_factory=lambda: deque(maxlen=MOST_MARKS))
    """What happened to its drives, for their curves."""
    traffic: TrafficStore = field(default_factory=TrafficStore)
    stop: StopSummary | None = None
    """The last stop of several drives that was confirmed for one of them."""

    def readout(self, address: str) -> Readout:
        return self.readouts.setdefault(address, Readout())


class ScreenModel:
    """All facts on the screen, by bus.

    `current` names the bus for events without one; `opened` returns the names of the open buses.
    """

    def __init__(
        self,
        current: Callable[[], str],
        opened: Callable[[], Container[str]],
        figures: Callable[[str, str, str], Figures] = lambda bus, address, axis: NATIVE,
        named: Callable[[str, str], str] = lambda bus, address: "",
        between: Between = lambda before, after: "",
    ) -> None:
        self.figures = figures
        """Returns the figures of an axis: of a bus, an address, its name."""
        self._named = named
        """Returns the name that a person gave to a drive: of a bus, an address."""
        self._between = between
        self.buses: dict[str, BusFacts] = {}
        self.traces, self.look = Traces(), ChartView()
        """The plotted samples, and how a person looks at them."""
        self.changed = True
        """Buses, drives, selection or latch may have changed."""
        self.trouble = ""
        """The last failure or warning, for screens without a transcript."""
        self.progress = ""
        """The progress of the job that runs, in words."""
        self._current, self._opened = current, opened

    def take(self, event: events.SessionEvent) -> None:
        match event:
            case events.OnBus():
                self._on_bus(event)
            case events.StateChanged():
                self.changed = True
            case events.Entered():
                if event.bus:
                    self._touch(self.bus(event.bus), event.address, event.at)
                    if event.address not in EVERYONE and not event.line.startswith("/"):
                        self.bus(event.bus).readout(event.address).sent = event.line, event.at
                self._mark_sent(event)
                mine = event.by is events.By.OPERATOR
                record = Record(event.at, event.address, ">" if mine else "»", event.line, mine=mine)
                self._of_drive(event.bus, record)
            case events.Printed():
                record = Record(event.at, event.address, "", event.text, mine=event.by is events.By.OPERATOR)
                self._of_drive(event.bus, record)
            case events.Output():
                self.page("").append(Record(event.at, "", "", event.text, columns=event.columns))
            case events.Notified():
                if event.warning:
                    self.trouble = event.text
                if event.rested is not None and event.rested.drives > 1:
                    self._rested(event, event.rested)
                else:
                    self.page(event.bus).append(Record(event.at, "", "!" if event.warning else ".", event.text))
            case events.Failed():
                self.trouble = event.text
                if event.bus and event.address:
                    readout = self.bus(event.bus).readout(event.address)
                    readout.failed_at = event.at
                    if event.code is not None:
                        readout.failure = event.text[max(0, event.text.find("error ")) :], event.at
                explained = "" if event.code is None else f"/help {event.code}"
                mine = event.by is events.By.OPERATOR
                self._of_drive(event.bus, Record(event.at, event.address, "x", event.text, mine=mine, help=explained))
                if event.bus and event.address not in EVERYONE:
                    label = "" if event.code is None else f"error {event.code}"
                    failed = PlotMark(event.at, event.address, MarkKind.ERROR, event.text, label)
                    self.bus(event.bus).marks.append(failed)
            case events.Bytes():
                mark = "↑" if event.outgoing else "↓"
                rows = [Record(event.at, "", mark, row, columns=True, mine=False) for row in event.rows]
                self.page(event.bus).extend(rows)
            case events.Progressed():
                self.progress = "" if event.over else event.text
            case events.ProgramRead():
                program = self.bus(event.bus).readout(event.address).program
                program.lines, program.read_at = event.lines, event.at if event.known else None
            case events.ProgramSeen():
                program = self.bus(event.bus).readout(event.address).program
                program.line, program.phase, program.seen_at = event.line, event.phase, event.at
                program.break_point = event.break_point
            case events.SettingsRead() | events.VariablesRead():
                self.bus(event.bus).readout(event.address).take_read(event)

    def quiet(self, event: events.SessionEvent) -> bool:
        """True if an event alone is not a reason to paint: bytes on the wire, or values that are those before."""
        if not isinstance(event, events.OnBus):
            return False
        inner = event.event
        if isinstance(inner, Sample):
            return self.bus(event.bus).readout(inner.address).repeats(inner)
        if isinstance(inner, Conditioned):
            return self.bus(event.bus).readout(inner.address).recurs(inner)
        if isinstance(inner, events.Predicted):
            return self.bus(event.bus).readout(inner.address).predicted(inner)
        return isinstance(inner, Traffic | Sent | Ended)

    def bus(self, name: str) -> BusFacts:
        """The facts of a bus; an empty name is the current one."""
        return self.buses.setdefault(name or self._current(), BusFacts())

    def page(self, name: str) -> deque[Record]:
        """The place for records of a bus; those of a bus that is not open go to the current page."""
        return self.bus(name if name in self._opened() else "").fresh

    def _rested(self, event: events.Notified, rested: Rested) -> None:
        """Put a drive that came to rest into the one record of its stop."""
        facts = self.bus(event.bus)
        if facts.stop is None or facts.stop.stop != rested.stop:
            facts.stop = StopSummary(rested.stop)
        places = (
            f"{axis} {self.figures(event.bus, event.address, axis).place(position)}".strip()
            for axis, position in rested.places
        )
        record = facts.stop.take(event.at, event.bus, rested, ", ".join(places))
        if facts.fresh and facts.fresh[-1].joins == facts.stop.joins:
            facts.fresh.pop()
        facts.fresh.append(record)

    def _of_drive(self, bus: str, record: Record) -> None:
        """Append a record of a drive under the name that it has in messages, which need not repeat it."""
        name = self._named(bus, record.address) if record.address else ""
        if record.mark == "x" and record.address:
            own = rf"(?:{re.escape(bus)}:)?(?:{re.escape(name or record.address)}|{re.escape(record.address)})"
            record = record._replace(text=re.sub(rf"^{own}(?:: | (?=(?:{VERBS})\b))", "", record.text))
        self.page(bus).append(record._replace(name=name))

    def _mark_sent(self, event: events.Entered) -> None:
        """Mark a line for a drive, or for all of a bus, on the curves; verbs are not sent."""
        line = event.line
        if line.startswith("@"):
            line = line.partition(" ")[2].strip()
        if event.bus and line and not line.startswith("/"):
            address = None if event.address in EVERYONE else event.address
            self.bus(event.bus).marks.append(PlotMark(event.at, address, MarkKind.SENT, line))

    def rename(self, before: str, now: str) -> None:
        self.buses[now] = self.buses.pop(before, BusFacts())
        self.traces.rename(before, now)

    def forget(self, name: str) -> None:
        self.buses.pop(name, None)
        self.traces.forget(name)

    def stopped(self, at: float) -> None:
        """Mark all values as possibly outdated after a stop, so that all drives are polled."""
        for facts in self.buses.values():
            self._touch(facts, EVERYONE[0], at)
            facts.marks.append(PlotMark(at, None, MarkKind.STOP, "stop of all drives", "stop"))
            for axis in (axis for readout in facts.readouts.values() for axis in readout.axes):
                axis.program.stopped_at = at
        self.changed = True

    @staticmethod
    def _touch(facts: BusFacts, address: str, at: float) -> None:
        touched = facts.readouts.values() if address in EVERYONE else [facts.readout(address)]
        for readout in touched:
            readout.touched = at

    def _on_bus(self, event: events.OnBus) -> None:
        inner = event.event
        if isinstance(inner, Sample | Valued):
            self.traces.take(event.bus, inner)
        if isinstance(inner, Sample | Silent | Conditioned):
            readout = self.bus(event.bus).readout(inner.address)
            readout.show_in(partial(self.figures, event.bus, inner.address))
            happened = list(changes_of(readout, inner, self._between))
            readout.note(inner)
            for happening in happened:
                if happening.warning:
                    kind = MarkKind.LIMIT if happening.limit else MarkKind.ERROR
                    label = happening.limit or happening.text.partition(":")[0]
                    marked = PlotMark(inner.at, inner.address, kind, happening.text, label, happening.axis)
                    self.bus(event.bus).marks.append(marked)
                mark = "!" if happening.warning else "."
                self._of_drive(event.bus, Record(inner.at, inner.address, mark, happening.text, help=happening.help))
        elif isinstance(inner, events.TwinEvent):
            if isinstance(inner, events.Predicted):
                self.traces.predict(event.bus, inner)
            self.bus(event.bus).readout(inner.address).compare(inner)
        elif self.bus(event.bus).traffic.take(inner):
            return
        elif isinstance(inner, Unsolicited):
            self.page(event.bus).extend([Record(inner.at, "", "<", text, mine=False) for text in inner.lines])


def bus_state(facts: BusFacts | None, addresses: list[str], lost: bool) -> ReadoutState:
    """The state of a whole bus as last read: at rest only if every drive was read at rest and runs no program.

    What was read before a stop counts for none that is at rest: the banner says that it is not read yet.
    """
    if lost:
        return ReadoutState.LOST
    if facts is None or not addresses:
        return ReadoutState.UNKNOWN
    readouts = [facts.readout(address) for address in addresses]
    states = [readout.state() for readout in readouts]
    for telling in (ReadoutState.MOVING, ReadoutState.SILENT):
        if telling in states:
            return telling
    if any(readout.in_trouble for readout in readouts):
        return ReadoutState.TROUBLE
    if any(readout.differs for readout in readouts):
        return ReadoutState.DIFFERS
    if any(readout.program.runs for readout in readouts):
        return ReadoutState.DWELL
    if any(state not in READ for state in states) or any(
        readout.program.ran or readout.stopped_since for readout in readouts
    ):
        return ReadoutState.UNKNOWN
    return ReadoutState.NO_CURRENT if ReadoutState.NO_CURRENT in states else ReadoutState.AT_REST


def bus_old(facts: BusFacts | None, addresses: list[str], now: float) -> bool:
    """True if the state of a bus may be outdated."""
    readouts = [] if facts is None else [facts.readout(address) for address in addresses]
    return any(readout.old(now) or (readout.program.runs and readout.program_aged(now)) for readout in readouts)
