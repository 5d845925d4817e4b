"""A moment of a session log: what was known then, by the index of the log, or by searching its bytes where it has none.

The order of a log is that of its lines. A clock that was set back passes a time again, so one time may be several
moments. A time without a zone is compared with the clock as it was shown then, whatever the zone.
"""

from __future__ import annotations

import json
import os
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, time, timedelta, tzinfo
from functools import cache, partial
from itertools import pairwise, product
from pathlib import Path
from typing import IO, NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.dialects.codec import copy_with
from multidrop.dialects.families import FAMILIES
from multidrop.features.log_analysis.log_parts import (
    LogBlock,
    Segment,
    back,
    blocks_back,
    forth,
    line_at,
    newest,
    open_part,
    segments,
    steady,
)
from multidrop.shell.log import files
from multidrop.shell.log.decoding import Assumed, Decoding, MeasuredPosition
from multidrop.shell.log.files import BEGIN, LONGEST_LOG_LINE, LogEntry, LogLine, entry_of, parts
from multidrop.shell.log.index import KEPT, ZONE_AT, EntryKey, LogIndex
from multidrop.shell.log.steps import LoggedPoll

BACK = timedelta(seconds=1)
"""A time that is so much before that of the entry above it: the clock was set back. Threads differ by less."""
MOST_KNOWN_TIMES = 5
"""The moments of one time that are found: the last ones."""
POLLS, QUESTIONS, DECODED = 2000, 4, 16
"""The entries of polls before a moment in which samples are looked for; the questions of a drive that are shown; and
those that are decoded."""
SETTINGS: Mapping[str, Sequence[object]] = {
    "party": (False, True),
    "checksum": (0, 1, 2),
    "em": (0, 1, 2, 3),
    "addressed": (True, False),
}
"""The settings of a codec that a poll's bytes depend on, and that the log does not say."""
STATES: Mapping[str, Sequence[object]] = {"signs": (True, False), "motors": (6, 3, 2, 1)}
"""The same of the state of a drive."""
_TIME = re.compile(rb'"time": "(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}[+-](?:[01]\d|2[0-3]):[0-5]\d)"')
_KIND = b'"kind": "'
_RESUME = b'"kind": "typed", "text": "/resume"'
_POLL = b'"poll": true}'
_BEGUN = f'"kind": "log", "text": "{BEGIN} '.encode()
_PLACE = rb'(?:, "bus": "(?:[^"\\]|\\.)*")?(?:, "drive": "(?:[^"\\]|\\.)*")?'
_KEPT = f"(?:{'|'.join(KEPT)})".encode()


@dataclass
class KnownMoment:
    """What was known at a moment of a session: lines of its log."""

    at: datetime
    path: Path
    session: LogEntry | None
    """Its first entry; None where the log has none."""
    last: LogEntry | None
    """The newest entry of the log, where that is before the moment."""
    stopped: LogEntry | None
    """The stop that held."""
    lines: list[LogLine]
    """The last entry of each kind and place, and the last polls; by place, then in the order of the log."""
    motions: dict[tuple[str, str], list[MeasuredPosition]]
    """The last position and velocity of each axis, by bus and drive, where its polls have them."""


class Moments(NamedTuple):
    """The moments of one time, the earliest first, and when the clock of the log was set back."""

    known: list[KnownMoment]
    total: int
    """How often it was that time; only the last MOST_KNOWN_TIMES are known."""
    backs: list[tuple[datetime, datetime]]


class LogEnd(NamedTuple):
    """The end of what was logged until a moment: a part, an offset in it, and the zone of the entry before."""

    part: int
    offset: int | None
    zone: bytes


def known(path: Path, text: str) -> Moments:
    """Find what was known at a time. Raises Diagnostic for a text that is none, or before the log, and for a file."""
    return steady(path, partial(_moments, path, text))


def _moments(path: Path, text: str) -> Moments:
    paths = parts(path)
    last = next((entry for block in blocks_back(paths) for entry in newest(block)), None)
    if last is None:
        raise Diagnostic("is not a session log", str(path), "a log of this version is one JSON object a line")
    first = next((line.entry for line in files.lines(paths[0]) if line.entry is not None), last)
    at = moment(text, first.time, last.time)
    ends, backs = _ends(paths, at)
    known: list[KnownMoment] = []
    for end in ends[-MOST_KNOWN_TIMES:]:
        zoned = at if at.tzinfo else at.replace(tzinfo=_zone(end.zone))
        known += _known(paths, end, zoned, last if end.offset is None else None)
    if not known:
        raise Diagnostic(f"nothing was logged until {at.isoformat(' ', 'milliseconds')}", str(path))
    return Moments(known, len(ends), backs)


