"""Lines above the prompt: collected, bounded in number, and shown at most ten times a second.

They replace standard output and standard error while the prompt runs. A terminal that is not read loses lines; once it
is read again, it shows how many. The prompt is then drawn again, since parts of it were lost, too.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import sys
from collections import deque
from collections.abc import Iterator
from typing import Any, TextIO, cast

from prompt_toolkit.application import Application, run_in_terminal

from shell.outlets import Outlet

MOST = 1000
"""The largest number of waiting lines."""
PAUSE = 0.1
"""The time between two updates, s."""


class Stream(io.TextIOBase):
    """A text stream whose lines appear above the prompt. `keep`: never drop a line (warnings and failures)."""

    def __init__(self, lines: LinesAbove, keep: bool) -> None:
        self._lines, self._keep = lines, keep
        self._begun = ""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The terminal's encoding."""
        return self._lines.app.output.encoding()

    def isatty(self) -> bool:
        """Whether a terminal shows the lines."""
        return self._lines.on_terminal

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, text: str) -> int:
        """Take text; each complete line is shown."""
        *whole, self._begun = (self._begun + text).split("\n")
        for line in whole:
            self._lines.add(line, self._keep)
        return len(text)


class LinesAbove:
    """The lines above the prompt of an application. Belongs to the event loop's thread."""

    def __init__(self, app: Application[Any]) -> None:
        self.app = app
        self._loop = asyncio.get_running_loop()
        self._lines: deque[str] = deque()
        self._missing = 0
        self._something = asyncio.Event()
        self._damaged = False
        """Parts of the prompt were lost on their way to the terminal."""
        stdout = getattr(app.output, "stdout", None)
        self._lane = stdout.lane if isinstance(stdout, Outlet) else None
        self.on_terminal = stdout is not None and stdout.isatty()

    def add(self, line: str, keep: bool) -> None:
        """Queue a line; if too many wait, drop and count it."""
        if keep or (len(self._lines) < MOST and not self._missing):
            self._lines.append(line)
        else:
            self._missing += 1
        self._something.set()

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Replace the standard streams; standard output stays if it is not a terminal."""
        before, task = (sys.stdout, sys.stderr), self._loop.create_task(self._show())
        notice = self._lane.notice if self._lane else None
        if self._lane:
            self._lane.notice = self._lost
        sys.stderr = cast(TextIO, Stream(self, keep=True))
        if sys.stdout.isatty():
            sys.stdout = cast(TextIO, Stream(self, keep=False))
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before
            task.cancel()
            if self._lane and notice:
                self._lane.notice = notice
            self._write()

    def _lost(self, dropped: int) -> bytes:
        """Draw the prompt again after a loss. Called from the lane's thread."""
        self._damaged = True
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._something.set)
        return b""

    async def _show(self) -> None:
        while True:
            await self._something.wait()
            while (self._lane and self._lane.behind) or (self.app.is_running and self.app.is_done):
                await asyncio.sleep(0.01)
            self._something.clear()
            if self._damaged and self.app.is_running:
                self._damaged = False
                self.app.output.write_raw("\x1b[0m\r\n\x1b[J")
                self.app.renderer.reset()
            await run_in_terminal(self._write)
            await asyncio.sleep(PAUSE)

    def _write(self) -> None:
        lines = list(self._lines)
        self._lines.clear()
        if self._missing:
            lines.append(f"{self._missing} lines are missing here: the terminal did not take them")
            self._missing = 0
        if lines:
            output = self.app.output
            output.enable_autowrap()
            output.write_raw("".join(f"{line}\n" for line in lines))
            output.flush()
