"""A moment of a session log, and the first difference between two runs, in less time than reading all entries takes.

Lines are searched as bytes. `line_of` writes the time, the kind, the bus and the drive of an entry in this order, and
escapes quotation marks in texts. So a pattern with a bare quotation mark matches no text.

The order of a log is that of its lines. A clock that was set back passes a time again, so one time may be several
moments. A time without a zone is compared with the clock as it was shown then, whatever the zone.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, time, timedelta, tzinfo
from functools import cache, partial
from itertools import islice, pairwise, product
from pathlib import Path
from typing import IO, NamedTuple, TypeVar

from multidrop.base.errors import Diagnostic
from multidrop.base.files import opened, why
from multidrop.dialects.codec import copy_with
from multidrop.dialects.families import FAMILIES
from multidrop.shell.log import files
from multidrop.shell.log.decoding import Assumed, Decoding, Measured
from multidrop.shell.log.files import BEGIN, LONGEST, Entry, Line, entry_of, parts
from multidrop.shell.log.steps import Exchange

BLOCK = 4 * LONGEST
"""The bytes that are searched at once; no entry is as long."""
BACK = timedelta(seconds=1)
"""A time that is so much before that of the entry above it: the clock was set back. Threads differ by less."""
MOST = 5
"""The moments of one time that are found: the last ones."""
ATTEMPTS = 3
"""Attempts to read a log that is rotated meanwhile."""
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
COMPRESSED = (b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"\x28\xb5\x2f\xfd", b"PK\x03\x04")
_SESSION = f'"kind": "log", "text": "{BEGIN} '.encode()
_TIME = re.compile(rb'"time": "(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}[+-](?:[01]\d|2[0-3]):[0-5]\d)"')
_ZONE = 26
"""The place of the zone in a time."""
_KIND = b'"kind": "'
_RESUME = b'"kind": "typed", "text": "/resume"'
_POLL = b'"poll": true}'
_PLACE = rb'(?:, "bus": "(?:[^"\\]|\\.)*")?(?:, "drive": "(?:[^"\\]|\\.)*")?'
_STEP = re.compile(rb'"kind": "(?:typed|printed|unsolicited|failed|stop)"[^\n]*\}(?=\r?$)', re.MULTILINE)
_KEPT = rb"(?:bus|typed|printed|unsolicited|output|notice|failed|stop|missing)"
_STEP_PLACE = re.compile(rb'"kind": "[a-z]+"' + _PLACE)
T = TypeVar("T")
_BY = tuple(f', "by": "{word}"'.encode() for word in ("operator", "macro", "script"))


class Block(NamedTuple):
    """Whole lines of a part, from an offset on. `first`: a session begins with them."""

    path: Path
    offset: int
    data: bytes
    first: bool

    def line(self, at: int) -> tuple[int, bytes]:
        """The line that has a place, and where it begins."""
        begin = self.data.rfind(b"\n", 0, at) + 1
        return begin, self.data[begin : self.data.find(b"\n", at) + 1 or len(self.data)]


def _opened(path: Path) -> IO[bytes]:
    """Open a part. Raises Diagnostic."""
    try:
        file = opened(path)
        begin = file.read(8)
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be read: {why(problem)}", str(path)) from None
    if begin.startswith(COMPRESSED):
        file.close()
        raise Diagnostic("is compressed", str(path), "unpack it first")
    return file


def _back(paths: Sequence[Path], end: int | None = None) -> Iterator[Block]:
    """Yield the lines of the last session before an offset of the last part, in blocks, the newest first."""
    for path in reversed(paths):
        with _opened(path) as file:
            last = file.seek(0, os.SEEK_END) if end is None else end
            end = None
            while last > 0:
                begin = max(0, last - BLOCK)
                file.seek(begin)
                data = file.read(last - begin)
                cut = data.find(b"\n") + 1 if begin else 0
                session = data.rfind(_SESSION, cut)
                if session >= 0:
                    cut = data.rfind(b"\n", 0, session) + 1
                yield Block(path, begin + cut, data[cut:], session >= 0)
                if session >= 0:
                    return
                last = begin + cut if 0 < cut < len(data) else begin  # else it is in a line that is no entry


def _steady(path: Path, read: Callable[[], T]) -> T:
    """Read a log, and again where it was rotated meanwhile. Raises Diagnostic."""
    for _ in range(ATTEMPTS):
        before = _files(path)
        try:
            found = read()
        except Diagnostic:
            if _files(path) == before:
                raise
            continue
        if _files(path) == before:
            return found
    raise _rotated(path)


def _files(path: Path) -> list[tuple[int, int]]:
    """The identities of the parts of a log."""
    found = []
    for each in parts(path):
        with suppress(OSError, ValueError):
            state = os.stat(each)
            found.append((state.st_dev, state.st_ino))
    return found


def _rotated(path: Path) -> Diagnostic:
    return Diagnostic("was rotated while it was read", str(path), "try again")


# A moment


@dataclass
class Known:
    """What was known at a moment of a session: lines of its log."""

    at: datetime
    path: Path
    session: Entry | None
    """Its first entry; None where the log has none."""
    last: Entry | None
    """The newest entry of the log, where that is before the moment."""
    stopped: Entry | None
    """The stop that held."""
    lines: list[Line]
    """The last entry of each kind and place, and the last polls; by place, then in the order of the log."""
    motions: dict[tuple[str, str], list[Measured]]
    """The last position and velocity of each axis, by bus and drive, where its polls have them."""


class Moments(NamedTuple):
    """The moments of one time, the earliest first, and when the clock of the log was set back."""

    known: list[Known]
    total: int
    """How often it was that time; only the last MOST are known."""
    backs: list[tuple[datetime, datetime]]


class End(NamedTuple):
    """The end of what was logged until a moment: a part, an offset in it, and the zone of the entry before."""

    part: int
    offset: int | None
    zone: bytes


def known(path: Path, text: str) -> Moments:
    """Find what was known at a time. Raises Diagnostic for a text that is none, or before the log, and for a file."""
    return _steady(path, partial(_moments, path, text))


def _moments(path: Path, text: str) -> Moments:
    paths = parts(path)
    last = next((each for block in _back(paths) for each in _newest(block)), None)
    if last is None:
        raise Diagnostic("is not a session log", str(path), "a log of this version is one JSON object a line")
    first = next((each.entry for each in files.lines(paths[0]) if each.entry is not None), last)
    at = moment(text, first.time, last.time)
    ends, backs = _ends(paths, at)
    found: list[Known] = []
    for end in ends[-MOST:]:
        zoned = at if at.tzinfo else at.replace(tzinfo=_zone(end.zone))
        found += _known(paths, end, zoned, last if end.offset is None else None)
    if not found:
        raise Diagnostic(f"nothing was logged until {at.isoformat(' ', 'milliseconds')}", str(path))
    return Moments(found, len(ends), backs)


def _ends(paths: Sequence[Path], at: datetime) -> tuple[list[End], list[tuple[datetime, datetime]]]:
    """The ends of what was logged until a time, one for each time that the clock passed it; when it was set back."""

    @cache
    def limit(zone: bytes) -> bytes:
        wall = at if at.tzinfo is None else at.astimezone(_zone(zone))
        return wall.replace(tzinfo=None).isoformat(timespec="microseconds").encode()

    def is_late(stamp: bytes) -> bool:
        return stamp[:_ZONE] > limit(stamp[_ZONE:])

    ends: list[End] = []
    backs: list[tuple[datetime, datetime]] = []
    before, late, passed = b"", True, False

    def put(part: int, offset: int | None) -> None:
        nonlocal passed
        if passed:  # times of threads that differ by less than BACK are in any order
            ends.pop()
        passed = True
        ends.append(End(part, offset, before[_ZONE:]))

    for part, path in enumerate(paths):
        for offset, data in _forth(path):
            stamps = _TIME.findall(data)
            steps = [each for each in pairwise([before, *stamps]) if each[1] < each[0]]
            sides = {late, *(is_late(each) for each in (*stamps[:1], *stamps[-1:]))}
            if len(sides) == 1 and not any(_set_back(*each, at) for each in steps):
                before = stamps[-1] if stamps else before
                continue
            for match in _TIME.finditer(data):
                stamp, was_late = match[1], late
                if stamp < before and (step := _set_back(before, stamp, at)):
                    backs.append(step)
                    passed = False
                late = is_late(stamp)
                if late and not was_late:
                    put(part, offset + data.rfind(b"\n", 0, match.start()) + 1)
                before = stamp
    if not late:
        put(len(paths) - 1, None)
    return ends, backs


def _forth(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield whole lines of a part in blocks, each with its offset."""
    with _opened(path) as file:
        file.seek(0)
        while data := file.read(BLOCK):
            offset = file.tell() - len(data)
            yield offset, data + file.readline(LONGEST)


