"""What a broker says of a plant: the publishers under a topic, their lines and drives, and the age of each value.

Theory of operation. `take` is given messages and the time; it never fails, whatever they hold. The last three levels
of a value's topic are line, drive and value, so what is before them is a publisher. Its `about` names it, where it has
one. A retained message says how things were, and nobody knows when: its age is unknown until the next one.
"""

from __future__ import annotations

import json
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple
from urllib.parse import unquote

from multidrop.base.text import visible
from multidrop.features.publishing.feed import UNNAMED
from multidrop.features.publishing.registry import AT_REST, BYE, LOST, MOVING, NO_CURRENT, ONLINE, SILENT

MOST_DRIVES, MOST_PUBLISHERS = 5000, 1000
"""Drives, and states of programs and lines, that are kept, and publishers; what comes beyond is counted."""
LONGEST_PAYLOAD, LONGEST_TOPIC = 16384, 2000
"""Bytes of a message that is read, and characters of its topic."""
NAME, TEXT = 60, 200
"""Characters of a name, and of a text."""
MOST_NAMED_LINES = 200
"""Lines of one publisher that are named."""
AXES = 16
"""Axes of a drive."""
SAMPLES = 500
"""Samples of the followed drive."""
SIGN_TIMEOUT = 75.0
"""Seconds without any message, after which a publisher is missed: it repeats its state every 30."""
NUMBERS, VALUES = ("position", "velocity"), ("position", "velocity", "state", "error")
PC_LOST, NO_SIGN, LINE_LOST, ERROR, UNKNOWN, ENDED = "PC lost", "no sign", "line lost", "error", "not known", "ended"
URGENCY = (PC_LOST, NO_SIGN, LINE_LOST, LOST, SILENT, ERROR, NO_CURRENT, UNKNOWN, ENDED, MOVING, AT_REST)
"""The states of a drive, the worst first."""


class TopicPlace(NamedTuple):
    """A drive by the levels of its topic: its publisher, its line, and itself."""

    publisher: str
    line: str = ""
    drive: str = ""


class ValueReading(NamedTuple):
    """A value, and when it arrived here; None: it was retained, so its age is unknown."""

    at: float | None
    value: float | str
    text: str = ""
    """The text of an error, the program of a state, or a number in its unit."""


class PlantSample(NamedTuple):
    """A position or velocity of the followed drive, and when it arrived."""

    at: float
    what: str
    axis: str
    reading: ValueReading


@dataclass
class PlantPublisher:
    """A program that publishes. `host` is empty without an `about`."""

    host: str = ""
    version: str = ""
    lines: Mapping[str, str] = field(default_factory=dict)
    """The names to show, by those in topics."""
    heard: float | None = None
    """When its last message arrived that was not retained."""


class PlantRow(NamedTuple):
    """A drive as it is shown, or a publisher that has none."""

    place: TopicPlace
    where: str
    """The publisher: its place under the topic, or its host."""
    line: str
    drive: str
    state: str
    error: str
    numbers: Mapping[str, str]
    """Position and velocity of all axes."""
    age: float | None
    """Seconds since the newest number; None: unknown."""

    @property
    def urgency(self) -> tuple[int, str, str, str]:
        """Orders rows: the worst first, then by place, line and drive."""
        worst = ERROR if self.error and URGENCY.index(self.state) > URGENCY.index(ERROR) else self.state
        return URGENCY.index(worst), self.where, self.line, self.drive


