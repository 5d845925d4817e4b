"""The index of a session log: a line every so many bytes, by which a reader finds a moment without reading all of it.

    {"time": ..., "kind": "log", "text": "index", "format": 1, "index": {"at": 262144, "base": 0, "start": 0, ...}}

An index line describes the lines since the one before it in its part, and has the place of the last entry of each kind,
line and drive since the session began. Places are bytes of the log from the beginning of the part in which the session
began, across its parts; `base` is the place of the part's own first byte. Nothing else depends on these lines: a reader
that does not know them passes over them, and one that finds none, or wrong ones, reads the log itself.

Two writers of one file do not know each other's entries. So a writer makes no index any more once it finds bytes of
another one. And a line that is not at the place that it names is worth nothing: bytes before it were added or removed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from datetime import datetime
from typing import NamedTuple

from multidrop.shell.log.files import BEGIN, FORMAT, INDEX

EVERY = 1 << 18
"""The bytes that an index line describes, at least."""
SHARE = 32
"""The bytes for each byte of an index line, at least: a log of many drives has longer index lines, and fewer."""
KEPT = ("bus", "typed", "printed", "unsolicited", "output", "notice", "failed", "stop", "missing")
"""The kinds of entries of which an index has the last ones."""
ZONE_AT = 26
"""The place of the zone in the time of an entry."""
_HEAD = re.compile(
    rb'\{"time": "(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}[+-]\d\d:\d\d)", "kind": "([a-z]+)"'
    rb'((?:, "bus": "(?:[^"\\]|\\.)*")?(?:, "drive": "(?:[^"\\]|\\.)*")?), "(?:text|bytes)": "'
)
_POLLED = b'"poll": true}'


class EntryKey(NamedTuple):
    """What makes an entry the successor of another one: its kind, line and drive."""

    kind: str
    bus: str
    drive: str


class LogIndex(NamedTuple):
    """What an index line says. Places are bytes from the beginning of the part in which the session began."""

    at: int
    """The place of the index line itself."""
    base: int
    """The place of the first byte of its part."""
    start: int
    """The place of the first byte that it describes."""
    before: int | None
    """The place of the index line before it in its part, which ends at `start`."""
    session: int
    """The place of the first entry of the session."""
    resumed: int | None
    """The place of the last `/resume`."""
    first: str
    last: str
    """The times of the first and the last entry that it describes."""
    steady: bool
    """No entry among these has an earlier time than the one before it, and their clock has one zone."""
    polls: int
    """The number of entries among these that are bytes of polls."""
    entries: Mapping[EntryKey, int]
    """The places of the last entries of the session."""


def index_of(line: bytes) -> LogIndex | None:
    """Decode an index line; None for any other line, and for one whose parts do not fit each other."""
    try:
        fields = json.loads(line)
        if (fields["kind"], fields["text"], fields["format"]) != ("log", INDEX, FORMAT):
            return None
        found = LogIndex(**fields["index"])
        entries = {EntryKey(*map(str, key)): int(place) for *key, place in found.entries}
        found = found._replace(entries=entries)
        places = [found.base, found.start, found.session, found.resumed or 0, found.before or 0, *entries.values()]
        sound = all(isinstance(place, int) and 0 <= place <= found.at for place in [*places, found.polls, found.at])
        times = [datetime.fromisoformat(each) for each in (found.first, found.last)]
        sound = sound and all(time.tzinfo is not None for time in times) and found.base <= found.start
        return found if sound and (found.before is None or found.base <= found.before < found.start) else None
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


class IndexKeeper:
    """Makes the index lines of one writer, from the bytes that it appends."""

    def __init__(self, size: int) -> None:
        """`size`: of the file, before the session's first entry."""
        self._base, self._end = 0, size
        self._rest = b""
        self._session: int | None = None
        self._resumed: int | None = None
        self._entries: dict[EntryKey, int] = {}
        self._places: dict[bytes, tuple[str, str]] = {b"": ("", "")}
        """Lines and drives by their bytes in an entry."""
        self._due = EVERY
        self._begin(None)

    def _begin(self, before: int | None) -> None:
        self._start, self._before = self._end, before
        self._first = self._last = b""
        self._steady, self._polls = True, 0

    def begin_part(self) -> None:
        """Go on in a new part of the log."""
        self._base, self._rest = self._end, b""
        self._begin(None)

    def take(self, data: bytes) -> bytes:
        """Note what is appended; return what to append behind it, an index line or nothing."""
        place = self._end - len(self._rest)
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._note(place, line)
            place += len(line) + 1
        self._end += len(data)
        if self._rest or self._session is None or not self._first or self._end - self._start < self._due:
            return b""
        made = self._line(self._session)
        before, self._end = self._end, self._end + len(made)
        self._due = max(EVERY, SHARE * len(made))
        self._begin(before)
        return made

    def _note(self, place: int, line: bytes) -> None:
        match = _HEAD.match(line)
        if match is None:
            return
        time, kind, text = match[1], match[2].decode(), line[match.end() :]
        self._first = self._first or time
        self._steady = self._steady and self._last <= time and time[ZONE_AT:] == self._first[ZONE_AT:]
        self._last = time
        self._polls += line.endswith(_POLLED)
        if kind == "log" and text.startswith(BEGIN.encode()):
            self._session, self._resumed, self._entries = place, None, {}
        if kind == "typed" and not match[3] and text.startswith(b'/resume"'):
            self._resumed = place
        if kind in KEPT:
            self._entries[EntryKey(kind, *self._place(match[3]))] = place

    def _place(self, data: bytes) -> tuple[str, str]:
        if data not in self._places:
            fields = json.loads(b"{" + data.removeprefix(b", ") + b"}")
            self._places[data] = (fields.get("bus", ""), fields.get("drive", ""))
        return self._places[data]

    def _line(self, session: int) -> bytes:
        first, last = self._first.decode(), self._last.decode()
        entries = [[*key, place] for key, place in self._entries.items()]
        index = {
            "at": self._end,
            "base": self._base,
            "start": self._start,
            "before": self._before,
            "session": session,
            "resumed": self._resumed,
            "first": first,
            "last": last,
            "steady": self._steady,
            "polls": self._polls,
            "entries": entries,
        }
        return (
            json.dumps({"time": last, "kind": "log", "text": INDEX, "format": FORMAT, "index": index}).encode() + b"\n"
        )
