"""The terminal's bytes as keys, pastes and clicks, parsed in slices: typed input never keeps the loop from a stop.

A stop divides the stream. Bytes before it are older than the stop and are dropped, however reads group them:
characters, half an escape sequence, a paste that has begun and whose rest is still to arrive. Bytes after it are parsed
afresh.
"""

from __future__ import annotations

import asyncio
import re
import time
from codecs import getincrementaldecoder
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from enum import Enum, StrEnum
from typing import Any, NamedTuple, cast

from textual import constants, events
from textual._ansi_sequences import ANSI_SEQUENCES_KEYS
from textual._xterm_parser import XTermParser
from textual.message import Message

# The characters from a terminal, divided into text, escape sequences, lone Escapes and pastes.
#
# Only its form distinguishes a sequence from an Escape and later text, so nothing depends on how reads group the
# bytes. ESC and `[` begin a sequence, ESC and `O` one of the known ones. Alt is recognised with a digit and with the
# keys that move by words. Any other character after ESC was typed after an Escape.


ESC = "\x1b"
PASTE_BEGINS, PASTE_ENDS = "\x1b[200~", "\x1b[201~"
LONGEST_PASTE = 1 << 20
"""Greatest number of characters of a paste."""
SEQUENCE = re.compile(
    r"""\x1b(?:
        \[M[^\x1b]{3} |             # a button of the mouse, in the form of old terminals
        \[\[[A-E] |                 # F1 to F5 of the Linux console
        \[[0-?]*[ -/]*[@-LN-Z\\-~] |
        \[[0-?]+[ -/]*M |
        O[A-Za-y] |
        [1-9bf\x7f]
    )""",
    re.VERBOSE,
)
BEGUN = re.compile(r"\x1b(?:O|\[(?:M[^\x1b]{0,2}|\[|[0-?]*[ -/]*))?")


class AltDigit(StrEnum):
    """Alt and a digit, which Textual reads as the character that a Macintosh types with it (`£` for Alt+3)."""

    ONE, TWO, THREE = "alt+1", "alt+2", "alt+3"
    FOUR, FIVE, SIX = "alt+4", "alt+5", "alt+6"
    SEVEN, EIGHT, NINE = "alt+7", "alt+8", "alt+9"


def know_alt_digits() -> None:
    """Register Escape and a digit as Alt and that digit."""
    keys = cast("dict[str, Any]", ANSI_SEQUENCES_KEYS)
    keys.update({f"\x1b{digit.value[-1]}": (digit,) for digit in AltDigit})


know_alt_digits()


class PieceKind(Enum):
    """The kind of a piece."""

    TEXT = "text"
    SEQUENCE = "sequence"
    ESCAPE = "escape"
    PASTE = "paste"
    TOO_LONG = "too long"
    """A paste that was too long to store."""


class InputPiece(NamedTuple):
    """A piece of the input; of a paste, the text between its marks."""

    kind: PieceKind
    text: str


LONE = InputPiece(PieceKind.ESCAPE, ESC)


class Splitter:
    """Divides the stream, and keeps an unfinished piece for the next call."""

    def __init__(self) -> None:
        self._rest = ""
        self._paste: list[str] = []
        self._size = 0
        self.pasting = False
        """True if the stream is within a paste."""

    @property
    def open(self) -> bool:
        """True if an Escape or a sequence is unfinished."""
        return bool(self._rest) and not self.pasting

    def split(self, text: str) -> Iterator[InputPiece]:
        text, self._rest = self._rest + text, ""
        while text:
            if self.pasting:
                pieces, text = self._pasted(text)
            else:
                pieces, text = self._typed(text)
            yield from pieces

    def alone(self) -> Iterator[InputPiece]:
        """Yield the Escape key if nothing follows it. The beginning of a sequence is not a key yet, and waits."""
        rest = self._rest
        if self.pasting or rest.startswith(f"{ESC}[") and rest not in ANSI_SEQUENCES_KEYS:
            return
        self._rest = ""
        if rest in ANSI_SEQUENCES_KEYS and rest != ESC:
            yield InputPiece(PieceKind.SEQUENCE, rest)
        elif rest:
            yield LONE
            yield from self.split(rest[1:])

    def forget(self) -> None:
        if not self.pasting:
            self._rest = ""

    def leave(self) -> None:
        self.pasting, self._rest, self._paste, self._size = False, "", [], 0

    def _typed(self, text: str) -> tuple[list[InputPiece], str]:
        """Split off the first piece of a text; return it and the rest."""
        at = text.find(ESC)
        if at:
            at = len(text) if at < 0 else at
            return [InputPiece(PieceKind.TEXT, text[:at])], text[at:]
        match = SEQUENCE.match(text)
        if match is not None and self._known(match[0]):
            self.pasting = match[0] == PASTE_BEGINS
            pieces = [] if self.pasting else [InputPiece(PieceKind.SEQUENCE, match[0])]
            return pieces, text[match.end() :]
        begun = BEGUN.match(text)
        if begun is not None and begun.end() == len(text):
            self._rest = text
            return [], ""
        if begun is not None and begun.end() > 2:  # a sequence that is interrupted
            return [], text[begun.end() :]
        return [LONE], text[1:]

    @staticmethod
    def _known(sequence: str) -> bool:
        return not sequence.startswith(f"{ESC}O") or sequence in ANSI_SEQUENCES_KEYS

    def _pasted(self, text: str) -> tuple[list[InputPiece], str]:
        """Split off a paste at its end in a text; return it and the rest."""
        at = text.find(PASTE_ENDS)
        if at < 0:
            kept = max(0, len(text) - len(PASTE_ENDS) + 1)
            self._keep(text[:kept])
            self._rest = text[kept:]
            return [], ""
        self._keep(text[:at])
        piece = (
            InputPiece(PieceKind.PASTE, "".join(self._paste))
            if self._size <= LONGEST_PASTE
            else InputPiece(PieceKind.TOO_LONG, "")
        )
        self.leave()
        return [piece], text[at + len(PASTE_ENDS) :]

    def _keep(self, text: str) -> None:
        self._size += len(text)
        if self._size <= LONGEST_PASTE:
            self._paste.append(text)


