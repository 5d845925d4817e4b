"""A client's way onto a wire. It is read only while there is room, so what it writes too fast waits with the client.

The wire's queue holds as much for each client as the buffer of a serial port does. While that is full the client is not
read; a look every few milliseconds sees when there is room again, or that the client has gone. What a client that has
gone has left unread is dropped, which is said.
"""

from __future__ import annotations

import asyncio
from typing import Protocol

from simulator.running import RunningFloor

ROOM = 4096
"""Bytes of one client that wait to go out, as many as a serial port's buffer holds."""
PIECE = 256
"""Bytes that are read at a time, so that no turn of the event loop takes long."""
LOOK = 0.01
"""Seconds between two looks while a client is not read."""


class Tap(Protocol):
    """What an inlet needs of its endpoint."""

    def pause(self) -> None:
        """Read the client no more."""

    def resume(self) -> None:
        """Read it again."""

    def look(self) -> None:
        """See to what cannot wait until it is read again: the client has gone, or takes back what it has written."""


class Inlet:
    """Puts what a client writes on the wire, and pauses its reading where it writes faster than the wire carries."""

    def __init__(self, floor: RunningFloor, bus: str, tap: Tap) -> None:
        self.paused = False
        self._floor, self._bus, self._tap = floor, bus, tap
        self._source = floor.source()
        self._timer: asyncio.TimerHandle | None = None

    @property
    def room(self) -> int:
        """How many bytes may be read now."""
        return min(PIECE, ROOM - self._queued)

    @property
    def _queued(self) -> int:
        return self._floor.floor.wires[self._bus].queued(self._source)

    def write(self, data: bytes, baud: int | None = None) -> None:
        """Put bytes on the wire. `baud`: what the client sends at, where it is known."""
        self._floor.write(self._bus, data, self._source, baud)
        if not self.paused and self.room <= 0:
            self.paused = True
            self._tap.pause()
            self._come_back()

    def retract(self) -> None:
        """The client takes back what has not begun to go out."""
        self._floor.retract(self._bus, self._source)

    def close(self) -> None:
        """The client has gone. What the wire has taken goes out."""
        if self._timer is not None:
            self._timer.cancel()

    def _come_back(self) -> None:
        self._timer = self._floor.loop.call_later(LOOK, self._look)

    def _look(self) -> None:
        self._tap.look()
        if self._timer is None or self._timer.cancelled():
            return
        if 2 * self._queued > ROOM:
            self._come_back()
        else:
            self.paused = False
            self._tap.resume()
