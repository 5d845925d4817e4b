"""The bytes of a bus as they went, both ways, with times; the last of them, bounded in memory."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from multidrop.dialects import Priority, Request
from multidrop.drives.events import BusEvent, Ended, Sent, Traffic

MOST = 4000
"""Pieces that are kept."""
MOST_BYTES = 256 * 1024
"""Bytes that are kept."""
GAP = 0.02
"""Seconds without a byte after which a received line is not continued: a slow line delivers single bytes."""
LONGEST = 256
"""Bytes of one piece that is continued."""


class Piece(NamedTuple):
    """Bytes that were written or read at once. `poll`: a request of ours that was not typed, or its reply."""

    at: float
    outgoing: bool
    data: bytes
    address: str = ""
    poll: bool = False


class TrafficStore:
    """The last pieces of one bus. `taken` counts all of them."""

    def __init__(self) -> None:
        self.pieces: deque[Piece] = deque(maxlen=MOST)
        self.taken = 0
        self._bytes = 0
        self._last_at = 0.0
        self._departing: Request | None = None
        """The request whose bytes are written next."""
        self._in_flight: Request | None = None

    def take(self, event: BusEvent) -> bool:
        """Take an event of the bus; return whether it is one of traffic."""
        if isinstance(event, Traffic):
            self._add(event)
        elif isinstance(event, Sent):
            self._departing = self._in_flight = event.request
        elif isinstance(event, Ended):
            self._departing = self._in_flight = None
        else:
            return False
        return True

    def _add(self, event: Traffic) -> None:
        request = self._departing if event.outgoing else self._in_flight
        if event.outgoing:
            self._departing = None
        poll = request is not None and request.priority is Priority.POLL
        address = request.address if request is not None else ""
        self._make_room(len(event.data))
        piece = Piece(event.at, event.outgoing, event.data[-MOST_BYTES:], address, poll)
        if self._continues(piece):
            last = self.pieces.pop()
            piece = last._replace(data=last.data + piece.data)
        else:
            self.taken += 1
        self.pieces.append(piece)
        self._last_at = event.at

    def _continues(self, piece: Piece) -> bool:
        """Whether received bytes belong to the line that began with the piece before."""
        last = self.pieces[-1] if self.pieces else None
        return (
            last is not None
            and not piece.outgoing
            and (last.outgoing, last.address, last.poll) == (False, piece.address, piece.poll)
            and not last.data.endswith(b"\n")
            and len(last.data) < LONGEST
            and piece.at - self._last_at < GAP
        )

    def _make_room(self, size: int) -> None:
        self._bytes += min(size, MOST_BYTES)
        if len(self.pieces) == MOST:
            self._bytes -= len(self.pieces.popleft().data)
        while self.pieces and self._bytes > MOST_BYTES:
            self._bytes -= len(self.pieces.popleft().data)