STOP = b"\x18"
"""Ctrl+X."""
LEAVE = b"\x03"
"""Ctrl+C, which ends an endless paste."""
LONGEST_SPLIT_SLICE = 0.002
"""Seconds of parsing before the loop may do something else."""
PASTE_TIMEOUT = 1.0
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
        self._pieces: deque[InputPiece] = deque()
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
        return not self._scheduled

    @property
    def enter_waits(self) -> bool:
        """Whether Enter is in the text that is not parsed yet."""
        texts = (piece.text for piece in self._pieces if piece.kind is PieceKind.TEXT)
        return any("\r" in text for text in (self._piece[self._given :], *texts))

    def drop(self) -> None:
        """Drop what is not parsed yet, because a stop came from elsewhere.

        A sequence that has begun continues: otherwise its second half would be read as typed text.
        """
        pieces = [piece.text if piece.kind is PieceKind.TEXT else "\0" for piece in self._pieces]
        text = self._piece[self._given :] + "".join(pieces)
        self._pieces.clear()
        self._waiting, self._piece, self._given = 0, "", 0
        self._events = iter(())
        self._old_paste = self._splitter.pasting
        self._dropped(text)

    def take(self, data: bytes) -> None:
        """Take bytes that were read; of a read with a stop, use only those after the last stop."""
        if self._stalled and data == LEAVE:
            self._splitter.leave()
            self._old_paste = False
            self._watch_paste()
            self._warn("the paste that did not end was dropped")
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
        if self._waiting > LONGEST_PASTE:
            self.drop()
            self._warn("too much input at once; all of it was dropped")

    def _split(self, data: bytes) -> list[InputPiece]:
        events = []
        for piece in self._splitter.split(self._decode(data)):
            if piece.kind in (PieceKind.PASTE, PieceKind.TOO_LONG) and self._old_paste:
                self._old_paste = False
                self._warn("the rest of the paste in which the stop came was dropped, too")
            elif piece.kind is PieceKind.TOO_LONG:
                self._warn(f"a paste of more than {LONGEST_PASTE} characters was dropped")
            else:
                events.append(piece)
        return events

    def _put(self, pieces: Iterable[InputPiece]) -> None:
        for piece in pieces:
            self._pieces.append(piece)
            self._waiting += len(piece.text)
        self._schedule()

    # A paste that does not end

    def _watch_paste(self) -> None:
        if self._stall is not None:
            self._stall.cancel()
        self._stalled = False
        self._stall = self._loop.call_later(PASTE_TIMEOUT, self._stalls) if self._splitter.pasting else None

    def _stalls(self) -> None:
        self._stalled = True
        self._warn("a paste has not ended; until it does, keys belong to it. Ctrl+C drops it")

    # Parsing

    def _schedule(self) -> None:
        if not self._scheduled:
            self._scheduled = True
            self._loop.call_soon(self._work)

    def _work(self) -> None:
        self._scheduled = False
        until = time.monotonic() + LONGEST_SPLIT_SLICE
        while (event := self._next()) is not None:
            self._emit(event)
            if time.monotonic() > until:
                self._schedule()
                return
        self._wait_for_more()

    def finish(self) -> None:
        """Parse all that has come, at the end."""
        while (event := self._next()) is not None:
            self._emit(event)

    def _wait_for_more(self) -> None:
        if self._escape is not None:
            self._escape.cancel()
        self._escape = self._loop.call_later(constants.ESCAPE_DELAY, self._alone) if self._splitter.open else None

    def _next(self) -> Message | None:
        while (event := next(self._events, None)) is None and self._pieces:
            piece = self._pieces.popleft()
            self._waiting -= len(piece.text)
            self._piece, self._given = (piece.text if piece.kind is PieceKind.TEXT else ""), 0
            self._events = iter(self._events_of(piece))
        self._given += 1
        return event

    def _events_of(self, piece: InputPiece) -> Iterable[Message]:
        if piece.kind is PieceKind.ESCAPE:
            return [events.Key("escape", "\x1b")]
        if piece.kind is PieceKind.PASTE:
            return [events.Paste(piece.text.replace("\x00", ""))]
        if piece.kind is PieceKind.TEXT:
            return self._parser.feed(piece.text)
        messages = list(self._parser.feed(piece.text))
        if not messages:
            self._parser = XTermParser()  # the parser does not know the sequence, and would wait for more of it
        return messages

    def _alone(self) -> None:
        """Decide that an Escape is alone, because nothing follows it."""
        if self._scheduled or self._more():
            return  # the next bytes are here and not parsed yet
        self._put(self._splitter.alone())
