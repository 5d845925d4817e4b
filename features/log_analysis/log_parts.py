"""The bytes of a session log and its parts: blocks of whole lines, and segments, which an index may describe.

Lines are searched as bytes. `line_of` writes the time, the kind, the bus and the drive of an entry in this order, and
escapes quotation marks in texts. So a pattern with a bare quotation mark matches no text.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, NamedTuple, TypeVar

from multidrop.base.errors import Diagnostic
from multidrop.base.files import opened, why
from multidrop.shell.log.files import BEGIN, INDEX, LONGEST_LOG_LINE, LogEntry, LogLine, entry_of, parts
from multidrop.shell.log.index import LogIndex, index_of

BLOCK = 4 * LONGEST_LOG_LINE
"""The bytes that are searched at once; no entry is as long."""
ATTEMPTS = 3
"""Attempts to read a log that is rotated meanwhile."""
COMPRESSED = (b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"\x28\xb5\x2f\xfd", b"PK\x03\x04")
_SESSION = f'"kind": "log", "text": "{BEGIN} '.encode()
_INDEX = f'"kind": "log", "text": "{INDEX}"'.encode()
T = TypeVar("T")


class LogBlock(NamedTuple):
    """Whole lines of a part, from an offset on. `first`: a session begins with them."""

    path: Path
    offset: int
    data: bytes
    first: bool

    def line(self, at: int) -> tuple[int, bytes]:
        """The line that has a place, and where it begins."""
        begin = self.data.rfind(b"\n", 0, at) + 1
        return begin, self.data[begin : self.data.find(b"\n", at) + 1 or len(self.data)]


def open_part(path: Path) -> IO[bytes]:
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


def blocks_back(paths: Sequence[Path]) -> Iterator[LogBlock]:
    """Yield the lines of the last session of a log in blocks, the newest first."""
    for path in reversed(paths):
        with open_part(path) as file:
            for block in back(file, path, 0, file.seek(0, os.SEEK_END)):
                yield block
                if block.first:
                    return


def back(file: IO[bytes], path: Path, first: int, last: int) -> Iterator[LogBlock]:
    """Yield the lines of a part between two offsets in blocks, the newest first, from the last session on."""
    while last > first:
        begin = max(first, last - BLOCK)
        file.seek(begin)
        data = file.read(last - begin)
        cut = data.find(b"\n") + 1 if begin > first else 0
        session = data.rfind(_SESSION, cut)
        if session >= 0:
            cut = data.rfind(b"\n", 0, session) + 1
        yield LogBlock(path, begin + cut, data[cut:], session >= 0)
        if session >= 0:
            return
        last = begin + cut if 0 < cut < len(data) else begin  # else it is in a line that is no entry


def forth(file: IO[bytes], first: int, last: int) -> Iterator[tuple[int, bytes]]:
    """Yield whole lines of a part between two offsets in blocks, each with its offset."""
    while first < last:
        file.seek(first)
        data = file.read(min(BLOCK, last - first)) or b"\n"
        data += file.readline(min(LONGEST_LOG_LINE, last - first - len(data))) if last > first + len(data) else b""
        yield first, data
        first += len(data)


class Segment(NamedTuple):
    """Bytes of a part between two offsets: those that an index line describes, and this line; or without an index."""

    first: int
    last: int
    described_by: LogIndex | None = None


def segments(file: IO[bytes]) -> list[Segment]:
    """Divide a part into segments, in their order."""
    found: list[Segment] = []
    end, before = file.seek(0, os.SEEK_END), None
    while end > 0:
        known = _index_at(file, before, end) if before is not None else _index_before(file, end)
        if known is None and before is not None:
            known = _index_before(file, end)
        if known is None:
            found.append(Segment(0, end))
            break
        last, index = known
        if last < end:
            found.append(Segment(last, end))
        end = index.start - index.base
        before = None if index.before is None else index.before - index.base
        found.append(Segment(end, last, index))
    return found[::-1]


def _index_at(file: IO[bytes], offset: int, end: int) -> tuple[int, LogIndex] | None:
    """The index line between two offsets, and where it ends."""
    file.seek(offset)
    index = index_of(file.read(end - offset))
    return (end, index) if index is not None and index.at - index.base == offset else None


def _index_before(file: IO[bytes], end: int) -> tuple[int, LogIndex] | None:
    """The last index line in the BLOCK before an offset, and where it ends. It is where it says that it is."""
    begin = max(0, end - BLOCK)
    file.seek(begin)
    data = file.read(end - begin)
    place = len(data)
    while (place := data.rfind(_INDEX, 0, place)) >= 0:
        line, last = data.rfind(b"\n", 0, place) + 1, data.find(b"\n", place) + 1
        index = index_of(data[line:last]) if last else None
        if index is not None and index.at - index.base == begin + line:
            return begin + last, index
        place = line
    return None


def steady(path: Path, read: Callable[[], T]) -> T:
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
    raise rotated(path)


def _files(path: Path) -> list[tuple[int, int]]:
    """The identities of the parts of a log."""
    found = []
    for each in parts(path):
        with suppress(OSError, ValueError):
            state = os.stat(each)
            found.append((state.st_dev, state.st_ino))
    return found


def rotated(path: Path) -> Diagnostic:
    return Diagnostic("was rotated while it was read", str(path), "try again")


def line_at(block: LogBlock, place: int) -> LogLine | None:
    """The entry that has a place of a block; its number is its offset."""
    begin, data = block.line(place)
    entry = entry_of(data)
    return None if entry is None else LogLine(block.path, block.offset + begin, data, entry)


def newest(block: LogBlock) -> Iterator[LogEntry]:
    """The entries of a block, the last first."""
    end = len(block.data)
    while end > 0:
        begin, data = block.line(end - 1)
        if (entry := entry_of(data)) is not None and entry.text != INDEX:
            yield entry
        end = begin
