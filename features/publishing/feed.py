"""The way of a registry to a broker: topics, texts, limits of what rests and of transcripts, the heartbeat.

For the discovery of Home Assistant one retained message for each value makes it a sensor there, and nothing a command.
"""

from __future__ import annotations

import asyncio
import json
import re
import socket
import zlib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

import multidrop
from multidrop.base.text import counted, visible
from multidrop.drives.bus import Bus
from multidrop.drives.events import Unsolicited
from multidrop.features.publishing.broker import BrokerMessage
from multidrop.features.publishing.publisher import MessagePublisher
from multidrop.features.publishing.registry import BYE, ONLINE, Fields, Outlet, PublishedValue, Registry, ValueKey
from multidrop.shell.events import Entered, Failed, Notified, OnBus, Printed, SessionEvent
from multidrop.shell.log.files import LogEntry, line_of
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
        _percent(character) if character in RESERVED or not _plain(character) else character
        for character in name[bool(first) :]
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

    @property
    def about(self) -> str:
        return f"{self.prefix}/about"

    def bus_status(self, bus: str) -> str:
        return f"{self.prefix}/{escape(bus)}/status"

    def transcript(self, bus: str) -> str:
        return f"{self.prefix}/{escape(bus)}/transcript"

    def drive(self, bus: str, address: str, what: str) -> str:
        return f"{self.prefix}/{escape(bus)}/{escape(address)}/{what}"


def shown_name(bus: Bus) -> str:
    """The name of a line for a person elsewhere: host and port, where it was named after its host."""
    place = bus.link.transport.name.partition("://")[2]
    host = place.rpartition(":")[0]
    return place if host and re.fullmatch(rf"{re.escape(host)}(-\d+)?", bus.name) else bus.name


def value_text(time: datetime, fields: Fields) -> str:
    """A value with its time. An axis without a name is left out."""
    filled = {name: each for name, each in fields.items() if (name, each) != ("axis", "")}
    return json.dumps({"time": time.isoformat(timespec="microseconds"), **filled})


def line_text(entry: LogEntry) -> str:
    """A line of a transcript: an entry of the session log, shortened."""
    return line_of(replace(entry, text=shortened(entry.text))).decode().rstrip("\n")


UNCHANGED = 5.0
"""The time after which a value that has not changed is published again, s."""
RATE = 20.0
"""Lines a second of one transcript."""
BURST = 100.0
"""Lines of one transcript that are published at once after a pause."""


@dataclass
class PublishedCurve:
    """The published points of one value."""

    shown: PublishedValue | None = None
    held: PublishedValue | None = None
    """The newest point that was not published, as its value was that of the one before."""

    def take(self, point: PublishedValue) -> Iterator[PublishedValue]:
        """Yield the points to publish now.

        A change is published with the point before it, so that a chart shows when it began.
        """
        if self.shown is not None and point.number == self.shown.number and point.at - self.shown.at < UNCHANGED:
            self.held = point
            return
        if self.held is not None and point.number != self.held.number:
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
        self.left = min(BURST, self.left + (now - self.at) * RATE)
        self.at = now
        if self.left < 1:
            self.dropped += 1
            return False
        self.left -= 1
        return True

    def missing(self, now: float) -> int:
        """The number of dropped lines, once one may be published in their place; 0 otherwise."""
        if not self.dropped or self.left + (now - self.at) * RATE < 1:
            return 0
        self.left, self.at = self.left + min(BURST, (now - self.at) * RATE) - 1, now
        dropped, self.dropped = self.dropped, 0
        return dropped


PREFIX = "homeassistant"
"""The topic under which Home Assistant looks, unless it is told another one."""
EXPIRES = 60.0
"""Seconds, or three periods, after which a number that is no longer published is unavailable there."""
AVAILABLE = "{{ 'online' if value == 'online' else 'offline' }}"
MEASURED = ("position", "velocity")


