"""Lines above the prompt: collected, bounded in number, and shown at most ten times a second.

They replace standard output and standard error while the prompt runs. They are written in chunks, as fast as the
terminal takes them, and the prompt is drawn again at least every 50 ms. A terminal that is not read loses lines; once
it is read again, it shows how many. The prompt is then drawn again, since parts of it were lost, too.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, TextIO, cast

from prompt_toolkit.application import Application, in_terminal

from shell.outlets import Outlet

MOST = 1000
"""The largest number of lines that wait for a terminal that takes none."""
BURST = 30_000
"""The largest number of lines between two updates of a terminal that takes them."""
PATIENCE = 0.1
"""The time, s, after which a terminal that does not keep up counts as one that takes none."""
PAUSE = 0.1
"""The time between two updates, s."""
BREATH = 0.01
"""The time between two updates while lines wait, s."""
SLICE = 0.05
"""The longest time, s, for which an update hides the prompt."""
CHUNK = 16 * 1024
"""The number of characters after which the terminal is asked whether it keeps up; less than a lane's limit."""


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
        self._lines.add(whole, self._keep)
        return len(text)


class LinesAbove:
    """The lines above the prompt of an application. Belongs to the event loop's thread."""

    def __init__(self, app: Application[Any]) -> None:
        self.app = app
        self._loop = asyncio.get_running_loop()
        self._lines: deque[tuple[str, bool]] = deque()
        """The lines that wait, and whether they are kept in any case."""
        self._missing = 0
        self._stuck = False
        self._something = asyncio.Event()
        self._damaged = False
        """Parts of the prompt were lost on their way to the terminal."""
        stdout = getattr(app.output, "stdout", None)
        self._lane = stdout.lane if isinstance(stdout, Outlet) else None
        self.on_terminal = stdout is not None and stdout.isatty()

    def add(self, lines: Sequence[str], keep: bool) -> None:
        """Queue lines; drop and count those for which there is no room."""
        room = len(lines) if keep else self._room
        self._lines.extend((line, keep) for line in lines[:room])
        self._missing += len(lines[room:])
        self._something.set()

    @property
    def _room(self) -> int:
        """The number of lines that may be queued; none after a loss until the queue is empty."""
        return 0 if self._missing else max(0, (MOST if self._stuck else BURST) - len(self._lines))

    @property
    def _behind(self) -> bool:
        return self._lane is not None and self._lane.behind

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
            self._write_rest()

    def _lost(self, dropped: int) -> bytes:
        """Draw the prompt again after a loss. Called from the lane's thread."""
        self._damaged = True
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._something.set)
        return b""

    async def _show(self) -> None:
        while True:
            await self._something.wait()
            await self._taken()
            self._something.clear()
            if self._damaged and self.app.is_running:
                self._damaged = False
                self.app.output.write_raw("\x1b[0m\r\n\x1b[J")
                self.app.renderer.reset()
            async with in_terminal():
                await self._write_some()
            await asyncio.sleep(BREATH if self._lines else PAUSE)

    async def _taken(self) -> None:
        """Wait until the terminal has taken what was written, and the prompt may be hidden."""
        since = self._loop.time()
        while self._behind or (self.app.is_running and self.app.is_done):
            self._stuck = self._behind and self._loop.time() > since + PATIENCE
            await asyncio.sleep(0.01)
        self._stuck = False

    async def _write_some(self) -> None:
        """Write chunks until nothing waits, or the prompt must be drawn again."""
        until = self._loop.time() + SLICE
        while (self._lines or self._missing) and self._loop.time() < until:
            if self._behind:
                await asyncio.sleep(0.001)
            else:
                self._write(self._next())
                await asyncio.sleep(0)
        if self._lines or self._missing:
            self._something.set()

    def _write(self, text: str) -> None:
        output = self.app.output
        output.enable_autowrap()
        output.write_raw(text)
        output.flush()

    def _next(self) -> str:
        """The next chunk of what waits, with the number of lines that are missing at its end."""
        size, lines = 0, []
        while self._lines and size < CHUNK:
            lines.append(self._lines.popleft()[0])
            size += len(lines[-1])
        if self._missing and not self._lines:
            lines.append(f"{self._missing} lines are missing here: the terminal did not take them")
            self._missing = 0
        return "".join(f"{line}\n" for line in lines)

    def _write_rest(self) -> None:
        """Pass on what waits at the end: warnings, and as many other lines as a terminal takes at once."""
        room, waiting = CHUNK, list(self._lines)
        self._lines.clear()
        for line, keep in waiting:
            if keep or room > 0:
                self._lines.append((line, keep))
                room -= len(line)
            else:
                self._missing += 1
        while text := self._next():
            if self._lane:
                self._lane.put(text.encode(self.app.output.encoding(), "backslashreplace"), keep=True)
            else:
                self._write(text)