def _ends(paths: Sequence[Path], at: datetime) -> tuple[list[LogEnd], list[tuple[datetime, datetime]]]:
    """The ends of what was logged until a time, one for each time that the clock passed it; when it was set back."""

    @cache
    def limit(zone: bytes) -> bytes:
        wall = at if at.tzinfo is None else at.astimezone(_zone(zone))
        return wall.replace(tzinfo=None).isoformat(timespec="microseconds").encode()

    def is_late(stamp: bytes) -> bool:
        return stamp[:ZONE_AT] > limit(stamp[ZONE_AT:])

    ends: list[LogEnd] = []
    backs: list[tuple[datetime, datetime]] = []
    before, late, passed = b"", True, False

    def put(part: int, offset: int | None) -> None:
        nonlocal passed
        if passed:  # times of threads that differ by less than BACK are in any order
            ends.pop()
        passed = True
        ends.append(LogEnd(part, offset, before[ZONE_AT:]))

    for part, path in enumerate(paths):
        for piece in _pieces(path):
            stamps = piece.stamps
            steps = [each for each in pairwise([before, *stamps]) if each[1] < each[0]]
            sides = {late, *map(is_late, stamps if steps else (*stamps[:1], *stamps[-1:]))}
            if len(sides) == 1 and not any(_set_back(*each, at) for each in steps):
                before = stamps[-1] if stamps else before
                continue
            data = piece.read()
            for match in _TIME.finditer(data):
                stamp, was_late = match[1], late
                if stamp < before and (step := _set_back(before, stamp, at)):
                    backs.append(step)
                    passed = False
                late = is_late(stamp)
                if late and not was_late:
                    put(part, piece.offset + data.rfind(b"\n", 0, match.start()) + 1)
                before = stamp
    if not late:
        put(len(paths) - 1, None)
    return ends, backs


class Piece(NamedTuple):
    """Lines of a part from an offset on: their times, or the first and the last of times that are in their order."""

    offset: int
    stamps: Sequence[bytes]
    read: Callable[[], bytes]


def _pieces(path: Path) -> Iterator[Piece]:
    """Divide a part into pieces, in their order; those of a steady segment are not read for that."""
    with open_part(path) as file:
        for segment in segments(file):
            index = segment.described_by
            if index is not None and index.steady:
                stamps = [index.first.encode(), index.last.encode()]
                yield Piece(segment.first, stamps, partial(_read, file, segment))
            else:
                for offset, data in forth(file, segment.first, segment.last):
                    yield Piece(offset, _TIME.findall(data), partial(bytes, data))


def _read(file: IO[bytes], segment: Segment) -> bytes:
    file.seek(segment.first)
    return file.read(segment.last - segment.first)


def _set_back(before: bytes, after: bytes, at: datetime) -> tuple[datetime, datetime] | None:
    """Two times between which the clock was set back; as it was shown, where `at` has no zone."""
    try:
        first, second = (datetime.fromisoformat(stamp.decode()) for stamp in (before, after))
    except ValueError:  # a day that there is not
        return None
    zoned = first - second if at.tzinfo else first.replace(tzinfo=None) - second.replace(tzinfo=None)
    return (first, second) if zoned >= BACK else None


@cache
def _zone(text: bytes) -> tzinfo | None:
    return datetime.fromisoformat(f"2000-01-01T00:00:00{text.decode()}").tzinfo


def _known(paths: Sequence[Path], end: LogEnd, at: datetime, last: LogEntry | None) -> Iterator[KnownMoment]:
    """Yield what was known at the end of some entries, if these have anything. `last`: see KnownMoment."""
    search = Search(paths)
    search.run(end)
    if search.found or search.session is not None:
        path = paths[end.part - (end.offset == 0 and end.part > 0)]
        yield _made(at, path, search.session, last, search.found, search.polls, paths)


