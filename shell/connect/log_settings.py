"""The settings of the session log: whether each session has one, and how large it may become.

[log]
always = true               # a log of each session, in the state folder
megabytes = 16              # the size at which a part is full
files = 8                   # the parts that are kept
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from multidrop.dialects import Diagnostic

MEGABYTE = 1_000_000


@dataclass(frozen=True)
class LogSettings:
    """How logs are kept; `size` is that of a part, bytes."""

    always: bool = False
    size: int = 16 * MEGABYTE
    files: int = 8


def read(table: Any, where: str) -> LogSettings:
    """Check the table of the configuration file. Raises Diagnostic with file and key."""
    if not isinstance(table, dict):
        raise Diagnostic("log is not a table", where, "write [log]")
    for key in table:
        if key not in ("always", "megabytes", "files"):
            raise Diagnostic(f"no key log.{key}", where, "valid: always, files, megabytes")
    always = table.get("always", False)
    if not isinstance(always, bool):
        raise Diagnostic("log.always is not true or false", where)
    size = _number(table, "megabytes", 16, 0.01, 10_000, where)
    files = _number(table, "files", 8, 1, 1000, where)
    if files != int(files):
        raise Diagnostic("log.files is not a whole number", where)
    return LogSettings(always, int(size * MEGABYTE), int(files))


def _number(table: dict[str, Any], key: str, default: float, least: float, most: float, where: str) -> float:
    found = table.get(key, default)
    if isinstance(found, bool) or not isinstance(found, int | float) or not least <= found <= most:
        raise Diagnostic(f"log.{key} is not a number from {least:g} to {most:g}", where)
    return found
