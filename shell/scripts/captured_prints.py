"""The prints of drives and verbs while a script runs."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

from multidrop.drives.events import Unsolicited
from multidrop.shell.channel import Channel
from multidrop.shell.events import Entered, OnBus, Output, Printed, SessionEvent
from multidrop.shell.origin import LastLine, Origin

MOST_CAPTURED_LINES = 10_000
"""The number of lines kept."""


class Hearing:
    """The lines since the last line that `/expect` may look at, and where the line under way went."""

    def __init__(self) -> None:
        self._lines: deque[tuple[str, bool]] = deque(maxlen=MOST_CAPTURED_LINES)
        """Each line, and whether `/expect` may find something in it: not in what the script prints itself."""
        self._own = False
        self._count = 0
        self._begun = 0
        self._changed = asyncio.Event()
        self.target: tuple[str, str] | None = None
        """Bus and address of the line under way; empty for a verb."""

    def take(self, event: SessionEvent) -> None:
        """Take what drives print by themselves."""
        if isinstance(event, OnBus) and isinstance(event.event, Unsolicited):
            for line in event.event.lines:
                self._add(line, True)

    def take_own(self, event: SessionEvent) -> None:
        """Take what a line of the script enters or prints. What other lines print meanwhile is not the script's."""
        if isinstance(event, Entered) and self.target is None:
            self.target = (event.bus, event.address)
        elif isinstance(event, Printed | Output):
            self._add(event.text, not self._own)

    def of(self, origin: Origin) -> Origin:
        """The origin of the script's lines, which are heard here."""
        return replace(
            origin, heard=self.take_own, last=LastLine(origin.last.printed if origin.last is not None else None)
        )

    def begin(self, afresh: bool) -> None:
        """Note the beginning of a line; `afresh`: it is not a verb of scripts; `/expect` looks from here on."""
        self._own = not afresh
        if afresh:
            self._lines.clear()
        self._begun, self.target = self._count, None

    def printed(self) -> tuple[str, ...]:
        since = min(self._count - self._begun, len(self._lines))
        return tuple(text for text, _ in islice(self._lines, len(self._lines) - since, None))

    def last(self, most: int) -> list[str]:
        """The last lines that `/expect` may look at."""
        return self._heard()[-most:]

    async def finds(self, text: str, seconds: float) -> bool:
        """True if a line contains the text, now or within a time, s."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not any(text in line for line in self._heard()):
                    self._changed.clear()
                    await self._changed.wait()
        return any(text in line for line in self._heard())

    def _heard(self) -> list[str]:
        return [line for line, counts in self._lines if counts]

    def _add(self, line: str, counts: bool) -> None:
        self._lines.append((line, counts))
        self._count += 1
        self._changed.set()


@contextlib.contextmanager
def hearing(channel: Channel) -> Iterator[Hearing]:
    heard = Hearing()
    leave = channel.subscribe(heard.take, Unsolicited)
    try:
        yield heard
    finally:
        leave()
