"""The characters from a terminal, divided into text, escape sequences, lone Escapes and pastes.

Only its form distinguishes a sequence from an Escape and later text, so nothing depends on how reads group the bytes.
ESC and `[` begin a sequence, ESC and `O` one of the known ones. Alt is recognised with a digit and with the keys that
move by words. Any other character after ESC was typed after an Escape.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from enum import Enum, StrEnum
from typing import Any, NamedTuple, cast

from textual._ansi_sequences import ANSI_SEQUENCES_KEYS

ESC = "\x1b"
PASTE_BEGINS, PASTE_ENDS = "\x1b[200~", "\x1b[201~"
MOST = 1 << 20
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


class Kind(Enum):
    """The kind of a piece."""

    TEXT = "text"
    SEQUENCE = "sequence"
    ESCAPE = "escape"
    PASTE = "paste"
    TOO_LONG = "too long"
    """A paste that was too long to store."""


class Piece(NamedTuple):
    """A piece of the input; of a paste, the text between its marks."""

    kind: Kind
    text: str


LONE = Piece(Kind.ESCAPE, ESC)


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

    def split(self, text: str) -> Iterator[Piece]:
        """Yield the pieces that end in this text."""
        text, self._rest = self._rest + text, ""
        while text:
            if self.pasting:
                found, text = self._pasted(text)
            else:
                found, text = self._typed(text)
            yield from found

    def alone(self) -> Iterator[Piece]:
        """Yield the Escape key if nothing follows it. The beginning of a sequence is not a key yet, and waits."""
        rest = self._rest
        if self.pasting or rest.startswith(f"{ESC}[") and rest not in ANSI_SEQUENCES_KEYS:
            return
        self._rest = ""
        if rest in ANSI_SEQUENCES_KEYS and rest != ESC:
            yield Piece(Kind.SEQUENCE, rest)
        elif rest:
            yield LONE
            yield from self.split(rest[1:])

    def forget(self) -> None:
        """Forget an unfinished piece outside of a paste."""
        if not self.pasting:
            self._rest = ""

    def leave(self) -> None:
        """End a paste, and forget it."""
        self.pasting, self._rest, self._paste, self._size = False, "", [], 0

    def _typed(self, text: str) -> tuple[list[Piece], str]:
        """Split off the first piece of a text; return it and the rest."""
        at = text.find(ESC)
        if at:
            at = len(text) if at < 0 else at
            return [Piece(Kind.TEXT, text[:at])], text[at:]
        match = SEQUENCE.match(text)
        if match is not None and self._known(match[0]):
            self.pasting = match[0] == PASTE_BEGINS
            pieces = [] if self.pasting else [Piece(Kind.SEQUENCE, match[0])]
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

    def _pasted(self, text: str) -> tuple[list[Piece], str]:
        """Split off a paste at its end in a text; return it and the rest."""
        at = text.find(PASTE_ENDS)
        if at < 0:
            kept = max(0, len(text) - len(PASTE_ENDS) + 1)
            self._keep(text[:kept])
            self._rest = text[kept:]
            return [], ""
        self._keep(text[:at])
        piece = Piece(Kind.PASTE, "".join(self._paste)) if self._size <= MOST else Piece(Kind.TOO_LONG, "")
        self.leave()
        return [piece], text[at + len(PASTE_ENDS) :]

    def _keep(self, text: str) -> None:
        self._size += len(text)
        if self._size <= MOST:
            self._paste.append(text)
