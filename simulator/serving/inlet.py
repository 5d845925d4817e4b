"""A client's way onto a wire. It is read only while there is room, so what it writes too fast waits with the client.

As much as a serial port's buffer holds waits here, and goes to the wire in short pieces, so that the clients of a bus
take turns. While that is full the client is not read; a look every few milliseconds sees when there is room again. What
a client that has gone has left has some seconds to go out, as with a serial port that is closed; then the rest is
dropped, which is said.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Protocol

from simulator.serving.running import RunningFloor

HOLD = 4096
"""Bytes of one client that wait here."""
PIECE = 256
"""Bytes that are read at a time, so that no turn of the event loop takes long, and that wait on the wire, at least."""
AHEAD = 0.02
"""Seconds of a fast wire's bytes that wait on it, where those are more."""
LOOK = 0.01
"""Seconds between two looks while a client is not read."""
GRACE = 10.0
"""Seconds that a client that has gone has for what it left: 9600 bytes at 9600 baud."""


class Tap(Protocol):
    """What an inlet needs of its endpoint."""

    def pause(self) -> None:
        """Read the client no more."""

    def resume(self) -> None:
        """Read it again."""

    def look(self) -> None:
        """See to what cannot wait until it is read again: the client may take back what it has written."""

    def gone(self) -> bool:
        """Whether there is no client any more, as far as the system tells."""

    def drop(self) -> None:
        """Throw away what it left."""


class Inlet:
    """Puts what a client writes on the wire, and pauses its reading where it writes faster than the wire carries."""

    def __init__(self, floor: RunningFloor, bus: str, tap: Tap) -> None:
        self._floor, self._bus = floor, bus
        self._tap: Tap | None = tap
        self._source = floor.source()
        self._pending: deque[tuple[bytes, int | None]] = deque()
        self._waiting = 0
        self._paused = False
        self._gone_at: float | None = None
        self._timer: asyncio.TimerHandle | None = None

    @property
    def room(self) -> int:
        """How many bytes may be read now."""
        return min(PIECE, HOLD - self._waiting)

    def write(self, data: bytes, baud: int | None = None) -> None:
        """Put bytes on the wire as it carries them. `baud`: what the client sends at, where it is known."""
        self._pending.append((data, baud))
        self._waiting += len(data)
        self._feed()
        if self._tap is not None and not self._paused and self.room <= 0:
            self._paused = True
            self._tap.pause()
        self._come_back()

    def retract(self) -> None:
        """The client takes back what has not begun to go out."""
        self._pending.clear()
        self._waiting = 0
        self._floor.retract(self._bus, self._source)

    def close(self) -> None:
        """The client has gone. What it left goes out, as far as there is time."""
        self._tap = None

    def _feed(self) -> None:
        """Hand on as much as there is room for on the wire."""
        most = max(PIECE, int(AHEAD * self._floor.bytes_a_second(self._bus)))
        wire = self._floor.floor.wires[self._bus]
        while self._pending and (room := most - wire.queued(self._source)) > 0:
            data, baud = self._pending.popleft()
            if data[room:]:
                self._pending.appendleft((data[room:], baud))
            self._waiting -= len(data[:room])
            self._floor.write(self._bus, data[:room], self._source, baud)

    def _come_back(self) -> None:
        if self._timer is None and (self._waiting or self._paused):
            self._timer = self._floor.loop.call_later(LOOK, self._look)

    def _look(self) -> None:
        self._timer = None
        if self._tap is not None:
            self._tap.look()
        self._feed()
        if self._overstays():
            self._drop()
        if self._paused and self._tap is not None and 2 * self._waiting <= HOLD:
            self._paused = False
            self._tap.resume()
        self._come_back()

    def _overstays(self) -> bool:
        """Whether the client has gone for so long that what it left is nobody's any more."""
        now = self._floor.loop.time()
        if self._tap is not None and not self._tap.gone():
            self._gone_at = None
        elif self._gone_at is None:
            self._gone_at = now
        return self._gone_at is not None and now - self._gone_at > GRACE

    def _drop(self) -> None:
        self._gone_at = None
        self._paused = self._paused and self._tap is not None
        self.retract()
        if self._tap is not None:
            self._tap.drop()
        self._floor.tell(f"{self._bus}: a client has gone; what it wrote faster than the wire is dropped")
