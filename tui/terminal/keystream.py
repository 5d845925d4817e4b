"""The terminal's bytes as keys, pastes and clicks, in slices: the loop is never kept from a stop by what was typed.

A stop divides the stream. What came before its byte is older than the stop and dropped, however it was grouped in
reads: characters, half an escape sequence, a paste that has begun (with the rest of it, which is still to come). What
comes after it is read anew.
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
"""Ctrl+C, which leaves a paste that does not end."""
SLICE = 0.002
"""Seconds of parsing before the loop may do something else."""
STALLED = 1.0
"""Seconds without a byte after which a paste that has not ended is told."""


class KeyStream:
    """Parses what the terminal sent. Belongs to the loop's thread.

    `emit` takes what it means, `tell` shows a line to the person who types, `dropped` is given the text that a stop has
    dropped (a NUL in it for a key that is no text), `more` says whether bytes wait to be read.
    """

    def __init__(
        self,
        emit: Callable[[Message], None],
        tell: Callable[[str], None],
        dropped: Callable[[str], None],
        more: Callable[[], bool],
    ) -> None:
        self._emit, self._tell, self._dropped, self._more = emit, tell, dropped, more
        self._loop = asyncio.get_running_loop()
        self._splitter = Splitter()
        self._decode = getincrementaldecoder("utf-8")(errors="replace").decode
        self._parser = XTermParser()
        self._pieces: deque[Piece] = deque()
        self._waiting = 0
        """Characters of them."""
        self._events: Iterator[Message] = iter(())
        self._piece, self._given = "", 0
        """The text that is being parsed, and how much of it was."""
        self._old_paste = False
        """A stop came within the paste that goes on: all of it is older than the stop, whenever it comes."""
        self._stall: asyncio.TimerHandle | None = None
        self._stalled = False
        self._escape: asyncio.TimerHandle | None = None
        self._scheduled = False

    @property
    def idle(self) -> bool:
        """Whether nothing waits to be parsed."""
        return not self._scheduled

    def drop(self) -> None:
        """Drop what has come and is not parsed: a stop came, from elsewhere.

        A sequence that has begun goes on: its other half would be read as if it were typed.
        """
        pieces = [piece.text if piece.kind is Kind.TEXT else "\0" for piece in self._pieces]
        text = self._piece[self._given :] + "".join(pieces)
        self._pieces.clear()
        self._waiting, self._piece, self._given = 0, "", 0
        self._events = iter(())
        self._old_paste = self._splitter.pasting
        self._dropped(text)

    def take(self, data: bytes) -> None:
        """Bytes were read. Of a read with a stop in it only what is behind the last one is used."""
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
            self._tell("more was typed at once than can be meant; all of it was dropped")

    def _split(self, data: bytes) -> list[Piece]:
        found = []
        for piece in self._splitter.split(self._decode(data)):
            if piece.kind in (Kind.PASTE, Kind.TOO_LONG) and self._old_paste:
                self._old_paste = False
                self._tell("the rest of the paste in which the stop came was dropped, too")
            elif piece.kind is Kind.TOO_LONG:
                self._tell(f"a paste of more than {MOST:,} characters was dropped")
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
        self._tell("a paste has not ended; until it does, keys belong to it. Ctrl+C drops it")

    def _leave_paste(self) -> None:
        self._splitter.leave()
        self._old_paste = False
        self._watch_paste()
        self._tell("the paste that did not end was dropped")

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
        """What has begun has its time from the last byte on."""
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
            self._parser = XTermParser()  # it does not know the sequence, and would wait for more of it
        return found

    def _alone(self) -> None:
        """A lone Escape is known as one by what does not follow it."""
        if self._scheduled or self._more():
            return  # what follows is here and was not looked at yet
        self._put(self._splitter.alone())
