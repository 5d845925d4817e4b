"""Lines above the prompt: gathered, bounded, shown at most ten times a second, and never waited for.

They take the place of standard output and standard error while there is a prompt. A terminal that does not take them
loses some, and is told how many when it does again; then the prompt is drawn anew, as parts of it were lost, too.
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
"""Lines that wait at most."""
PAUSE = 0.1
"""Seconds between two shows."""


class Stream(io.TextIOBase):
    """A text stream whose lines appear above the prompt. `keep`: those of warnings and failures, which are not lost."""

    def __init__(self, lines: LinesAbove, keep: bool) -> None:
        self._lines, self._keep = lines, keep
        self._begun = ""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The terminal's encoding."""
        return self._lines.app.output.encoding()

    def isatty(self) -> bool:
        """Whether a terminal shows them."""
        return self._lines.on_terminal

    def writable(self) -> bool:
        """It is."""
        return True

    def write(self, text: str) -> int:
        """Take text, which is shown line by line."""
        *whole, self._begun = (self._begun + text).split("\n")
        for line in whole:
            self._lines.add(line, self._keep)
        return len(text)


class LinesAbove:
    """What appears above the prompt of an application. For the event loop's thread."""

    def __init__(self, app: Application[Any]) -> None:
        self.app = app
        self._loop = asyncio.get_running_loop()
        self._lines: deque[str] = deque()
        self._missing = 0
        self._something = asyncio.Event()
        self._stale = False
        """Parts of the prompt were dropped on their way to the terminal."""
        stdout = getattr(app.output, "stdout", None)
        self._lane = stdout.lane if isinstance(stdout, Outlet) else None
        self.on_terminal = stdout is not None and stdout.isatty()

    def add(self, line: str, keep: bool) -> None:
        """Show a line when there is time; where too many wait it is dropped, and counted."""
        if keep or (len(self._lines) < MOST and not self._missing):
            self._lines.append(line)
        else:
            self._missing += 1
        self._something.set()

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Show them, in place of the standard streams; standard output stays where it is no terminal."""
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
        """From the lane's thread: the terminal takes something again, and has missed parts of the prompt."""
        self._stale = True
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._something.set)
        return b""

    async def _show(self) -> None:
        while True:
            await self._something.wait()
            while (self._lane and self._lane.behind) or (self.app.is_running and self.app.is_done):
                await asyncio.sleep(0.01)
            self._something.clear()
            if self._stale and self.app.is_running:
                self._stale = False
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
