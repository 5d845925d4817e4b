"""A program on a terminal of its own, for measurements: keys in, and when a text was first shown."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import sys
import termios
import threading
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CURSOR_QUERY = b"\x1b[6n"
KEPT = 200_000
"""Bytes of the end of the output that are kept."""


def environment(folder: Path) -> dict[str, str]:
    """A process's own configuration, a terminal with colours, and modules that are compiled once, as if installed."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return inherited | {
        "PYTHONPATH": str(ROOT),
        "MULTIDROP_CONFIG_DIR": str(folder / "conf"),
        "MULTIDROP_STATE_DIR": str(folder / "state"),
        "MULTIDROP_DATA_DIR": str(folder / "data"),
        "TERM": "xterm-256color",
        "COLORTERM": "truecolor",
    }


def multidrop(*arguments: str) -> list[str]:
    """The command of this tree."""
    return [sys.executable, "-m", "multidrop", *arguments]


class Terminal:
    """A terminal that reads everything at once and answers cursor queries. `size`: its columns and rows."""

    def __init__(self, command: Sequence[str], folder: Path, size: tuple[int, int] = (120, 40)) -> None:
        self.shown = bytearray()
        """The end of the output."""
        self.count = 0
        """Bytes of output so far."""
        pid, self.descriptor = pty.fork()
        if pid == 0:
            os.chdir(folder)
            os.execvpe(command[0], list(command), environment(folder))
        self.pid = pid
        fcntl.ioctl(self.descriptor, termios.TIOCSWINSZ, struct.pack("HHHH", *reversed(size), 0, 0))
        self._ended = False
        self._sought = b""
        self._found_at: float | None = None
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while not self._ended:
            if not select.select([self.descriptor], [], [], 0.2)[0]:
                continue
            try:
                data = os.read(self.descriptor, 65536)
            except OSError:
                return
            self._take(data, time.monotonic())

    def _take(self, data: bytes, now: float) -> None:
        sought = self._sought
        seam = bytes(self.shown[-len(sought) :]) if sought else b""
        self.shown += data
        self.count += len(data)
        if len(self.shown) > 2 * KEPT:
            del self.shown[:-KEPT]
        if sought and sought in seam + data:
            self._found_at, self._sought = now, b""
        for _ in range(data.count(CURSOR_QUERY)):
            os.write(self.descriptor, b"\x1b[1;1R")

    def type(self, data: bytes) -> None:
        """Keys."""
        os.write(self.descriptor, data)

    def seek(self, text: bytes) -> None:
        """Note from now on when a text is first shown."""
        self._found_at, self._sought = None, text

    def found(self, seconds: float) -> float | None:
        """The time at which the text was shown (CLOCK_MONOTONIC, s); None if it is not within this time."""
        limit = time.monotonic() + seconds
        while self._found_at is None and time.monotonic() < limit:
            time.sleep(0.001)
        return self._found_at

    def until(self, text: bytes, seconds: float = 30.0) -> None:
        """Wait for a text on the terminal. Raises SystemExit with what was shown."""
        limit = time.monotonic() + seconds
        while text not in bytes(self.shown):
            if time.monotonic() > limit:
                shown = bytes(self.shown[-3000:]).decode(errors="replace")
                raise SystemExit(f"{text!r} was not shown; at the end:\n{shown}")
            time.sleep(0.02)

    def end(self) -> None:
        """Kill it."""
        os.kill(self.pid, 9)
        os.waitpid(self.pid, 0)
        self._ended = True
        self._thread.join()
        os.close(self.descriptor)
