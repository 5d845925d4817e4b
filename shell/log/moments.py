"""A moment of a session log, and the first difference between two runs, in less time than reading all entries takes.

Lines are searched as bytes. `line_of` writes the kind, the bus and the drive of an entry in this order, and escapes
quotation marks in texts. So a pattern with a bare quotation mark matches no text.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict, deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, time, timedelta
from itertools import islice, product
from pathlib import Path
from typing import IO, NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.codec import copy_with
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.files import opened, why
from multidrop.shell.log import files
from multidrop.shell.log.decoding import Assumed, Decoding, Measured
from multidrop.shell.log.files import BEGIN, LONGEST, Entry, Line, entry_of, parts
from multidrop.shell.log.steps import Exchange

BLOCK = 4 * LONGEST
"""The bytes that are searched at once; no entry is as long."""
NEAR = 1 << 16
"""The bytes in which a moment is looked for line by line."""
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
_KIND = b'"kind": "'
_RESUME = b'"kind": "typed", "text": "/resume"'
_POLL = b'"poll": true}'
_PLACE = rb'(?:, "bus": "(?:[^"\\]|\\.)*")?(?:, "drive": "(?:[^"\\]|\\.)*")?'
_STEP = re.compile(rb'"kind": "(?:typed|printed|unsolicited|failed|stop)"[^\n]*\}(?=\r?$)', re.MULTILINE)
_KEPT = rb"(?:bus|typed|printed|unsolicited|output|notice|failed|stop|missing)"
_STEP_PLACE = re.compile(rb'"kind": "[a-z]+"' + _PLACE)
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
    """The last entry of each kind and place, and the last polls; by place, then in the order of time."""
    motions: dict[tuple[str, str], list[Measured]]
    """The last position and velocity of each axis, by bus and drive, where its polls have them."""


def known(path: Path, text: str) -> Known:
    """Find what was known at a time. Raises Diagnostic for a text that is none, or before the log, and for a file."""
    paths = parts(path)
    last = next((each for block in _back(paths) for each in _newest(block)), None)
    if last is None:
        raise Diagnostic("is not a session log", str(path), "a log of this version is one JSON object a line")
    first = next((each.entry for each in files.lines(paths[0]) if each.entry is not None), last)
    at = moment(text, first.time, last.time)
    while True:
        with _opened(paths[-1]) as file:
            end = _after(file, at)
        if end or len(paths) == 1:
            break
        paths.pop()
    found: dict[bytes, Line] = {}
    polls: list[Line] = []
    session: Entry | None = None
    for block in _back(paths, end):
        for key in {*_other_keys(found).findall(block.data), _RESUME} - found.keys():
            if (place := block.data.rfind(key)) >= 0 and (line := _line(block, place)) is not None:
                found[key] = line
        place = len(block.data)
        while len(polls) < POLLS and (place := block.data.rfind(_POLL, 0, place)) >= 0:
            polls += filter(None, [_line(block, place)])
        if block.first:
            session = entry_of(block.line(0)[1])
    if not found and session is None:
        raise Diagnostic(f"nothing was logged until {at.isoformat(' ', 'milliseconds')}", str(path))
    return _made(at, paths[-1], session, last if last.time <= at else None, found, polls)


def _other_keys(found: Collection[bytes]) -> re.Pattern[bytes]:
    """Matches the beginnings of entries, up to their texts, of kinds and places that are not found yet."""
    known = b"|".join(re.escape(key.removeprefix(_KIND)) for key in found if key != _RESUME)
    return re.compile(_KIND + (b"(?!" + known + b")") * bool(known) + _KEPT + b'"' + _PLACE + b', "text"')


def _made(
    at: datetime, path: Path, session: Entry | None, last: Entry | None, found: dict[bytes, Line], polls: list[Line]
) -> Known:
    resumed = found.pop(_RESUME, None)
    lines = {line.data: line for line in [*found.values(), *_samples(polls)]}.values()
    entries = {line.data: line.entry for line in lines if line.entry is not None}
    stop = next((each for each in entries.values() if each.kind == "stop"), None)
    if stop is not None and resumed is not None and resumed.entry is not None and resumed.entry.time > stop.time:
        stop = None
    closed = {each.bus for each in entries.values() if each.kind == "bus" and each.text == "closed"}
    shown = [line for line in lines if entries[line.data].bus not in closed or entries[line.data].kind == "bus"]
    shown.sort(key=lambda line: ((each := entries[line.data]).bus, each.drive, each.kind != "bus", each.time))
    moved = {place: _motion(place[1], polled) for place, polled in _exchanges(polls).items()}
    return Known(at, path, session, last, stop, shown, {place: each for place, each in moved.items() if each})


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
            decoding = Decoding(Assumed(family, state))
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
    """The entry that has a place of a block."""
    data = block.line(place)[1]
    entry = entry_of(data)
    return None if entry is None else Line(block.path, 0, data, entry)


def _newest(block: Block) -> Iterator[Entry]:
    end = len(block.data)
    while end > 0:
        begin, data = block.line(end - 1)
        if (entry := entry_of(data)) is not None:
            yield entry
        end = begin


def moment(text: str, first: datetime, last: datetime) -> datetime:
    """Read a time; one of any day is the last one in a log from `first` to `last`. Raises Diagnostic."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        try:
            found = datetime.combine(last.date(), time.fromisoformat(text))
        except ValueError:
            hint = "as in 11:37:05.2, or '2026-11-22 11:37:05'"
            raise Diagnostic(f"{text!r} is not a time", "log at", hint) from None
        found = found if found.tzinfo else found.replace(tzinfo=last.tzinfo)
        day_before = found - timedelta(days=1)
        return day_before if found > last and day_before >= first else found
    return found if found.tzinfo else found.replace(tzinfo=last.tzinfo)


