"""The history of typed lines: a text file, a line each, shared by the prompt and the TUI and kept between runs."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

KEPT = 5000
"""Lines that are read back; the file is cut to that many when it holds twice as many."""


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
            self._cut(lines[-KEPT:])
        return lines[-KEPT:]

    def append(self, line: str) -> None:
        """Keep a line; an empty one and what has several lines in it are not kept."""
        if not line.strip() or "\n" in line or "\r" in line:
            return
        with contextlib.suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            with open(descriptor, "ab") as file:
                file.write(f"{line}\n".encode("utf-8", "replace"))

    def _cut(self, lines: list[str]) -> None:
        beside = self.path.with_name(f"{self.path.name}.{os.getpid()}.tmp")
        with contextlib.suppress(OSError):
            beside.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
            os.replace(beside, self.path)
