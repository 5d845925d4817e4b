"""The terminal of a process: what the prompt writes to it, and a reader who may be slow, or away.

The product's own outlets and their writer are in front of it. A terminal that nobody reads takes a little, and then
nothing: its thread waits there, and nothing else may.
"""

from __future__ import annotations

import os
import re
import sys
from types import SimpleNamespace
from typing import Any

from multidrop.shell.streams.event_printer import EventPrinter
from multidrop.shell.streams.output_streams import OutputStream, Streams, _notice
from multidrop.shell.threads import BoundedWriter
from soak.simulation.system.clock import SimulatedLoop

TAKEN = 256
"""The number of bytes that the system takes of a terminal that is not read."""
LIMIT = 1500
"""The number of bytes that wait before it: so little that lines are lost in a story."""
PAUSE = 1.0
"""The time of a slow reader for each byte, s."""
MISSING = re.compile(rb"(\d+) lines? (?:is|are) missing here")


class Terminal(BoundedWriter):
    """A terminal, as the writer of its outlets. Made by the process that it belongs to."""

    def __init__(self, loop: SimulatedLoop) -> None:
        self._loop, self._room, self._slow = loop, -1, False
        """`_room`: bytes that it takes now; less than 0: any number."""
        self.shown = bytearray()
        self.most = 0
        """The most bytes that have waited; a single line is taken whatever its length."""
        self.put_so_far = 0
        """The number of lines that were to be shown."""
        null = os.open(os.devnull, os.O_WRONLY)
        stream: Any = SimpleNamespace(isatty=lambda: True, fileno=lambda: null, encoding="utf-8")
        super().__init__(self._take, _notice(stream, self), lambda problem: None, LIMIT, LIMIT)
        self._outlets = OutputStream(stream, self, False), OutputStream(stream, self, True)
        os.close(null)
        self._printer = EventPrinter(talkative=True)

    def show(self, event: Any) -> None:
        """Print an event of the session."""
        before = sys.stdout, sys.stderr
        sys.stdout, sys.stderr = self._outlets
        try:
            self._printer.show(event)
        finally:
            sys.stdout, sys.stderr = before

    async def finish(self) -> list[str]:
        """End as the prompt does; return what is wrong with what it showed."""
        late = await Streams([self._outlets[1]]).finish(lambda: True)
        self.close(0.0)
        lines = self.shown.count(b"\n") - len(MISSING.findall(self.shown))
        missing = sum(map(int, MISSING.findall(self.shown)))
        if late or lines + missing == self.put_so_far:
            return []
        return [f"of {self.put_so_far} lines the terminal shows {lines} and says that {missing} are missing"]

    # The reader

    def reader(self, away: float = 0.0, slow: bool = False) -> None:
        """Go away for a while, s, or read a byte at a time meanwhile; 0: read on."""
        self._room, self._slow = TAKEN if away else -1, slow
        if away:
            self._loop.call_later(away, self.reader)
        if slow:
            self._loop.call_later(PAUSE, self._reads)
        self._changed.notify_all()

    def _reads(self) -> None:
        if self._slow:
            self._room += 1
            self._changed.notify_all()
            self._loop.call_later(PAUSE, self._reads)

    # The system

    def put(self, data: bytes, keep: bool = False, count: int = 1) -> bool:
        """Queue lines."""
        self.put_so_far += count
        before, taken = self._held, super().put(data, keep, count)
        if taken and before and not keep:
            self.most = max(self.most, self._held)
        return taken

    @property
    def due(self) -> bool:
        """Whether its thread has something to do: it waits while the terminal takes nothing."""
        return super().due and bool(self._room or self.closed)

    def _take(self, data: bytes) -> int:
        size = len(data) if self._room < 0 else min(len(data), self._room)
        self._room = max(self._room - size, 0) if self._room >= 0 else -1
        self.shown += data[:size]
        return size