def _after(file: IO[bytes], at: datetime) -> int:
    """The offset of the first line after a moment, by bisection."""
    low, high = 0, file.seek(0, os.SEEK_END)
    while high - low > NEAR:
        middle = (low + high) // 2
        file.seek(middle)
        file.readline(LONGEST)
        begin = file.tell()
        entry = None
        while entry is None and begin < high and (data := file.readline(LONGEST)):
            entry = entry_of(data)
            begin, start = file.tell(), begin
        if entry is None or entry.time > at:
            high = middle
        else:
            low = start
    file.seek(low)
    while data := file.readline(LONGEST):
        if (entry := entry_of(data)) is not None and entry.time > at:
            return low
        low += len(data)
    return low


# The first difference


class Run:
    """The steps of the last session in a log: lines typed and printed, failures, stops; without times and origins."""

    def __init__(self, path: Path) -> None:
        """Read it. Raises Diagnostic."""
        self._blocks: list[tuple[Path, int, int, int]] = []
        """Of each block the part, its offset, its size and its lines."""
        found: list[list[bytes]] = []
        session = False
        for block in _back(parts(path)):
            found.append(_STEP.findall(block.data))
            self._blocks.append((block.path, block.offset, len(block.data), block.data.count(b"\n")))
            session = block.first
        self._counts = [len(each) for each in reversed(found)]
        self._blocks.reverse()
        self.steps = [step for each in reversed(found) for step in each]
        if not self.steps and not session:
            raise Diagnostic("is not a session log", str(path), "a log of this version is one JSON object a line")

    def line(self, index: int) -> Line:
        """The line of a step."""
        before: dict[Path, int] = {}
        for (path, offset, size, lines), count in zip(self._blocks, self._counts, strict=True):
            if path not in before:
                before[path] = _count(path, offset)
            if index < count:
                number = before[path]
                with _opened(path) as file:
                    file.seek(offset)
                    block = Block(path, offset, file.read(size), False)
                match = next(islice(_STEP.finditer(block.data), index, None))
                begin, data = block.line(match.start())
                return Line(path, number + block.data.count(b"\n", 0, begin) + 1, data, entry_of(data))
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