def _set_back(before: bytes, after: bytes, at: datetime) -> tuple[datetime, datetime] | None:
    """Two times between which the clock was set back; as it was shown, where `at` has no zone."""
    try:
        first, second = (datetime.fromisoformat(each.decode()) for each in (before, after))
    except ValueError:  # a day that there is not
        return None
    zoned = first - second if at.tzinfo else first.replace(tzinfo=None) - second.replace(tzinfo=None)
    return (first, second) if zoned >= BACK else None


@cache
def _zone(text: bytes) -> tzinfo | None:
    return datetime.fromisoformat(f"2000-01-01T00:00:00{text.decode()}").tzinfo


def _known(paths: Sequence[Path], end: End, at: datetime, last: Entry | None) -> Iterator[Known]:
    """Yield what was known at the end of some entries, if these have anything. `last`: see Known."""
    found: dict[bytes, Line] = {}
    polls: list[Line] = []
    session: Entry | None = None
    for block in _back(paths[: end.part + 1], end.offset):
        for key in {*_other_keys(found).findall(block.data), _RESUME} - found.keys():
            if (place := block.data.rfind(key)) >= 0 and (line := _line(block, place)) is not None:
                found[key] = line
        place = len(block.data)
        while len(polls) < POLLS and (place := block.data.rfind(_POLL, 0, place)) >= 0:
            polls += filter(None, [_line(block, place)])
        if block.first:
            session = entry_of(block.line(0)[1])
    if found or session is not None:
        path = paths[end.part - (end.offset == 0 and end.part > 0)]
        yield _made(at, path, session, last, found, polls, paths)


