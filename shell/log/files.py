r"""The files of session logs, and their format: an entry as a line of JSON, and a line as an entry.

    {"time": "2026-11-22T12:41:05.123456+01:00", "kind": "log", "text": "multidrop 0.1.0", "format": 1}
    {"time": "2026-11-22T12:41:06.020115+01:00", "kind": "typed", "bus": "press", "drive": "b", "text": "PR P", ...}
    {"time": "2026-11-22T12:41:06.020301+01:00", "kind": "sent", "bus": "press", "drive": "b", "bytes": "bPR P\n"}

`bytes` has one character for each byte, U+0000 to U+00FF. Keys without a value are left out. Secrets are left out, too.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from multidrop.base.atomic import private_folder, read_private, write_atomically
from multidrop.base.errors import Diagnostic
from multidrop.base.files import opened, why
from multidrop.base.text import counted
from multidrop.shell.configuration import Settings
from multidrop.shell.secrets import without_secrets

FORMAT = 1
"""The version of the format, in the first entry of each file."""
BEGIN = "session"
"""The first word of the `log` entry of a new session; that of a further part has another one."""
INDEX = "index"
"""The text of the `log` entries that only an index uses: see `shell.log.index`."""
TRAFFIC = ("sent", "received")
"""The kinds of entries that hold bytes."""
KINDS = {
    "log": "*",
    "bus": "*",
    "typed": ">",
    "printed": "<",
    "unsolicited": "<",
    "output": "<",
    "notice": "*",
    "failed": "!",
    "stop": "!",
    "missing": "!",
    "sent": ">>",
    "received": "<<",
}
"""The kinds of entries, and the sign of each."""
_MARKS = ("poll", "warning", "raw", "stop", "marks")


@dataclass(frozen=True)
class LogEntry:
    """One fact. `text` holds bytes as Latin-1 where the kind is in TRAFFIC."""

    time: datetime
    kind: str
    text: str = ""
    bus: str = ""
    drive: str = ""
    by: str = ""
    """The origin of a typed line."""
    poll: bool = False
    """The bytes belong to a poll."""
    warning: bool = False
    raw: bool = False
    """The text was typed for a bus in raw mode."""
    command: str = ""
    """The command that the bytes carry; empty for a question, a line to be stored, and bytes of another kind."""
    stop: bool = False
    """The bytes are those of a stop."""
    marks: bool = False
    """The entries after this one have `command` and `stop`, which older versions did not write."""


def line_of(entry: LogEntry) -> bytes:
    fields: dict[str, Any] = {"time": entry.time.isoformat(timespec="microseconds"), "kind": entry.kind}
    if entry.bus:
        fields["bus"] = entry.bus
    if entry.drive:
        fields["drive"] = entry.drive
    fields["bytes" if entry.kind in TRAFFIC else "text"] = without_secrets(entry.text)
    if entry.by:
        fields["by"] = entry.by
    if entry.command:
        fields["command"] = without_secrets(entry.command)
    fields |= {name: True for name in _MARKS if getattr(entry, name)}
    if entry.kind == "log":
        fields["format"] = FORMAT
    return json.dumps(fields).encode() + b"\n"


def entry_of(line: bytes) -> LogEntry | None:
    """Decode a line; None for anything that `line_of` does not make."""
    try:
        fields = json.loads(line)
        kind = fields.get("kind") if isinstance(fields, dict) else None
        if not isinstance(kind, str) or kind not in KINDS or fields.get("format", FORMAT) != FORMAT:
            return None
        names = ("time", "bytes" if kind in TRAFFIC else "text", "bus", "drive", "by", "command")
        time, text, bus, drive, by, command = (fields.get(name, "") for name in names)
        if not all(isinstance(field, str) for field in (time, text, bus, drive, by, command)):
            return None
        at = datetime.fromisoformat(time)
        if at.tzinfo is None or (kind in TRAFFIC and any(ord(character) > 0xFF for character in text)):
            return None
        marks = {name: fields.get(name) is True for name in _MARKS}
        return LogEntry(at, kind, text, bus, drive, by, command=command, **marks)
    except (ValueError, RecursionError):
        return None


PROCESS = os.getpid()
NOTED = 50
"""The number of logs outside the folder that are remembered."""
LOG_SUFFIX = ".jsonl"
LONGEST_LOG_LINE = 1 << 20
"""The longest line that can be an entry, bytes."""


class LogLine(NamedTuple):
    """A line of a log. `entry` is None where it is not one."""

    path: Path
    number: int
    data: bytes
    entry: LogEntry | None

    @property
    def where(self) -> str:
        return f"{self.path}:{self.number}"


def folder(settings: Settings) -> Path:
    return settings.state / "logs"


def fresh(settings: Settings) -> Path:
    """The name of a new log in the folder; the oldest ones there give way. Raises Diagnostic."""
    place = folder(settings)
    try:
        private_folder(place)
        # Remove the oldest logs of the folder until the rest fits.
        total = 0
        for path in sorted(
            (log_path for log_path in place.iterdir() if LOG_SUFFIX in log_path.name), key=_changed, reverse=True
        ):
            total += path.stat().st_size
            if total > settings.log.size * settings.log.files:
                path.unlink(missing_ok=True)
    except OSError as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(place)) from None
    return place / f"{datetime.now():%Y%m%d-%H%M%S}-{PROCESS}{LOG_SUFFIX}"


def note(settings: Settings, path: Path) -> None:
    """Remember a log outside the folder, so that the newest one is found. A folder that cannot be written is left."""
    with contextlib.suppress(OSError):
        if path.resolve().parent == folder(settings).resolve() or not path.is_file():
            return
        listed = folder(settings) / "elsewhere"
        known = [other_path for other_path in _elsewhere(settings) if other_path != path.resolve()]
        private_folder(listed.parent)
        text = "".join(f"{other_path}\n" for other_path in [*known, path.resolve()][-NOTED:])
        write_atomically(listed, text.encode("utf-8", "surrogateescape"), 0o600, synced=False, private=True)


def _elsewhere(settings: Settings) -> list[Path]:
    try:
        text = read_private(folder(settings) / "elsewhere").decode("utf-8", "surrogateescape")
    except OSError:
        return []
    return [Path(line) for line in text.splitlines() if line]


def newest(settings: Settings) -> Path:
    """The log that was last written. Raises Diagnostic where there is none."""
    paths = [path for path in _elsewhere(settings) if path.is_file()]
    with contextlib.suppress(OSError):
        paths += [path for path in folder(settings).iterdir() if path.name.endswith(LOG_SUFFIX)]
    if not paths:
        hint = "/log FILE begins one; [log] always = true in the configuration keeps one of each session"
        raise Diagnostic("no session log yet", str(folder(settings)), hint)
    return max(paths, key=_changed)


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def part(path: Path, number: int) -> Path:
    """The path of a rotated part; the highest number is the oldest, and 0 is the file itself."""
    return path.with_name(f"{path.name}.{number}") if number else path


def parts(path: Path) -> list[Path]:
    """The parts of a log that exist, the oldest first."""
    # Path's own methods raise for a name that is too long.
    if os.path.isdir(path):  # it cannot be read, and `.` and `/` have no name that a number could follow
        return [path]
    number = 1
    while os.path.exists(part(path, number)):
        number += 1
    paths = [part(path, earlier) for earlier in range(number - 1, -1, -1)]
    return paths if number == 1 or os.path.exists(path) else paths[:-1]  # rotated, and nothing written since


def lines(path: Path, offset: int = 0, number: int = 0) -> Iterator[LogLine]:
    """Yield the lines of one file after so many bytes and lines, but those of an index.

    Raises Diagnostic where it cannot be read.
    """
    try:
        with opened(path) as file:
            file.seek(offset)
            while data := file.readline(LONGEST_LOG_LINE):
                number += 1
                entry = entry_of(data) if data.endswith(b"\n") else None
                if entry is None or (entry.kind, entry.text) != ("log", INDEX):
                    yield LogLine(path, number, data, entry)
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be read: {why(problem)}", str(path)) from None


def whole(path: Path) -> Iterator[LogLine]:
    """The lines of a log and of its rotated parts, the oldest first. Raises Diagnostic."""
    for part in parts(path):
        yield from lines(part)


_FORM = re.compile(rb'\{"time": ".*\}\n', re.S)
_BEGINS = re.compile(rb'\{"time": "[^"]*", "kind": "log", "text": "' + BEGIN.encode())


def damaged(path: Path) -> list[str]:
    """The places of lines in the last session of a log that are no entries, by their form. Raises Diagnostic."""
    problems: list[str] = []
    for part in parts(path):
        try:
            with opened(part) as file:
                for number, data in enumerate(iter(partial(file.readline, LONGEST_LOG_LINE), b""), 1):
                    if _BEGINS.match(data):
                        problems = []
                    elif not _FORM.fullmatch(data) and data.strip():
                        problems.append(f"{part}:{number}")
        except (OSError, ValueError) as problem:
            raise Diagnostic(f"cannot be read: {why(problem)}", str(part)) from None
    return problems


def left_out(places: Sequence[str], fate: str) -> str:
    """Say that lines cannot be read, and what was not done with them."""
    lines = counted(len(places), "line cannot be read", "lines cannot be read")
    return f"{lines}, first {places[0]}: what they held was not {fate}"
