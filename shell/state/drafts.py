"""Copies of text that was edited and not saved: a crash or a hang-up of the line loses no more than seconds of work.

A copy is deleted when its text is saved or given up. It is offered when its file is opened again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path
from typing import NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import why
from multidrop.macros.atomic import write_atomically

FOLDER = "drafts"
MOST = 50
"""The largest number of copies; the oldest are deleted."""


class Draft(NamedTuple):
    """A text that was not saved: its file, and the time of its last change."""

    file: str
    text: str
    at: str


class Drafts:
    """The copies in the folder of the state."""

    def __init__(self, state: Path) -> None:
        self._folder = state / FOLDER

    def keep(self, draft: Draft) -> None:
        """Write a copy, whole or not at all. Raises Diagnostic. For a thread: it syncs."""
        path = self._path(draft.file)
        try:
            write_atomically(path, json.dumps(draft._asdict()).encode(), 0o600)
            for old in sorted(self._folder.glob("*.json"), key=lambda each: each.stat().st_mtime)[:-MOST]:
                old.unlink(missing_ok=True)
        except OSError as problem:
            raise Diagnostic(f"no copy of the text can be kept: {why(problem)}", draft.file, "save the file") from None

    def find(self, file: str) -> Draft | None:
        """Return the copy for a file; None without one that can be read."""
        try:
            found = json.loads(self._path(file).read_text(encoding="utf-8"))
            return Draft(*(str(found[key]) for key in Draft._fields))
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            return None

    def forget(self, file: str) -> None:
        """Delete the copy for a file, if there is one."""
        with contextlib.suppress(OSError):
            self._path(file).unlink(missing_ok=True)

    def _path(self, file: str) -> Path:
        place = str(Path(file).absolute())
        return self._folder / f"{hashlib.sha256(place.encode('utf-8', 'surrogateescape')).hexdigest()[:24]}.json"
