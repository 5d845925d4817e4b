"""The feed of a publisher: samples, states, errors and transcripts of every drive of every open line."""

from __future__ import annotations

import asyncio
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING

from multidrop.drives.events import Changed, Conditioned, Lost, Sample, Silent, Unsolicited
from multidrop.shell.events import Entered, Failed, Notified, OnBus, Printed, SessionEvent
from multidrop.shell.log.entries import Entry
from multidrop.shell.publishing import messages
from multidrop.shell.publishing.backlog import Message
from multidrop.shell.publishing.drive_feed import DriveFeed
from multidrop.shell.publishing.limits import LINES, LineLimit
from multidrop.shell.publishing.publisher import Publisher
from multidrop.shell.publishing.topics import Topics

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.shell.workspace import Workspace

KINDS = {Entered: "typed", Printed: "printed", Notified: "notice", Failed: "failed"}
CONDITIONS = 1.0
"""Seconds between two readings of conditions on a line, of one drive after the other."""
LOOK = 1.0
"""Seconds between two looks at what waits."""
HEARTBEAT = 30.0
"""Seconds between two messages of each state: a broker may publish the will of an earlier process late."""


class Feed:
    """Makes messages for a publisher of the events of a workspace, from `begin` to `end`."""

    def __init__(self, workspace: Workspace, publisher: Publisher, topics: Topics, period: float) -> None:
        """`period`: between two samples of a drive, s."""
        self._workspace, self._publisher, self._topics, self.period = workspace, publisher, topics, period
        self._lines: dict[str, _Line] = {}
        self._limits: defaultdict[str, LineLimit] = defaultdict(LineLimit)
        self._leave: Callable[[], None] = lambda: None
        self._task: asyncio.Task[None] | None = None
        self._time: tuple[float, datetime] | None = None
        """The time of the last value on both clocks: all values of one sample have the same time."""

    def begin(self) -> None:
        """Publish from now on."""
        self._leave = self._workspace.subscribe(self._take)
        for bus in self._workspace.buses.values():
            self.add(bus)
        self._task = asyncio.get_running_loop().create_task(self._looking())

    def add(self, bus: Bus) -> None:
        """Publish a line, too."""
        self._lines[bus.name] = _Line(self, bus)

    def end(self) -> None:
        """End publishing and polling. May be called again."""
        self._leave()
        for line in self._lines.values():
            line.close()
        if self._task is not None:
            self._task.cancel()

    def dropped(self, numbers: Counter[str]) -> None:
        """Say in the transcripts that messages of their lines are missing."""
        for bus in self._lines:
            if number := numbers[bus]:
                self._missing(
                    bus, f"{number} messages are missing before this: they had no room while the broker was away"
                )

    def put(self, topic: str, text: str, bus: str, retain: bool = False) -> None:
        """Publish a message about a line."""
        self._publisher.put(Message(topic, text, retain, bus))

    def drive_feed(self, bus: str, address: str) -> DriveFeed:
        """Make the feed of one drive."""
        put = partial(self._put_value, bus, address)
        return DriveFeed(put, self.period)

    def _put_value(self, bus: str, address: str, what: str, at: float, retain: bool, fields: messages.Fields) -> None:
        topic = self._topics.drive(bus, address, what)
        if self._time is None or self._time[0] != at:
            self._time = (at, self._workspace.wall(at))
        self.put(topic, messages.value(self._time[1], fields), bus, retain)

    def status(self, bus: str, word: str) -> None:
        """Publish the state of a line."""
        self.put(self._topics.bus_status(bus), word, bus, retain=True)

    async def _looking(self) -> None:
        """Look at what waits, and repeat the states now and then, until cancelled."""
        while True:
            for _ in range(round(HEARTBEAT / LOOK)):
                await asyncio.sleep(LOOK)
                self._say_missing()
                self._publisher.look()
            if self._publisher.connected:
                self._publisher.put(Message(self._topics.status, messages.ONLINE, retain=True))
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
            self._said(event)

    def _said(self, event: Entered | Printed | Notified | Failed) -> None:
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
            self.put(self._topics.transcript(bus), messages.line(entry), bus)

    def _say_missing(self) -> None:
        now = self._workspace.now()
        for bus, limit in self._limits.items():
            if number := limit.missing(now):
                self._missing(bus, f"{number} lines are missing here: {LINES:g} a second are published")

    def _missing(self, bus: str, text: str) -> None:
        entry = Entry(self._workspace.wall(self._workspace.now()), "missing", text, bus, warning=True)
        self.put(self._topics.transcript(bus), messages.line(entry), bus)


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
        """Publish the state of the line again."""
        self._feed.status(self._bus.name, self._word)

    def close(self) -> None:
        """End the polls."""
        while self._ends:
            self._ends.pop()()

    def _say(self, word: str) -> None:
        if word != self._word:
            self._word = word
            self._feed.status(self._bus.name, word)

    def _look(self) -> None:
        """Publish whether the line is there; poll the drives that it has now."""
        self._say(messages.ONLINE if self._bus.lost is None else messages.LOST)
        addresses = list(self._bus.drives)
        if addresses == list(self._drives):
            return
        self.close()
        for gone in self._drives.keys() - set(addresses):  # its retained state must not stay
            self._drives[gone].lost(self._bus.now())
        self._drives = {
            each: self._drives.get(each) or self._feed.drive_feed(self._bus.name, each) for each in addresses
        }
        self._ends += self._polls(addresses)

    def _polls(self, addresses: list[str]) -> Iterator[Callable[[], None]]:
        telemetry = self._bus.telemetry
        yield telemetry.subscribe(addresses, self._feed.period).close
        yield telemetry.watch(addresses, len(addresses) * CONDITIONS).close
