r"""`multidrop log show|follow|grep`: session logs as text, and searched.

2026-11-22 12:41:06.020 >  press:b PR P
2026-11-22 12:41:06.020 >> press:b bPR P\n
"""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace as replaced
from pathlib import Path
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.base.text import visible
from multidrop.shell import configuration
from multidrop.shell.line_syntax import join_target
from multidrop.shell.log import files
from multidrop.shell.log.files import KINDS, TRAFFIC, LogEntry, LogLine
from multidrop.shell.raw import text_of
from multidrop.shell.streams.stdout import lose, write

if TYPE_CHECKING:
    from multidrop.commands.log_entries import Entries

NOTHING_FOUND = 1
STAMP = 23
"""The length of a time in a shown entry."""
FOLLOW_PERIOD = 0.1
"""The time between two looks at a log that is followed, s."""
LONGEST_JOINED_TEXT = 200
"""The bytes in one line, where no end of line came."""
FIRST_SHOWN_ENTRIES = 10
"""The entries before the end with which following begins."""


def show(entries: Entries) -> int:
    return reported(lambda: _print(files.whole(log_path(entries.file)), entries, _wanted(entries)))


def grep(expression: str, entries: Entries, ignore_case: bool) -> int:
    """Print the entries that match; the exit code says whether any does."""
    try:
        pattern = re.compile(expression, re.IGNORECASE if ignore_case else 0)
    except re.error as problem:
        raise Diagnostic(f"{expression!r} is not a regular expression: {problem}", "log grep") from None
    wanted = _wanted(entries)
    hits = 0

    def matching(entry: LogEntry) -> bool:
        nonlocal hits
        matches = wanted(entry) and pattern.search(text(entry)) is not None
        hits += matches
        return matches

    code = reported(lambda: _print(files.whole(log_path(entries.file)), entries, matching))
    return code or (0 if hits else NOTHING_FOUND)


def follow(entries: Entries) -> int:
    """Print the last lines of a log, and then what is added, until interrupted."""
    wanted = _wanted(entries)

    def put(lines: Iterable[LogLine]) -> None:
        for line in lines if entries.json else joined(lines):
            _put(line, entries, wanted)

    def work() -> None:
        following = Following(log_path(entries.file))
        put(list(following.look())[-FIRST_SHOWN_ENTRIES:])
        while True:
            time.sleep(FOLLOW_PERIOD)
            put(following.look())

    try:
        return reported(work)
    except KeyboardInterrupt:
        return 0


def reported(work: Callable[[], None]) -> int:
    """Do the work; return the exit code. A reader that goes away (`| head`) ends it well."""
    try:
        work()
    except (OSError, ValueError) as problem:
        lose(sys.stdout, problem)
    return 0


def log_path(file: str) -> Path:
    """The log that is named, or the newest. Raises Diagnostic."""
    return Path(file) if file else files.newest(configuration.load())


def _wanted(entries: Entries) -> Callable[[LogEntry], bool]:
    """The filter of entries: by drive, and without polls unless all are asked for."""
    named = set(filter(None, entries.drive.split(",")))
    every = not named or "all" in named

    def wanted(entry: LogEntry) -> bool:
        own = every or entry.drive in named or f"{entry.bus}:{entry.drive}" in named
        return (entries.all or not entry.poll) and own

    return wanted


def _print(lines: Iterable[LogLine], entries: Entries, wanted: Callable[[LogEntry], bool]) -> None:
    """Print the entries; report the lines that are none. Raises Diagnostic for a file without an entry."""
    known, wrong = 0, ""
    for line in lines if entries.json else joined(lines):
        known += line.entry is not None
        wrong = wrong or ("" if line.entry else line.where)
        if known:
            _put(line, entries, wanted)
    if wrong and not known:
        raise Diagnostic("is not an entry of a session log", wrong, "a log of this version is one JSON object a line")


def _put(line: LogLine, entries: Entries, wanted: Callable[[LogEntry], bool]) -> None:
    if line.entry is None:
        if line.data.strip():
            write(sys.stderr, f"{line.where}: not a whole entry: {line.data[:80]!r}")
    elif wanted(line.entry):
        shown = line.data.decode().rstrip("\n") if entries.json else text(line.entry)
        sys.stdout.write(shown.encode(encoding := sys.stdout.encoding, "backslashreplace").decode(encoding) + "\n")
        sys.stdout.flush()


def text(entry: LogEntry) -> str:
    """An entry in one line, its control characters written out."""
    stamp = f"{entry.time:%Y-%m-%d %H:%M:%S}.{entry.time.microsecond // 1000:03}"
    where, typed = join_target(entry.bus, entry.drive), entry.text
    if entry.kind in TRAFFIC:
        return f"{stamp} {KINDS[entry.kind]:<2} {where} {text_of(typed.encode('latin-1'))}"
    if entry.kind == "typed" and entry.bus and typed.startswith("@"):  # the address precedes it already
        typed = typed.partition(" ")[2].strip()
    where = "" if entry.kind in ("notice", "failed") or not where else f"{visible(where)} "
    return f"{stamp} {KINDS[entry.kind]:<2} {where}{visible(typed, tabs=True)}"


def joined(lines: Iterable[LogLine]) -> Iterator[LogLine]:
    """Join the pieces of a reply that came one after the other, up to its end of line; the time is the first one's."""
    held: LogLine | None = None
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
            held = held._replace(entry=replaced(held.entry, text=held.entry.text + entry.text))
    if held is not None:
        yield held


def _continues(held: LogEntry | None, entry: LogEntry | None) -> bool:
    if held is None or entry is None or entry.kind != "received" or held.text.endswith("\n"):
        return False
    return (held.bus, held.drive, held.poll) == (entry.bus, entry.drive, entry.poll) and len(
        held.text
    ) < LONGEST_JOINED_TEXT


class Following:
    """The lines that are added to a log, across its rotation. Nothing is held open between two looks."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = b""
        """The first line of the part that is read: it has a time, and a part is renamed."""
        self._offset = self._number = 0
        self.lost = False
        """Parts were removed before they were read."""

    def look(self) -> Iterator[LogLine]:
        """Yield the whole lines since the last look. Raises Diagnostic where the log cannot be read."""
        try:
            parts = files.parts(self._path)
            firsts = [_first(part) for part in parts]
            if self._file in firsts:
                parts = parts[firsts.index(self._file) :]
            else:
                self.lost = self._file != b""
            for path in parts:
                if (first := _first(path)) != self._file:
                    self._file, self._offset, self._number = first, 0, 0
                for line in files.lines(path, self._offset, self._number):
                    if line.data.endswith(b"\n"):
                        self._offset += len(line.data)
                        self._number = line.number
                        yield line
        except Diagnostic:
            if os.path.exists(self._path) or not os.path.exists(files.part(self._path, 1)):
                raise  # else it is being rotated: the next look finds its parts


def _first(path: Path) -> bytes:
    """The first line of a file, once it is whole."""
    first = next(files.lines(path), None)
    return first.data if first is not None and first.data.endswith(b"\n") else b""
