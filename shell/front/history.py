"""The history of typed lines: a text file that the prompt and the TUI share and keep between runs.

Several processes may write it at once. A line is appended in one write, under a lock where one is free. To cut the
file, a process replaces it by a new one; another process that waited for the lock then opens the new file.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from multidrop.macros.atomic import write_atomically

if sys.platform != "win32":
    import fcntl

KEPT = 5000
"""The number of lines read back; a file of twice as many is cut to that number."""
PRIVATE = 0o600
TRIES = 3


class History:
    """A history file, which need not exist. A disk that cannot be written loses the history, never the typed line."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def lines(self) -> list[str]:
        """The lines of the file, oldest first."""
        try:
            found = self.path.read_text(encoding="utf-8", errors="replace").split("\n")
        except OSError:
            return []
        lines = [line for line in found if line.strip()]
        if len(lines) > 2 * KEPT:
            self._cut()
        return lines[-KEPT:]

    def append(self, line: str) -> None:
        """Append a line; empty lines and texts of several lines are left out."""
        if not line.strip() or "\n" in line or "\r" in line:
            return
        with contextlib.suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self._opened() as (descriptor, _):
                os.write(descriptor, f"{_gap(descriptor)}{line}\n".encode("utf-8", "replace"))

    def _cut(self) -> None:
        """Cut the file to its last lines, unless another process writes it now."""
        with contextlib.suppress(OSError), self._opened() as (descriptor, locked):
            if not locked:
                return
            with open(descriptor, "rb", closefd=False) as old:
                lines = [line for line in old.read().split(b"\n") if line.strip()]
                write_atomically(self.path, b"".join(line + b"\n" for line in lines[-KEPT:]), PRIVATE)
                late = old.read()  # from a process that had the file open, and no lock
            with open(self.path, "ab") as new:
                new.write(late)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[tuple[int, bool]]:
        """The file to append to, and whether this process has locked it. Raises OSError."""
        for tried in range(TRIES):
            descriptor = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, PRIVATE)
            try:
                locked = _lock(descriptor)
                if tried + 1 == TRIES or _is_at(descriptor, self.path):
                    yield descriptor, locked
                    return
            finally:
                os.close(descriptor)


def _lock(descriptor: int) -> bool:
    """Try to lock the file without waiting. Closing it unlocks it."""
    if sys.platform == "win32":
        return True  # an open file cannot be replaced there
    else:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether the path still names the open file: another process may have cut it."""
    with contextlib.suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    return False


def _gap(descriptor: int) -> str:
    """A line end if the last line has none, as after a full disk."""
    size = os.fstat(descriptor).st_size
    if not size:
        return ""
    os.lseek(descriptor, size - 1, os.SEEK_SET)
    return "" if os.read(descriptor, 1) == b"\n" else "\n"
