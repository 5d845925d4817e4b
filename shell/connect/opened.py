"""The URLs that were opened last, for the start page: in the state folder, the newest first.

It saves typing and decides nothing. So a file that cannot be read or written costs only that.
"""

from __future__ import annotations

import contextlib
import json
import time
from dataclasses import dataclass
from pathlib import Path

from multidrop.macros.atomic import write_atomically

MOST = 12


@dataclass(frozen=True)
class Opened:
    """A URL as it was typed, or the name of a saved connection, and when it was opened (s since 1970)."""

    url: str
    at: float


def lately(folder: Path) -> list[Opened]:
    """The URLs opened last, the newest first."""
    try:
        rows = json.loads(_file(folder).read_text(encoding="utf-8"))["opened"]
        return [Opened(str(row["url"]), float(row["at"])) for row in rows][:MOST]
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return []


def note(folder: Path, url: str) -> None:
    """Note that a URL was opened now."""
    rows = [Opened(url, time.time()), *(each for each in lately(folder) if each.url != url)][:MOST]
    text = json.dumps({"opened": [{"url": each.url, "at": each.at} for each in rows]}, indent=1) + "\n"
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(_file(folder), text.encode())


def _file(folder: Path) -> Path:
    return folder / "opened.json"
