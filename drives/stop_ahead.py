"""The stop that another thread writes ahead of the event loop: its first bytes at once, the rest piece by piece.

On a line whose drives reply to a stop (`Codec.stop_replies`) each drive gets its stop by itself, and a gap for its
reply behind it. The thread that reads the keys writes the first bytes and goes on reading. `PACER` writes the other
pieces while the loop does not: before it has taken the stop over, and where it is held up after that. Each line has its
own times.

A key that comes meanwhile (one that is held down repeats 30 times a second) drops nothing and begins nothing again: it
moves the stop on by a piece once the gap is over, and every piece has its turn again. A stop of some drives, which an
automation sends at its end, holds up no key: that begins the stop, as after any other line.

`StopAhead.take` is what the loop does then. What a thread has begun changes under the lock of its transport alone.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

from multidrop.base.isolation import isolated
from multidrop.dialects import StopPiece
from multidrop.drives import pacing
from multidrop.drives.line import LONG_QUIET, merged
from multidrop.drives.link import Link
from multidrop.drives.stop_forms import StopForms

RETRY_AFTER = 0.02
"""Seconds after which a port that takes nothing is tried again."""


@dataclass
class BegunStop:
    """A stop that was begun, and how far it is. Times are seconds of the link's clock."""

    forms: StopForms
    data: bytes
    """The bytes that begin it."""
    left: float
    """When the last byte has left, calculated."""
    pieces: list[StopPiece] = field(default_factory=list)
    """What is still to be written."""
    written: list[tuple[float, bytes]] = field(default_factory=list)
    """The time and the bytes of each write of which the loop knows nothing yet."""
    invalidates: bool = False
    """It makes a half-sent line harmless."""
    before: bool = False
    """A stop before it did so, of which the loop knows nothing yet."""
    first: StopPiece | None = None
    """The piece to write before all others."""
    stops_all: bool = True
    """It is for the whole line."""

    def due(self, byte_time: float) -> float:
        """When the next piece may be written."""
        return max(self.clear(byte_time), *(self.left + piece.quiet for piece in self.pieces[:1]), 0.0)

    def clear(self, byte_time: float) -> float:
        """When the last write has left and the reply to it has come, of about the same length."""
        return self.left + (self.forms.gap and self.forms.gap + len(self.forms.immediate) * byte_time)

    def since(self, else_: float) -> float:
        """When the last write was of which the loop knows nothing yet."""
        return max((when for when, _ in self.written), default=else_)

    def goes_on(self) -> bool:
        """Whether some drives have not had their turn yet."""
        return bool(self.pieces) and self.pieces[0].quiet <= LONG_QUIET

    def note_written(self, data: bytes, now: float, byte_time: float) -> bytes:
        """Note a write of the stop; return its bytes."""
        self.left = now + len(data) * byte_time
        self.written.append((now, data))
        return data


