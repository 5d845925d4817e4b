"""The terminal's bytes as keys, pastes and clicks, parsed in slices: typed input never keeps the loop from a stop.

A stop divides the stream. Bytes before it are older than the stop and are dropped, however reads group them:
characters, half an escape sequence, a paste that has begun and whose rest is still to arrive. Bytes after it are parsed
afresh.
"""

from __future__ import annotations

import asyncio
import time
from codecs import getincrementaldecoder
from collections import deque
from collections.abc import Callable, Iterable, Iterator

from textual import constants, events
from textual._xterm_parser import XTermParser
from textual.message import Message

from tui.terminal.sequences import MOST, Kind, Piece, Splitter

STOP = b"\x18"
"""Ctrl+X."""
LEAVE = b"\x03"
"""Ctrl+C, which ends an endless paste."""
SLICE = 0.002
"""Seconds of parsing before the loop may do something else."""
STALLED = 1.0
"""Seconds without a byte after which an endless paste is reported."""


class KeyStream:
    """Parses the terminal's bytes, in the loop's thread.

    `emit` takes the events, `warn` shows a line to the person. `dropped` takes the text that a stop has dropped, with a
    NUL for each key that is not text. `more` is true while unread bytes wait.
    """

    def __init__(
        self,
        emit: Callable[[Message], None],
        warn: Callable[[str], None],
        dropped: Callable[[str], None],
        more: Callable[[], bool],
    ) -> None:
        self._emit, self._warn, self._dropped, self._more = emit, warn, dropped, more
        self._loop = asyncio.get_running_loop()
        self._splitter = Splitter()
        self._decode = getincrementaldecoder("utf-8")(errors="replace").decode
        self._parser = XTermParser()
        self._pieces: deque[Piece] = deque()
        self._waiting = 0
        """Number of their characters."""
        self._events: Iterator[Message] = iter(())
        self._piece, self._given = "", 0
        """The text that is being parsed, and the number of its events so far."""
        self._old_paste = False
        """A stop came during the current paste: all of the paste is older than the stop, whenever it arrives."""
        self._stall: asyncio.TimerHandle | None = None
        self._stalled = False
        self._escape: asyncio.TimerHandle | None = None
        self._scheduled = False

    @property
    def idle(self) -> bool:
        """True if nothing waits to be parsed."""
        return not self._scheduled

    def drop(self) -> None:
        """Drop what is not parsed yet, because a stop came from elsewhere.

        A sequence that has begun continues: otherwise its second half would be read as typed text.
        """
        pieces = [piece.text if piece.kind is Kind.TEXT else "\0" for piece in self._pieces]
        text = self._piece[self._given :] + "".join(pieces)
        self._pieces.clear()
        self._waiting, self._piece, self._given = 0, "", 0
        self._events = iter(())
        self._old_paste = self._splitter.pasting
        self._dropped(text)

    def take(self, data: bytes) -> None:
        """Take bytes that were read; of a read with a stop, use only those after the last stop."""
        if self._stalled and data == LEAVE:
            self._leave_paste()
            return
        if STOP in data:
            before, _, data = data.rpartition(STOP)
            self._put(self._split(before.replace(STOP, b"\r")))
            self._splitter.forget()
            self._decode(b"", final=True)
            self.drop()
        self._put(self._split(data))
        self._watch_paste()
        self._wait_for_more()
        if self._waiting > MOST:
            self.drop()
            self._warn("too much input at once; all of it was dropped")

    def _split(self, data: bytes) -> list[Piece]:
        found = []
        for piece in self._splitter.split(self._decode(data)):
            if piece.kind in (Kind.PASTE, Kind.TOO_LONG) and self._old_paste:
                self._old_paste = False
                self._warn("the rest of the paste in which the stop came was dropped, too")
            elif piece.kind is Kind.TOO_LONG:
                self._warn(f"a paste of more than {MOST} characters was dropped")
            else:
                found.append(piece)
        return found

    def _put(self, pieces: Iterable[Piece]) -> None:
        for piece in pieces:
            self._pieces.append(piece)
            self._waiting += len(piece.text)
        self._schedule()

    # A paste that does not end

    def _watch_paste(self) -> None:
        if self._stall is not None:
            self._stall.cancel()
        self._stalled = False
        self._stall = self._loop.call_later(STALLED, self._stalls) if self._splitter.pasting else None

    def _stalls(self) -> None:
        self._stalled = True
        self._warn("a paste has not ended; until it does, keys belong to it. Ctrl+C drops it")

    def _leave_paste(self) -> None:
        self._splitter.leave()
        self._old_paste = False
        self._watch_paste()
        self._warn("the paste that did not end was dropped")

    # Parsing

    def _schedule(self) -> None:
        if not self._scheduled:
            self._scheduled = True
            self._loop.call_soon(self._work)

    def _work(self) -> None:
        self._scheduled = False
        until = time.monotonic() + SLICE
        while (event := self._next()) is not None:
            self._emit(event)
            if time.monotonic() > until:
                self._schedule()
                return
        self._wait_for_more()

    def _wait_for_more(self) -> None:
        """Restart the time limit of an unfinished sequence at each byte."""
        if self._escape is not None:
            self._escape.cancel()
        self._escape = self._loop.call_later(constants.ESCAPE_DELAY, self._alone) if self._splitter.open else None

    def _next(self) -> Message | None:
        while (event := next(self._events, None)) is None and self._pieces:
            piece = self._pieces.popleft()
            self._waiting -= len(piece.text)
            self._piece, self._given = (piece.text if piece.kind is Kind.TEXT else ""), 0
            self._events = iter(self._events_of(piece))
        self._given += 1
        return event

    def _events_of(self, piece: Piece) -> Iterable[Message]:
        if piece.kind is Kind.ESCAPE:
            return [events.Key("escape", "\x1b")]
        if piece.kind is Kind.PASTE:
            return [events.Paste(piece.text.replace("\x00", ""))]
        if piece.kind is Kind.TEXT:
            return self._parser.feed(piece.text)
        found = list(self._parser.feed(piece.text))
        if not found:
            self._parser = XTermParser()  # the parser does not know the sequence, and would wait for more of it
        return found

    def _alone(self) -> None:
        """Decide that an Escape is alone, because nothing follows it."""
        if self._scheduled or self._more():
            return  # the next bytes are here and not parsed yet
        self._put(self._splitter.alone())
