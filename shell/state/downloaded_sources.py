"""Copies of downloaded files, found again by what the drive then held: the remarks and the layout of an upload.

A copy saves a person's remarks and proves nothing: it is used only where its lines are those of the drive. So a copy
that cannot be written or read costs no more than that.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path
from typing import NamedTuple

from multidrop.dialects.program_files import Held
from multidrop.macros.atomic import write_atomically

FOLDER = "sources"
MOST = 200
"""The largest number of copies; the oldest are deleted."""


class Source(NamedTuple):
    """A downloaded file: its name, its text, and the time of its download."""

    file: str
    text: str
    at: str


def remember(state: Path, held: Held, source: Source) -> None:
    """Keep a copy of the file whose download left this in the drive."""
    path = _path(state, held)
    with contextlib.suppress(OSError):
        write_atomically(path, json.dumps(source._asdict()).encode(), 0o600)
        for old in sorted(path.parent.glob("*.json"), key=lambda each: each.stat().st_mtime)[:-MOST]:
            old.unlink()


def recall(state: Path, held: Held) -> Source | None:
    """Return the last downloaded file that left this in a drive; None for none."""
    try:
        found = json.loads(_path(state, held).read_text(encoding="utf-8"))
        return Source(*(str(found[key]) for key in Source._fields))
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return None


def _path(state: Path, held: Held) -> Path:
    listing = "\n".join(f"{line.at} {line.text.upper()}" for line in held.lines)
    return state / FOLDER / f"{hashlib.sha256(listing.encode()).hexdigest()[:32]}.json"