def _other_keys(found: Collection[bytes]) -> re.Pattern[bytes]:
    """Matches the beginnings of entries, up to their texts, of kinds and places that are not found yet."""
    known = b"|".join(re.escape(key.removeprefix(_KIND)) for key in found if key != _RESUME)
    return re.compile(_KIND + (b"(?!" + known + b")") * bool(known) + _KEPT + b'"' + _PLACE + b', "text"')


def _made(
    at: datetime,
    path: Path,
    session: Entry | None,
    last: Entry | None,
    found: dict[bytes, Line],
    polls: list[Line],
    paths: Sequence[Path],
) -> Known:
    def place(line: Line) -> tuple[int, int]:
        return paths.index(line.path), line.number

    resumed = found.pop(_RESUME, None)
    lines = {line.data: line for line in [*found.values(), *_samples(polls)]}.values()
    entries = {line.data: line.entry for line in lines if line.entry is not None}
    stop = next((line for line in lines if entries[line.data].kind == "stop"), None)
    if stop is not None and resumed is not None and place(resumed) > place(stop):
        stop = None
    closed = {each.bus for each in entries.values() if each.kind == "bus" and each.text == "closed"}
    shown = [line for line in lines if entries[line.data].bus not in closed or entries[line.data].kind == "bus"]
    shown.sort(key=lambda line: ((each := entries[line.data]).bus, each.drive, each.kind != "bus", place(line)))
    moved = {drive: _motion(drive[1], polled) for drive, polled in _exchanges(polls).items()}
    stopped = None if stop is None else stop.entry
    return Known(at, path, session, last, stopped, shown, {drive: each for drive, each in moved.items() if each})


def _exchanges(polls: Sequence[Line]) -> dict[tuple[str, str], list[Exchange]]:
    """The last polls of each drive with their replies, in their order. `polls` has the newest first."""
    found: dict[tuple[str, str], list[Exchange]] = defaultdict(list)
    replies: dict[str, bytes] = defaultdict(bytes)
    for line in polls:
        if (entry := line.entry) is None:
            continue
        data, place = entry.text.encode("latin-1"), (entry.bus, entry.drive)
        if entry.kind == "received":
            replies[entry.bus] = data + replies[entry.bus]
        elif len(found[place]) < DECODED:
            found[place].append(Exchange("", entry.time, *place, data, replies.pop(entry.bus, b"")))
        else:
            replies.pop(entry.bus, None)
    return {place: each[::-1] for place, each in found.items()}


def _motion(address: str, polled: Sequence[Exchange]) -> list[Measured]:
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
            if found := {each.axis: each for exchange in polled for each in decoding.take(exchange)}:
                return [*found.values()]
    return []


def _samples(polls: Sequence[Line]) -> Iterator[Line]:
    """The newest questions of each drive that were polled, each with its reply. `polls` has the newest first."""
    replies: dict[str, list[Line]] = defaultdict(list)
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


def _line(block: Block, place: int) -> Line | None:
    """The entry that has a place of a block; its number is its offset."""
    begin, data = block.line(place)
    entry = entry_of(data)
    return None if entry is None else Line(block.path, block.offset + begin, data, entry)


def _newest(block: Block) -> Iterator[Entry]:
    end = len(block.data)
    while end > 0:
        begin, data = block.line(end - 1)
        if (entry := entry_of(data)) is not None:
            yield entry
        end = begin


