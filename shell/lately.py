"""The last lines that drives printed, for a wait for a text, which also looks before its own beginning."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from contextvars import ContextVar

from multidrop.drives.events import Unsolicited
from multidrop.shell.events import OnBus, Printed, SessionEvent

KEPT = 1000
"""The number of lines kept."""
_begun: ContextVar[int | None] = ContextVar("begun", default=None)
"""The number of lines before the last line that this macro, script or front end sent to a drive."""


class Lately:
    """The last lines that drives printed, replies and others, each with its number."""

    def __init__(self) -> None:
        self._lines: deque[tuple[int, str]] = deque(maxlen=KEPT)
        self._count = 0
        self._typed = 0
        """The number of lines before the last line that was sent to a drive."""
        self._changed = asyncio.Event()

    def take(self, event: SessionEvent) -> None:
        """Take a session's event."""
        if isinstance(event, Printed):
            self._add(event.text)
        elif isinstance(event, OnBus) and isinstance(event.event, Unsolicited):
            for line in event.event.lines:
                self._add(line)

    def begin(self) -> None:
        """Note that a line is sent to a drive: the next wait of its sender looks from here on."""
        self._typed = self._count
        _begun.set(self._count)

    async def finds(self, text: str, seconds: float) -> bool:
        """Whether a line contains the text: since the sender's last line, or within a time, s."""
        begun = _begun.get()
        since = self._typed if begun is None else begun
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not self._has(text, since):
                    self._changed.clear()
                    await self._changed.wait()
        return self._has(text, since)

    def last(self, most: int) -> list[str]:
        """The last lines."""
        return [line for _, line in self._lines][-most:]

    def _has(self, text: str, since: int) -> bool:
        return any(text in line for number, line in self._lines if number >= since)

    def _add(self, line: str) -> None:
        self._lines.append((self._count, line))
        self._count += 1
        self._changed.set()
