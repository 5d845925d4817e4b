"""Small files of the state folder: JSON, replaced as a whole, and read as if it were absent where it is damaged."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from multidrop.base.atomic import read_private, write_atomically

T = TypeVar("T")


class Damaged(ValueError):
    """The content of a file is not what a session writes."""


class Store:
    """The files of one folder. `most`: the largest number of files; the oldest are deleted (0: any number)."""

    def __init__(self, folder: Path, most: int = 0) -> None:
        self.folder, self._most = folder, most

    def write(self, name: str, content: object, indent: int | None = None, *, synced: bool = True) -> None:
        """Replace a file, whole or not at all. Raises OSError. For a thread where it is `synced`."""
        text = json.dumps(content, indent=indent) + ("\n" if indent else "")
        write_atomically(self.folder / name, text.encode(), 0o600, synced=synced, private=True)
        if self._most:
            with contextlib.suppress(OSError):  # this file is written, whichever session deletes the old ones
                for old in sorted(self.folder.glob("*.json"), key=lambda each: each.stat().st_mtime)[: -self._most]:
                    old.unlink()

    def load(self, name: str, parse: Callable[[Any], T]) -> T:
        """Parse a file. Raises OSError, and Damaged where `parse` fails."""
        try:
            return parse(json.loads(read_private(self.folder / name).decode()))
        except (ValueError, TypeError, KeyError, RecursionError):
            raise Damaged(name) from None

    def find(self, name: str, parse: Callable[[Any], T]) -> T | None:
        """Parse a file; None for one that is absent, damaged or cannot be read."""
        try:
            return self.load(name, parse)
        except (OSError, Damaged):
            return None

    def forget(self, name: str) -> None:
        """Delete a file, if there is one and it can be deleted."""
        with contextlib.suppress(OSError):
            (self.folder / name).unlink()


def digest(text: str, length: int) -> str:
    """A short name for a long text."""
    import hashlib  # most sessions name no file by its content

    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:length]
