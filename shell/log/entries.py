r"""The format of the session log, both ways: an entry as a line of JSON, and a line as an entry.

    {"time": "2026-11-22T12:41:05.123456+01:00", "kind": "log", "text": "multidrop 0.1.0", "format": 1}
    {"time": "2026-11-22T12:41:06.020115+01:00", "kind": "typed", "bus": "press", "drive": "b", "text": "PR P", ...}
    {"time": "2026-11-22T12:41:06.020301+01:00", "kind": "sent", "bus": "press", "drive": "b", "bytes": "bPR P\n"}

`bytes` has one character for each byte, U+0000 to U+00FF. Keys without a value are left out. Secrets are left out, too.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from multidrop.shell.secrets import without_secrets

FORMAT = 1
"""The version of the format, in the first entry of each file."""
BEGIN = "session"
"""The first word of the `log` entry of a new session; that of a further part has another one."""
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
_MARKS = ("poll", "warning", "raw")


@dataclass(frozen=True)
class Entry:
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


def line_of(entry: Entry) -> bytes:
    """Encode an entry as a line, with its end."""
    fields: dict[str, Any] = {"time": entry.time.isoformat(timespec="microseconds"), "kind": entry.kind}
    if entry.bus:
        fields["bus"] = entry.bus
    if entry.drive:
        fields["drive"] = entry.drive
    fields["bytes" if entry.kind in TRAFFIC else "text"] = without_secrets(entry.text)
    if entry.by:
        fields["by"] = entry.by
    fields |= {name: True for name in _MARKS if getattr(entry, name)}
    if entry.kind == "log":
        fields["format"] = FORMAT
    return json.dumps(fields).encode() + b"\n"


def entry_of(line: bytes) -> Entry | None:
    """Decode a line; None for anything that `line_of` does not make."""
    try:
        fields = json.loads(line)
        return _entry(fields) if isinstance(fields, dict) else None
    except (ValueError, RecursionError):
        return None


def _entry(fields: dict[str, Any]) -> Entry | None:
    kind = fields.get("kind")
    if not isinstance(kind, str) or kind not in KINDS or fields.get("format", FORMAT) != FORMAT:
        return None
    names = ("time", "bytes" if kind in TRAFFIC else "text", "bus", "drive", "by")
    time, text, bus, drive, by = (fields.get(name, "") for name in names)
    if not all(isinstance(each, str) for each in (time, text, bus, drive, by)):
        return None
    if kind in TRAFFIC and any(ord(each) > 0xFF for each in text):
        return None
    at = datetime.fromisoformat(time)
    if at.tzinfo is None:
        return None
    return Entry(at, kind, text, bus, drive, by, **{name: fields.get(name) is True for name in _MARKS})