class Search:
    """A search for the last entries of a session before a moment, from there backwards.

    The first index line that it meets names all of them but polls. From there on only segments with polls are read.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self.found: dict[bytes, LogLine] = {}
        """The last entry of each kind and place, by its bytes up to the text."""
        self.polls: list[LogLine] = []
        """The last polls, the newest first."""
        self.session: LogEntry | None = None
        """The first entry of the session."""
        self._paths = paths
        self._indexed = False
        """Whether an index line has named the entries."""

    def run(self, end: LogEnd) -> None:
        """Raises Diagnostic for a part that cannot be read."""
        for number in range(end.part, -1, -1):
            with open_part(self._paths[number]) as file:
                offset = end.offset if number == end.part else None
                for segment in reversed(_until(segments(file), offset)):
                    if not self._goes_on(number, segment, file):
                        return

    def _goes_on(self, number: int, segment: Segment, file: IO[bytes]) -> bool:
        """Search a segment; return whether there may be more before it."""
        index = segment.described_by
        self._indexed = self._indexed or (index is not None and self._look_up(number, index))
        if self._indexed and len(self.polls) >= POLLS:
            return False
        if self._indexed and index is not None and not index.polls:
            return index.session < index.start
        for block in back(file, self._paths[number], segment.first, segment.last):
            self._search(block)
            if block.first:
                return False
        return True

    def _search(self, block: LogBlock) -> None:
        keys = set() if self._indexed else {*_other_keys(self.found).findall(block.data), _RESUME}
        for key in keys - self.found.keys():
            if (place := block.data.rfind(key)) >= 0 and (line := line_at(block, place)) is not None:
                self.found[key] = line
        place = len(block.data)
        while len(self.polls) < POLLS and (place := block.data.rfind(_POLL, 0, place)) >= 0:
            self.polls += filter(None, [line_at(block, place)])
        if block.first:
            self.session = entry_of(block.line(0)[1])

    def _look_up(self, number: int, index: LogIndex) -> bool:
        """Take what an index line of a part names. Return whether it is there; else nothing is taken."""
        named = {_bytes_of(key): place for key, place in index.entries.items()}
        wanted = {key: place for key, place in named.items() if key not in self.found}
        if index.resumed is not None and _RESUME not in self.found:
            wanted[_RESUME] = index.resumed
        taken = {key: self._line(number, index.base, place) for key, place in {**wanted, _BEGUN: index.session}.items()}
        if any(line is not None and (line.entry is None or key not in line.data) for key, line in taken.items()):
            return False
        first = taken.pop(_BEGUN)
        self.session = None if first is None else first.entry
        self.found |= {key: line for key, line in taken.items() if line is not None}
        return True

    def _line(self, number: int, base: int, place: int) -> LogLine | None:
        """The line at a place of the log, from a part and the place where it begins; None: its part was removed."""
        while place < base:
            number -= 1
            if number < 0:
                return None
            base -= os.path.getsize(self._paths[number])
        path = self._paths[number]
        with open_part(path) as file:
            file.seek(place - base)
            data = file.readline(LONGEST_LOG_LINE)
        return LogLine(path, place - base, data, entry_of(data))


def _until(found: Sequence[Segment], offset: int | None) -> list[Segment]:
    """The segments before an offset; the last one is cut off there, and so has no index. None: all of them."""
    if offset is None:
        return [*found]
    whole = [each for each in found if each.last <= offset]
    cut = whole[-1].last if whole else 0
    return [*whole, Segment(cut, offset)] if cut < offset else whole


def _bytes_of(key: EntryKey) -> bytes:
    """The beginning of an entry, up to its text."""
    place = {name: text for name, text in (("bus", key.bus), ("drive", key.drive)) if text}
    return json.dumps({"kind": key.kind, **place}).encode()[1:-1] + b', "text"'


def _other_keys(found: Collection[bytes]) -> re.Pattern[bytes]:
    """Matches the beginnings of entries, up to their texts, of kinds and places that are not found yet."""
    known = b"|".join(re.escape(key.removeprefix(_KIND)) for key in found if key != _RESUME)
    return re.compile(_KIND + (b"(?!" + known + b")") * bool(known) + _KEPT + b'"' + _PLACE + b', "text"')


def _made(
    at: datetime,
    path: Path,
    session: LogEntry | None,
    last: LogEntry | None,
    found: dict[bytes, LogLine],
    polls: list[LogLine],
    paths: Sequence[Path],
) -> KnownMoment:
    def place(line: LogLine) -> tuple[int, int]:
        return paths.index(line.path), line.number

    resumed = found.pop(_RESUME, None)
    lines = {line.data: line for line in [*found.values(), *_samples(polls)]}.values()
    entries = {line.data: line.entry for line in lines if line.entry is not None}
    stop = next((line for line in lines if entries[line.data].kind == "stop"), None)
    if stop is not None and resumed is not None and place(resumed) > place(stop):
        stop = None
    closed = {entry.bus for entry in entries.values() if entry.kind == "bus" and entry.text == "closed"}
    shown = [line for line in lines if entries[line.data].bus not in closed or entries[line.data].kind == "bus"]
    shown.sort(key=lambda line: ((each := entries[line.data]).bus, each.drive, each.kind != "bus", place(line)))
    moved = {drive: _motion(drive[1], polled) for drive, polled in _exchanges(polls).items()}
    stopped = None if stop is None else stop.entry
    return KnownMoment(at, path, session, last, stopped, shown, {drive: each for drive, each in moved.items() if each})


def _exchanges(polls: Sequence[LogLine]) -> dict[tuple[str, str], list[LoggedPoll]]:
    """The last polls of each drive with their replies, in their order. `polls` has the newest first."""
    by_drive: dict[tuple[str, str], list[LoggedPoll]] = defaultdict(list)
    replies: dict[str, bytes] = defaultdict(bytes)
    for line in polls:
        if (entry := line.entry) is None:
            continue
        data, place = entry.text.encode("latin-1"), (entry.bus, entry.drive)
        if entry.kind == "received":
            replies[entry.bus] = data + replies[entry.bus]
        elif len(by_drive[place]) < DECODED:
            by_drive[place].append(LoggedPoll("", entry.time, *place, data, replies.pop(entry.bus, b"")))
        else:
            replies.pop(entry.bus, None)
    return {place: each[::-1] for place, each in by_drive.items()}


def _motion(address: str, polled: Sequence[LoggedPoll]) -> list[MeasuredPosition]:
    """The last motion of each axis, by the first family and settings whose polls these are."""
    for family in FAMILIES.values():
        unknown = family.new_state(family.codec, address)
        names = [name for name in SETTINGS if hasattr(family.codec, name)]
        more = [name for name in STATES if hasattr(unknown, name)]
        for values in product(*(SETTINGS[name] for name in names), *(STATES[name] for name in more)):
            codec = copy_with(family.codec, **dict(zip(names, values, strict=False)))
            state = family.new_state(codec, address)
            for name, value in zip(more, values[len(names) :], strict=True):
                setattr(state, name, value)
            decoding = Decoding(Assumed(state))
            if positions := {position.axis: position for exchange in polled for position in decoding.take(exchange)}:
                return [*positions.values()]
    return []


def _samples(polls: Sequence[LogLine]) -> Iterator[LogLine]:
    """The newest questions of each drive that were polled, each with its reply. `polls` has the newest first."""
    replies: dict[str, list[LogLine]] = defaultdict(list)
    asked: dict[tuple[str, str], list[str]] = defaultdict(list)
    for line in polls:
        if (entry := line.entry) is None:
            continue
        if entry.kind == "received":
            replies[entry.bus].append(line)
            continue
        reply, questions = replies.pop(entry.bus, []), asked[entry.bus, entry.drive]
        if reply and entry.text not in questions and len(questions) < QUESTIONS:
            questions.append(entry.text)
            yield from (line, *reply)


def moment(text: str, first: datetime, last: datetime) -> datetime:
    """Read a time; one of any day is the last one in a log from `first` to `last`. Raises Diagnostic.

    It has a zone only where the text has one; else it is the clock as it was shown.
    """
    wrong = Diagnostic(f"{text!r} is not a time", "log at", "as in 11:37:05.2, or '2026-11-22 11:37:05'")
    try:
        when, of_any_day = datetime.fromisoformat(text), False
    except ValueError:
        try:
            when, of_any_day = datetime.combine(last.date(), time.fromisoformat(text)), True
        except ValueError:
            raise wrong from None
    if not datetime.min.year < when.year < datetime.max.year:  # another zone may have no such time
        raise wrong
    if not when.tzinfo:
        first, last = first.replace(tzinfo=None), last.replace(tzinfo=None)
    day_before = when - timedelta(days=1)
    return day_before if of_any_day and when > last and day_before >= first else when
