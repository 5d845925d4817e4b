r"""A log for people: entries as text, searched, and followed while they are written.

2026-11-22 12:41:06.020 >  press:b PR P
2026-11-22 12:41:06.020 >> press:b bPR P\n
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from multidrop.dialects import Diagnostic
from multidrop.dialects.text import visible
from multidrop.shell.lines import join_target
from multidrop.shell.log import files
from multidrop.shell.log.disk import part
from multidrop.shell.log.entries import KINDS, TRAFFIC, Entry
from multidrop.shell.log.files import Line
from multidrop.shell.raw import text_of

PERIOD = 0.1
"""The time between two looks at a log that is followed, s."""
LONGEST = 200
"""The bytes in one line, where no end of line came."""
LAST = 10
"""The entries before the end with which following begins."""


def text(entry: Entry) -> str:
    """An entry in one line, its control characters written out."""
    stamp = f"{entry.time:%Y-%m-%d %H:%M:%S}.{entry.time.microsecond // 1000:03}"
    if entry.kind in TRAFFIC:
        return f"{stamp} {KINDS[entry.kind]:<2} {join_target(entry.bus, entry.drive)} {text_of(_bytes(entry))}"
    return f"{stamp} {KINDS[entry.kind]:<2} {_where(entry)}{visible(_typed(entry), tabs=True)}"


def _bytes(entry: Entry) -> bytes:
    return entry.text.encode("latin-1")


def _where(entry: Entry) -> str:
    where = visible(join_target(entry.bus, entry.drive))
    return f"{where} " if where and entry.kind not in ("notice", "failed") else ""


def _typed(entry: Entry) -> str:
    """The text; of a typed line without the address, which precedes it."""
    if entry.kind == "typed" and entry.bus and entry.text.startswith("@"):
        return entry.text.partition(" ")[2].strip()
    return entry.text


def matches(entry: Entry, pattern: re.Pattern[str]) -> bool:
    """Whether a pattern is found in what `text` shows."""
    return pattern.search(text(entry)) is not None


def whole(path: Path) -> Iterator[Line]:
    """The lines of a log and of its rotated parts, the oldest first. Raises Diagnostic."""
    for each in files.parts(path):
        yield from files.lines(each)


def joined(lines: Iterable[Line]) -> Iterator[Line]:
    """Join the pieces of a reply that came one after the other, up to its end of line; the time is the first one's."""
    held: Line | None = None
    for line in lines:
        entry = line.entry
        if held is not None and not _continues(held.entry, entry):
            yield held
            held = None
        if entry is None or entry.kind != "received":
            yield line
        elif held is None or held.entry is None:
            held = line
        else:
            held = held._replace(entry=replace(held.entry, text=held.entry.text + entry.text))
    if held is not None:
        yield held


def _continues(held: Entry | None, entry: Entry | None) -> bool:
    if held is None or entry is None or entry.kind != "received" or held.text.endswith("\n"):
        return False
    return (held.bus, held.drive, held.poll) == (entry.bus, entry.drive, entry.poll) and len(held.text) < LONGEST


class Following:
    """The lines that are added to a log, across its rotation. Nothing is held open between two looks."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = b""
        """The first line of the part that is read: it has a time, and a part is renamed."""
        self._offset = self._number = 0
        self.lost = False
        """Parts were removed before they were read."""

    def look(self) -> Iterator[Line]:
        """Yield the whole lines since the last look. Raises Diagnostic where the log cannot be read."""
        try:
            for each in self._unread():
                yield from self._lines(each)
        except Diagnostic:
            if os.path.exists(self._path) or not os.path.exists(part(self._path, 1)):
                raise  # else it is being rotated: the next look finds its parts

    def _unread(self) -> list[Path]:
        """The part that is read, and those after it."""
        parts = files.parts(self._path)
        firsts = [_first(each) for each in parts]
        if self._file in firsts:
            return parts[firsts.index(self._file) :]
        self.lost = self._file != b""
        return parts

    def _lines(self, path: Path) -> Iterator[Line]:
        if (first := _first(path)) != self._file:
            self._file, self._offset, self._number = first, 0, 0
        for line in files.lines(path, self._offset, self._number):
            if line.data.endswith(b"\n"):
                self._offset += len(line.data)
                self._number = line.number
                yield line


def _first(path: Path) -> bytes:
    """The first line of a file, once it is whole."""
    first = next(files.lines(path), None)
    return first.data if first is not None and first.data.endswith(b"\n") else b""


def follow(path: Path, put: Callable[[Iterable[Line]], None]) -> None:
    """Put the last lines of a log, and then what is added, until interrupted. Raises Diagnostic."""
    following = Following(path)
    put(list(following.look())[-LAST:])
    while True:
        time.sleep(PERIOD)
        put(following.look())