def moment(text: str, first: datetime, last: datetime) -> datetime:
    """Read a time; one of any day is the last one in a log from `first` to `last`. Raises Diagnostic.

    It has a zone only where the text has one; else it is the clock as it was shown.
    """
    wrong = Diagnostic(f"{text!r} is not a time", "log at", "as in 11:37:05.2, or '2026-11-22 11:37:05'")
    try:
        found, of_any_day = datetime.fromisoformat(text), False
    except ValueError:
        try:
            found, of_any_day = datetime.combine(last.date(), time.fromisoformat(text)), True
        except ValueError:
            raise wrong from None
    if not datetime.min.year < found.year < datetime.max.year:  # another zone may have no such time
        raise wrong
    if not found.tzinfo:
        first, last = first.replace(tzinfo=None), last.replace(tzinfo=None)
    day_before = found - timedelta(days=1)
    return day_before if of_any_day and found > last and day_before >= first else found


# The first difference


class Run:
    """The steps of the last session in a log: lines typed and printed, failures, stops; without times and origins."""

    def __init__(self, path: Path) -> None:
        """Read it. Raises Diagnostic."""
        _steady(path, partial(self._read, path))

    def _read(self, path: Path) -> None:
        self._blocks: list[tuple[Path, int, int, int]] = []
        """Of each block the part, its offset, its size and its lines."""
        found: list[list[bytes]] = []
        readable = False
        for block in _back(parts(path)):
            readable = readable or next(_newest(block), None) is not None
            found.append(_STEP.findall(block.data))
            self._blocks.append((block.path, block.offset, len(block.data), block.data.count(b"\n")))
        self._counts = [len(each) for each in reversed(found)]
        self._blocks.reverse()
        self.steps = [step for each in reversed(found) for step in each]
        if not readable:
            raise Diagnostic("is not a session log", str(path), "a log of this version is one JSON object a line")

    def line(self, index: int) -> Line:
        """The line of a step. Raises Diagnostic where that is no entry, or the log was rotated since it was read."""
        step = self.steps[index]
        before: dict[Path, int] = {}
        for (path, offset, size, lines), count in zip(self._blocks, self._counts, strict=True):
            if path not in before:
                before[path] = _count(path, offset)
            if index < count:
                number = before[path]
                with _opened(path) as file:
                    file.seek(offset)
                    block = Block(path, offset, file.read(size), False)
                match = next(islice(_STEP.finditer(block.data), index, None), None)
                if match is None or match[0] != step:
                    raise _rotated(path)
                begin, data = block.line(match.start())
                line = Line(path, number + block.data.count(b"\n", 0, begin) + 1, data, entry_of(data))
                if line.entry is None:
                    raise Diagnostic("is not an entry of a session log", line.where, "the log is damaged there")
                return line
            index -= count
            before[path] += lines
        raise IndexError(index)


def _count(path: Path, size: int) -> int:
    """The lines in the first bytes of a file."""
    with _opened(path) as file:
        file.seek(0)
        return sum(file.read(min(BLOCK, size - begin)).count(b"\n") for begin in range(0, size, BLOCK))


def _bare(step: bytes) -> bytes:
    """A step without its origin."""
    for word in _BY:
        step = step.replace(word, b"")
    return step


def first_difference(one: Run, other: Run) -> tuple[int | None, int | None] | None:
    """The indices of the first steps that differ, None where a run has no step any more; None: there is no difference.

    Each drive has an order of its own: a step is compared with that of the same place.
    """
    runs = one.steps, other.steps
    low, high = 0, min(map(len, runs))
    while low < high:  # the longest equal beginning
        middle = (low + high + 1) // 2
        low, high = (middle, high) if runs[0][low:middle] == runs[1][low:middle] else (low, middle - 1)
    waiting: dict[bytes, tuple[deque[int], deque[int]]] = defaultdict(lambda: (deque(), deque()))
    for index in range(low, max(map(len, runs))):
        for side, steps in enumerate(runs):
            if index >= len(steps):
                continue
            match = _STEP_PLACE.match(steps[index])
            queues = waiting[match[0].partition(b",")[2] if match else b""]
            if not queues[1 - side]:
                queues[side].append(index)
            elif _bare(runs[1 - side][before := queues[1 - side].popleft()]) != _bare(steps[index]):
                return (index, before) if side == 0 else (before, index)
    rests = [(queue[0], side) for queues in waiting.values() for side, queue in enumerate(queues) if queue]
    if not rests:
        return None
    index, side = min(rests)
    return (index, None) if side == 0 else (None, index)