def sensor(
    key: ValueKey, value: PublishedValue, topic: str, available: tuple[str, ...], period: float, product: str
) -> BrokerMessage:
    """Make the message that describes the sensor of a value.

    `topic`: of the value. `available`: the topics that say `online` while values are current.
    """
    quantity = "quantity" in value.fields
    template = f"value_json.{'quantity' if quantity else 'value'}"
    if key.axis:  # all axes share a topic; an empty text leaves a number as it is
        template += f" if value_json.axis == {json.dumps(key.axis)} else ''"
    drive = f"{key.bus} {key.address}".strip()
    identity = f"multidrop {topic} {key.axis}".rstrip()
    numbers: dict[str, Any] = {"state_class": "measurement", "expire_after": round(max(EXPIRES, 3 * period))}
    config = {
        "name": f"{key.axis} {key.what}".strip(),
        "unique_id": identity,
        "state_topic": topic,
        "value_template": f"{{{{ {template} }}}}",
        "availability": [{"topic": each, "value_template": AVAILABLE} for each in available],
        "availability_mode": "all",
        "device": {"identifiers": [f"multidrop {topic.rpartition('/')[0]}"], "name": drive, "model": product},
        "origin": {"name": "multidrop", "sw_version": multidrop.__version__},
        **(numbers if key.what in MEASURED else {}),
        **({"unit_of_measurement": str(value.fields["unit"])} if quantity else {}),
    }
    name = f"{re.sub('[^a-zA-Z0-9_-]+', '-', identity)}-{zlib.crc32(identity.encode()):08x}"
    return BrokerMessage(f"{PREFIX}/sensor/{name}/config", json.dumps(config), retain=True, bus=key.bus)


KINDS = {Entered: "typed", Printed: "printed", Notified: "notice", Failed: "failed"}
RETAINED = ("state", "error")
LOOK_PERIOD = 1.0
"""Seconds between two looks at what waits."""
HEARTBEAT = 30.0
"""Seconds between two messages of each state: a broker may publish the will of an earlier process late."""


