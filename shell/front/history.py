"""The history of typed lines: a text file, a line each, shared by the prompt and the TUI and kept between runs.

Several processes write it at once. A line is added in one write, under a lock where one can be had at once. The file is
cut by a new one in its place, which whoever waited for the lock sees.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from macros.writing import write_whole

if sys.platform != "win32":
    import fcntl

KEPT = 5000
"""Lines that are read back; the file is cut to that many when it holds twice as many."""
PRIVATE = 0o600
TRIES = 3


class History:
    """A history file, which need not exist. A disk that cannot be written costs the history, never a line."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def lines(self) -> list[str]:
        """The kept lines, oldest first."""
        try:
            found = self.path.read_text(encoding="utf-8", errors="replace").split("\n")
        except OSError:
            return []
        lines = [line for line in found if line.strip()]
        if len(lines) > 2 * KEPT:
            self._cut()
        return lines[-KEPT:]

    def append(self, line: str) -> None:
        """Keep a line; an empty one and what has several lines in it are not kept."""
        if not line.strip() or "\n" in line or "\r" in line:
            return
        with contextlib.suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self._opened() as (descriptor, _):
                os.write(descriptor, f"{_gap(descriptor)}{line}\n".encode("utf-8", "replace"))

    def _cut(self) -> None:
        """Keep the last lines only, unless somebody else is writing just now."""
        with contextlib.suppress(OSError), self._opened() as (descriptor, locked):
            if not locked:
                return
            with open(descriptor, "rb", closefd=False) as old:
                lines = [line for line in old.read().split(b"\n") if line.strip()]
                write_whole(self.path, b"".join(line + b"\n" for line in lines[-KEPT:]), PRIVATE)
                late = old.read()  # from who had the file open already, and no lock
            with open(self.path, "ab") as new:
                new.write(late)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[tuple[int, bool]]:
        """The file to append to, and whether nobody else writes it meanwhile. Raises OSError."""
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
    """Whether the file is locked now; never waits. It is unlocked where it is closed."""
    if sys.platform == "win32":
        return True  # where a file that is open cannot be replaced
    else:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether the open file is still the one at the path: somebody may have cut it meanwhile."""
    with contextlib.suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    return False


def _gap(descriptor: int) -> str:
    """A line end where the last line has none: a full disk had cut it."""
    size = os.fstat(descriptor).st_size
    if not size:
        return ""
    os.lseek(descriptor, size - 1, os.SEEK_SET)
    return "" if os.read(descriptor, 1) == b"\n" else "\n"