class StopAhead:
    """The stop of one link, as far as other threads write it."""

    def __init__(self, link: Link, forms: Callable[[], StopForms], went_on: Callable[[], None]) -> None:
        """`forms` makes a stop. `went_on` is called in the loop once a thread has gone on with one of the loop's."""
        self._link, self._forms, self._went_on = link, forms, went_on
        self._begun: BegunStop | None = None
        """The stop that another thread has begun and the loop has not yet taken over."""
        self._last: StopForms | None = None
        """The forms of the last stop."""
        self._asked = False
        """The loop was asked for a sign of life, and has given none yet."""
        pacing.PACER.begin()

    # In any thread

    def press(self) -> None:
        """Write the stop, or move on the one that is on its way. Does nothing where the transport cannot do that."""
        forms, transport = self._forms(), self._link.transport
        self._last = forms
        if not (self._on_its_way() and transport.follow(partial(self._again, forms), key=True)):
            transport.preempt(forms.framed, partial(self._begin, forms))
        self._pace()

    def _on_its_way(self) -> bool:
        """Whether a stop of the whole line is on its way."""
        begun, line = self._begun, self._link.line
        return begun.stops_all if begun is not None else line.last_write_was_stop and line.stops_all

    def _begin(self, forms: StopForms, dropped: int) -> bytes:
        """The first bytes of a stop. `dropped`: how many unsent ones made room for it."""
        link, last = self._link, self._begun
        now, line = link.now(), link.line
        of_some = not (line.stops_all if last is None else last.stops_all)
        leaving = last is not None and of_some and now < last.left
        data, invalidates = forms.written(bool(dropped or leaving or line.half_sent(now)))
        before = last is not None and (last.invalidates or last.before)
        owed = last.pieces if last is not None else line.owed_pieces()
        pieces = merged([] if of_some else owed, forms.repeats)
        written = last.written if last is not None else []
        self._begun = begun = BegunStop(forms, data, now, pieces, written, invalidates, before)
        line.overtaken = True
        return begun.note_written(data, now, line.byte_time)

    def _again(self, forms: StopForms, waiting: int) -> bytes | None:
        """The next piece of a stop that is on its way; empty if it is not due; None: none is on its way.

        `waiting`: the number of bytes that the transport has not passed on.
        """
        if not self._on_its_way():
            return None
        line, begun = self._link.line, self._begun
        if begun is None:
            begun = BegunStop(forms, forms.immediate, line.transmitted_at, line.owed_pieces())
        now = self._link.now()
        free = not waiting and now >= begun.clear(line.byte_time)
        if free and not begun.goes_on():
            return None
        begun.forms, begun.pieces = forms, merged(begun.pieces, forms.pieces)
        self._begun, line.overtaken = begun, True
        return begun.note_written(begun.pieces.pop(0).data, now, line.byte_time) if free else b""

    def _pace(self) -> None:
        """Look at the next piece at its time."""
        begun = self._begun or self._of_the_loop()
        if begun is not None and self._link.transport.preemptible:
            due = begun.due(self._link.line.byte_time) - self._link.now()
            pacing.PACER.after(self, due if due > 0 else RETRY_AFTER, self._go_on)

    def _of_the_loop(self) -> BegunStop | None:
        """The stop of which the loop has still to write pieces; None: it has written all, or something else since."""
        line = self._link.line
        if self._last is None or not line.last_write_was_stop or not (pieces := line.owed_pieces()):
            return None
        return BegunStop(self._last, self._last.immediate, line.transmitted_at, pieces, stops_all=line.stops_all)

    def _go_on(self) -> None:
        """Write the next piece if the loop does not."""
        transport = self._link.transport
        with isolated(f"the stop of {self._link.name}"), suppress(RuntimeError):  # the loop has ended
            if not transport.follow(self._next):
                if self._begun is not None:
                    return  # all is written, and the loop has not taken it over yet
                if self._asked and transport.follow(self._take_back, key=True):
                    self._link.call_soon(self._went_on)
                elif not self._asked:
                    self._asked = True
                    self._link.call_soon(self._lives)
            self._pace()

    def _lives(self) -> None:
        self._asked = False

    def _next(self, waiting: int) -> bytes | None:
        """The next piece of a stop that the loop has not taken over; empty if it is not due; None: there is none."""
        begun = self._begun
        if begun is None or not (begun.pieces or waiting):
            return None
        return self._due_piece(begun, waiting)

    def _take_back(self, waiting: int) -> bytes | None:
        """The next piece of a stop that the loop has taken over, or nothing if bytes wait; None if it is not due."""
        begun = self._of_the_loop() if self._begun is None else None
        if begun is None or not ((data := self._due_piece(begun, waiting)) or waiting):
            return None
        self._begun, self._link.line.overtaken = begun, True
        return data

    def _due_piece(self, begun: BegunStop, waiting: int) -> bytes:
        byte_time, now = self._link.line.byte_time, self._link.now()
        if waiting or now < begun.due(byte_time):
            return b""
        return begun.note_written(begun.pieces.pop(0).data, now, byte_time)

    # In the loop

    def watch(self, forms: StopForms) -> None:
        """Have the rest of a stop written where the loop, which has begun it or taken it over, is held up."""
        self._last = forms
        self._pace()

    def forget(self) -> None:
        """Forget what was begun: it went to a transport that is lost."""
        self._begun = None

    def take(self, followed: bool) -> BegunStop | None:
        """Take over what was begun; before the last key is followed, only that there is such a stop.

        `followed`: this follows a key. The loop writes nothing before it has followed every one.
        """
        taken: BegunStop | None = None

        def note(last: bool) -> None:
            nonlocal taken
            taken = self._begun
            if last:
                self._begun = None
            elif taken is not None:
                taken = replace(taken, pieces=[], written=[])

        if followed:
            self._link.transport.yielded(note)
        else:
            note(False)
        return taken