class PublishingFeed(Outlet):
    """Makes messages for a publisher of the values of a registry and the lines of a session's transcript."""

    def __init__(
        self,
        registry: Registry,
        publisher: MessagePublisher,
        topics: Topics,
        text: str = "",
        home_assistant: bool = False,
    ) -> None:
        """`text`: the URL of the broker. `home_assistant`: describe each value as a sensor, too."""
        self._registry, self._session, self._described = registry, registry.session, home_assistant
        self._publisher, self._topics, self.text = publisher, topics, text
        self._named: dict[str, str] = {}
        """The names of the lines, as a person knows them, by those in the topics."""
        self._curves: defaultdict[ValueKey, PublishedCurve] = defaultdict(PublishedCurve)
        self._sensors: dict[ValueKey, tuple[object, ...]] = {}
        """What Home Assistant was told of each value: its unit, and the product."""
        self._limits: defaultdict[str, LineLimit] = defaultdict(LineLimit)
        self._leave: Callable[[], None] = lambda: None
        self._task: asyncio.Task[None] | None = None

    async def begin(self) -> None:
        await self._publisher.begin()
        self._say_about()
        self._leave = self._session.subscribe(self._take, Unsolicited, Entered, Printed, Notified, Failed)
        self._task = asyncio.get_running_loop().create_task(self._looking())

    async def end(self) -> str:
        if self._task is None:  # the broker was not there
            return ""
        self._leave()
        self._task.cancel()
        publisher = self._publisher
        await publisher.end(BrokerMessage(self._topics.status, BYE, retain=True))
        parts = [f"{counted(publisher.sent, 'message')} published"]
        parts += [f"{publisher.lost} dropped, as they had no room"] if publisher.lost else []
        parts += [f"{publisher.waiting} not sent: the broker is away"] if publisher.waiting else []
        return "; ".join(parts)

    def line(self, bus: str, word: str) -> None:
        self._put(self._topics.bus_status(bus), word, bus, retain=True)
        if bus not in self._named:
            self._say_about()

    def _say_about(self) -> None:
        """Say which program publishes here, and the names of its lines."""
        self._named = {bus.name: shown_name(bus) for bus in self._session.buses.values()}
        about = {"version": multidrop.__version__, "host": socket.gethostname(), "lines": self._named}
        self._publisher.put(BrokerMessage(self._topics.about, json.dumps(about), retain=True))

    def value(self, key: ValueKey, value: PublishedValue) -> None:
        """Publish a value; state and error of the drive alone, and a number that rests now and then."""
        retain = key.what in RETAINED
        if retain and key.axis:
            return
        topic = self._topics.drive(key.bus, key.address, key.what)
        if self._described:
            self._describe(key, value, topic)
        for published in (value,) if retain else self._curves[key].take(value):
            self._put(topic, value_text(published.time, published.fields), key.bus, retain)

    def _describe(self, key: ValueKey, value: PublishedValue, topic: str) -> None:
        drive = self._session.buses[key.bus].drives.get(key.address)
        if drive is None or self._sensors.get(key) == (facts := (value.fields.get("unit"), drive.product)):
            return
        self._sensors[key] = facts
        available = self._topics.status, self._topics.bus_status(key.bus)
        self._publisher.put(sensor(key, value, topic, available, self._registry.period, drive.product))

    def dropped(self, numbers: Counter[str]) -> None:
        for bus in self._registry.words:
            if number := numbers[bus]:
                missing = counted(number, "message is", "messages are")
                self._missing(bus, f"{missing} missing before this: no room was left while the broker was away")

    def _put(self, topic: str, text: str, bus: str, retain: bool = False) -> None:
        self._publisher.put(BrokerMessage(topic, text, retain, bus))

    async def _looking(self) -> None:
        """Look at what waits, and repeat the states now and then, until cancelled."""
        while True:
            for _ in range(round(HEARTBEAT / LOOK_PERIOD)):
                await asyncio.sleep(LOOK_PERIOD)
                now = self._session.now()
                for bus, limit in self._limits.items():
                    if number := limit.missing(now):
                        self._missing(
                            bus,
                            f"{counted(number, 'line is', 'lines are')} missing here: {RATE:g} a second are published",
                        )
                self._publisher.look()
            if self._publisher.connected:
                self._publisher.put(BrokerMessage(self._topics.status, ONLINE, retain=True))
                for bus, word in self._registry.words.items():
                    self.line(bus, word)

    def _take(self, event: SessionEvent) -> None:
        if isinstance(event, OnBus):
            if isinstance(event.event, Unsolicited):
                for text in event.event.lines:
                    self._line(event.bus, event.event.at, "unsolicited", text)
        elif isinstance(event, Entered | Printed | Notified | Failed):
            text = event.line if isinstance(event, Entered) else event.text
            by = event.by.value if isinstance(event, Entered) else ""
            warning = isinstance(event, Notified) and event.warning
            for bus in [event.bus] if event.bus else list(self._registry.words):  # a stop, or a verb, is of every line
                self._line(bus, event.at, KINDS[type(event)], text, getattr(event, "address", ""), by, warning)

    def _line(
        self, bus: str, at: float, kind: str, text: str, drive: str = "", by: str = "", warning: bool = False
    ) -> None:
        """Publish a line of a transcript, within its limit."""
        if bus in self._registry.words and self._limits[bus].passes(self._session.now()):
            entry = LogEntry(self._session.wall(at), kind, text, bus, drive, by, warning=warning)
            self._put(self._topics.transcript(bus), line_text(entry), bus)

    def _missing(self, bus: str, text: str) -> None:
        entry = LogEntry(self._session.wall(self._session.now()), "missing", text, bus, warning=True)
        self._put(self._topics.transcript(bus), line_text(entry), bus)
