"""The queue between a client and a wire. The client is read only while there is room: the rest waits with the client.

The queue holds as much as a serial port's buffer, and feeds the wire in short pieces, so that the clients of a bus take
turns. While the queue is full the client is not read; a timer of some milliseconds looks for room. When a client has
left, its bytes have some seconds to go out, as with a serial port that is closed. Then the rest is dropped, with a
notice.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Protocol

from multidrop.simulator.serving.running import RunningFloor

HOLD = 4096
"""Bytes of one client that wait in the queue."""
PIECE = 256
"""Bytes that are read at a time, so that no turn of the event loop takes long; at least as many wait on the wire."""
AHEAD = 0.02
"""Seconds of a fast wire's bytes that wait on it, if those are more."""
POLL = 0.01
"""Seconds between two polls while a client is not read."""
GRACE = 10.0
"""Seconds in which the bytes of a client that has left can go out: 9600 bytes at 9600 baud."""


class Client(Protocol):
    """What a queue needs of its client's endpoint."""

    def pause(self) -> None:
        """Stop reading the client."""

    def resume(self) -> None:
        """Read the client again."""

    def poll(self) -> None:
        """Look for what cannot wait: the client may take back what it has written."""

    def has_left(self) -> bool:
        """Whether the client has left, as far as the system reports it."""

    def discard(self) -> None:
        """Drop what the client has left unread."""


class InputQueue:
    """Puts what a client writes on the wire, and pauses its reading while the wire is slower."""

    def __init__(self, floor: RunningFloor, bus: str, client: Client) -> None:
        self._floor, self._bus = floor, bus
        self._client: Client | None = client
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
        """Queue bytes for the wire. `baud`: the client's baud rate, if known."""
        self._pending.append((data, baud))
        self._waiting += len(data)
        self._feed()
        if self._client is not None and not self._paused and self.room <= 0:
            self._paused = True
            self._client.pause()
        self._come_back()

    def retract(self) -> None:
        """Drop what has not begun to go out: the client takes it back."""
        self._pending.clear()
        self._waiting = 0
        self._floor.retract(self._bus, self._source)

    def close(self) -> None:
        """Take note that the client has left. What it wrote goes out in the time that it has."""
        self._client = None

    def _feed(self) -> None:
        """Hand the wire as much as it has room for."""
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
            self._timer = self._floor.loop.call_later(POLL, self._look)

    def _look(self) -> None:
        self._timer = None
        if self._client is not None:
            self._client.poll()
        self._feed()
        if self._overstays():
            self._drop()
        if self._paused and self._client is not None and 2 * self._waiting <= HOLD:
            self._paused = False
            self._client.resume()
        self._come_back()

    def _overstays(self) -> bool:
        """Whether the client has left so long ago that its bytes are dropped."""
        now = self._floor.loop.time()
        if self._client is not None and not self._client.has_left():
            self._gone_at = None
        elif self._gone_at is None:
            self._gone_at = now
        return self._gone_at is not None and now - self._gone_at > GRACE

    def _drop(self) -> None:
        self._gone_at = None
        self._paused = self._paused and self._client is not None
        self.retract()
        if self._client is not None:
            self._client.discard()
        self._floor.notify(f"{self._bus}: a client has left; what it wrote faster than the wire is dropped")
