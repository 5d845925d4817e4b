"""The stop key of a shared port: the thread that reads the keys writes the stop, whatever the event loop does.

The first piece is written at once, ahead of all that has not left. A thread writes the others at their times until the
loop takes the stop over. (`drives.stop_ahead` does the same for a line of drives.)
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from multidrop.dialects import StopPiece
from multidrop.drives import pacing
from multidrop.features.sharing.stop_bytes import StopBytes
from multidrop.transports import Transport

LOOK_PERIOD = 0.02
"""The time between two looks at bytes that wait, s."""


@dataclass
class ThreadStop:
    """A stop that the thread has begun, and the loop has not taken over."""

    written: list[StopPiece] = field(default_factory=list)
    left: list[StopPiece] = field(default_factory=list)
    due: float = 0.0
    """When the next piece may be written, s of the system's clock."""
    dropped: int = 0
    """The bytes of clients that made room for it."""


def pause(last: StopPiece, following: StopPiece, baud: int) -> float:
    """The time between two pieces, s: the last one has left then, and so has its reply."""
    return following.quiet + 2 * (10.0 * len(last.data) / baud if baud else 0.0)


class KeyStop:
    """The part of one port's stops that another thread writes."""

    def __init__(self, stops: StopBytes, cut: Callable[[], bool], leaving: Callable[[], bool]) -> None:
        """`cut`: whether the drives may hold a part of a line. `leaving`: what was written last is a piece of a stop.

        Both are asked in the thread of the key.
        """
        self.transport: Transport
        self.baud = 0
        self._stops, self._cut, self._leaving = stops, cut, leaving
        self._begun = ThreadStop()
        pacing.PACER.begin()

    def press(self) -> None:
        """Write the stop, or move on one that is on its way. From any thread; `take` must follow in the loop."""
        transport, stops = self.transport, self._stops
        if not (self._leaving() and transport.follow(self._behind, key=True)):
            transport.preempt(stops.framed, self._first)
        self._pace()

    def take(self) -> ThreadStop | None:
        """Take over what was begun; None: the thread has written nothing. After the last key nothing goes on there."""
        taken = ThreadStop()

        def note(last: bool) -> None:
            nonlocal taken
            begun = self._begun
            taken = ThreadStop(begun.written, begun.left if last else [], begun.due, begun.dropped)
            self._begun = ThreadStop(left=[] if last else begun.left, due=begun.due)

        self.transport.yielded(note)
        return taken if taken.written else None

    def forget(self) -> None:
        """Forget what was begun: it went to a port that is lost."""
        self._begun = ThreadStop()

    def _first(self, dropped: int) -> bytes:
        begun = self._begun
        begun.dropped += dropped
        first, *begun.left = self._stops.own
        return self._wrote(first, self._stops.mended(first.data) if dropped or self._cut() else first.data)

    def _behind(self, waiting: int) -> bytes | None:
        """The next piece of a stop on its way, or its first one behind what the loop has written of another."""
        if self._begun.left:
            return self._due_piece(waiting)
        first, *self._begun.left = self._stops.own
        return self._wrote(first, first.data)

    def _next(self, waiting: int) -> bytes | None:
        return self._due_piece(waiting) if self._begun.left else None

    def _due_piece(self, waiting: int) -> bytes:
        if waiting or time.monotonic() < self._begun.due:
            return b""
        piece = self._begun.left.pop(0)
        return self._wrote(piece, piece.data)

    def _wrote(self, piece: StopPiece, data: bytes) -> bytes:
        begun = self._begun
        begun.written.append(piece)
        if begun.left:
            begun.due = time.monotonic() + pause(piece, begun.left[0], self.baud)
        return data

    def _pace(self) -> None:
        if self._begun.left:
            left = self._begun.due - time.monotonic()
            pacing.PACER.after(self, left if left > 0 else LOOK_PERIOD, self._go_on)

    def _go_on(self) -> None:
        if self.transport.follow(self._next):
            self._pace()