class Plant:
    """The drives under a topic."""

    def __init__(self, prefix: str, began: float) -> None:
        self.publishers: dict[str, PlantPublisher] = {}
        self.drives: dict[TopicPlace, dict[tuple[str, str], ValueReading]] = {}
        """The values of each, by what, and axis."""
        self.words: dict[str, str] = {}
        """The states of programs and lines, by the topic above `status`."""
        self.ignored: Counter[str] = Counter()
        """Messages that were not read, by the reason."""
        self.followed: TopicPlace | None = None
        self.samples: deque[PlantSample] = deque(maxlen=SAMPLES)
        self._prefix, self._began = prefix, began

    def follow(self, place: TopicPlace | None) -> None:
        """Keep the samples of one drive from now on."""
        if place != self.followed:
            self.followed = place
            self.samples.clear()

    def lost(self, now: float) -> None:
        """Note that the broker is lost: no age is known until values come again."""
        self._began = now
        for publisher in self.publishers.values():
            publisher.heard = None
        for values in self.drives.values():
            for key, reading in values.items():
                values[key] = reading._replace(at=None)

    def take(self, topic: str, payload: bytes, retained: bool, now: float) -> None:
        """Take a message; one that nobody publishes on purpose is counted."""
        above, _, what = topic.rpartition("/")
        at = None if retained else now
        if len(payload) > LONGEST_PAYLOAD or len(topic) > LONGEST_TOPIC:
            self.ignored["too long"] += 1
        elif what == "status":
            self._status(above, payload, at)
        elif what == "about":
            self._about(above, payload, at)
        elif what in VALUES:
            self._value(above, what, payload, at)

    def _status(self, above: str, payload: bytes, at: float | None) -> None:
        word = payload.decode("latin-1")
        if not payload:
            self.words.pop(above, None)
        elif word not in (ONLINE, LOST, BYE):
            self.ignored["of no known form"] += 1
        elif above in self.words or above in self.publishers or len(self.words) < MOST_DRIVES or self._beyond():
            self.words[above] = word
            if at is not None and (publisher := self.publishers.get(above)) is not None:
                publisher.heard = at

    def _about(self, above: str, payload: bytes, at: float | None) -> None:
        if not payload:
            self.publishers.pop(above, None)
            if any(place.publisher == above for place in self.drives):
                self._publisher(above, at)
            return
        about = _object(payload)
        lines = about.get("lines")
        lines = {str(line): line for line in lines} if isinstance(lines, list) else lines
        if not isinstance(about.get("host"), str) or not isinstance(lines, dict):
            self.ignored["of no known form"] += 1
        elif (publisher := self._publisher(above, at)) is not None:
            publisher.host, publisher.version = _name(about["host"]), _name(str(about.get("version"))[:NAME])
            named = list(lines.items())[:MOST_NAMED_LINES]
            publisher.lines = {str(name)[:TEXT]: _name(value) for name, value in named if isinstance(value, str)}

    def _value(self, above: str, what: str, payload: bytes, at: float | None) -> None:
        levels = above.rsplit("/", 2)
        if len(levels) < 3:
            return
        place = TopicPlace(*levels)
        if not payload:
            self.drives.pop(place, None)
            return
        fields = _object(payload)
        value, axis = fields.get("value"), fields.get("axis", "")
        valid = isinstance(value, str) if what == "state" else _is_number(value)
        if not (valid and isinstance(axis, str)):
            self.ignored["of no known form"] += 1
            return
        if place not in self.drives and (len(self.drives) >= MOST_DRIVES and not self._beyond()):
            return
        if self._publisher(place.publisher, at) is None:
            return
        values = self.drives.setdefault(place, {})
        key = what, _name(axis) if what in NUMBERS else ""
        if key not in values and len(values) > 2 * AXES:
            self._beyond()
            return
        assert isinstance(value, str | int | float)
        reading = ValueReading(at, _name(value) if isinstance(value, str) else value, _more(what, fields))
        values[key] = reading
        if place == self.followed and at is not None and what in NUMBERS:
            self.samples.append(PlantSample(at, *key, reading))

    def _publisher(self, prefix: str, at: float | None) -> PlantPublisher | None:
        """Return a publisher, a new one while there is room."""
        inside = prefix == self._prefix or prefix.startswith(f"{self._prefix}/")
        if not inside or (
            prefix not in self.publishers and len(self.publishers) >= MOST_PUBLISHERS and not self._beyond()
        ):
            return None
        publisher = self.publishers.setdefault(prefix, PlantPublisher())
        publisher.heard = publisher.heard if at is None else at
        return publisher

    def _beyond(self) -> bool:
        self.ignored[f"beyond {MOST_DRIVES} drives"] += 1
        return False

    # Rows

    def where(self, prefix: str) -> str:
        """Name a publisher: by its place under the topic, or by its host."""
        publisher = self.publishers[prefix]
        name = _name(prefix[len(self._prefix) + 1 :]) or publisher.host or "-"
        return name if publisher.host else f"{name} (no about)"

    def rows(self, now: float) -> list[PlantRow]:
        """All drives, the worst first, and the publishers without a drive."""
        wheres = {prefix: self.where(prefix) for prefix in self.publishers}
        rows = [self._row(place, values, wheres[place.publisher], now) for place, values in self.drives.items()]
        peopled = {place.publisher for place in self.drives}
        bare = [TopicPlace(prefix) for prefix in self.publishers if prefix not in peopled]
        rows += [self._row(place, {}, wheres[place.publisher], now) for place in bare]
        return sorted(rows, key=lambda row: row.urgency)

    def program(self, prefix: str, now: float) -> str:
        """The state of a publisher: PC_LOST, NO_SIGN, ENDED, or ONLINE."""
        word, heard = self.words.get(prefix), self.publishers[prefix].heard
        if word in (LOST, BYE):
            return PC_LOST if word == LOST else ENDED
        return NO_SIGN if now - (self._began if heard is None else heard) > SIGN_TIMEOUT else ONLINE

    def _row(
        self, place: TopicPlace, values: Mapping[tuple[str, str], ValueReading], where: str, now: float
    ) -> PlantRow:
        state = self.program(place.publisher, now)
        if state == ONLINE:
            known = values.get(("state", ""))
            state = LINE_LOST if self.words.get(f"{place.publisher}/{place.line}") == LOST else UNKNOWN
            if state == UNKNOWN and known is not None and known.value in URGENCY:
                state = str(known.value)
        error = values.get(("error", ""))
        live = [reading.at for (what, _), reading in values.items() if what in NUMBERS and reading.at is not None]
        named = self.publishers[place.publisher].lines.get(place.line, unquote(place.line))
        return PlantRow(
            place,
            where,
            _name(named),
            "" if place.drive == UNNAMED else _name(unquote(place.drive)),
            state,
            f"{error.value:.0f} {error.text}".strip() if error is not None and error.value else "",
            {what: ", ".join(_numbers(values, what)) for what in NUMBERS},
            now - max(live) if live else None,
        )


def _numbers(values: Mapping[tuple[str, str], ValueReading], what: str) -> Iterator[str]:
    for (name, axis), reading in values.items():
        if name == what:
            yield f"{axis} {shown(reading)}".strip()


def shown(reading: ValueReading) -> str:
    """A number as it is shown: in its unit where it has one."""
    return reading.text or f"{reading.value:.10g}" if isinstance(reading.value, float | int) else reading.value


def _object(payload: bytes) -> Mapping[str, Any]:
    """Parse an object of JSON; anything else is an empty one."""
    try:
        value = json.loads(payload)
    except (ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


def _is_number(value: object) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool) and abs(value) < 1e18


def _more(what: str, found: Mapping[str, Any]) -> str:
    if what in NUMBERS:
        quantity, unit = found.get("quantity"), found.get("unit")
        return f"{quantity:.10g} {_name(unit)}" if _is_number(quantity) and isinstance(unit, str) else ""
    text = found.get("text" if what == "error" else "program", "")
    return visible(text[:TEXT]) if isinstance(text, str) else ""


def _name(text: str) -> str:
    return visible(text if len(text) <= NAME else f"{text[: NAME - 1]}…")
