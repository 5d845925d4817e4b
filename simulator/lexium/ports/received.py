"""What a port receives: keys, the bytes that belong to a key, and lines."""

from __future__ import annotations

import re

from multidrop.simulator.lexium.ports.replies import Mode

CR, LF, ESC, CTRL_C, CTRL_E = 0x0D, 0x0A, 0x1B, 0x03, 0x05
KEYS = frozenset({CR, LF, ESC, CTRL_C, CTRL_E})
"""Bytes that have a meaning within a line for another drive."""
PLAIN = re.compile(b"[^\r\n\x1b\x03\x05]+")
"""Text of a line: bytes that are no keys."""
ENDS, STOPS = re.compile(rb"[\r\n]"), re.compile(rb"[\x03\x05\x1b]")
ADDRESSES = frozenset({CR, LF, *b"*^"})
"""Bytes that begin a line in party mode, except for names."""
LINE_BUFFER = 64
KEY_ALONE, KEY_WITH_CHECK = "alone", "with its check byte"


class Line:
    """A line that is being received: its settings, its addressee, and its text.

    `mine`: it is for this drive. `replies`: this drive replies to it.
    """

    def __init__(self, mode: Mode, name: bytes = b"", mine: bool = True, replies: bool = True) -> None:
        self.mode = mode
        self.name = name
        self.mine = mine
        self.replies = replies
        self.text = bytearray()

    @property
    def room(self) -> int:
        """How many bytes more fit."""
        return LINE_BUFFER - len(self.name) - len(self.text)


DEAF = Line(Mode(echo=0, party=True, checksum=0, name=""), mine=False)
"""A line for another drive, in party mode: nothing of it is kept."""


class KeyTail:
    """The bytes after a key that belong to it: a check byte, and a CR after that."""

    def __init__(self) -> None:
        self._stage = ""

    def begin(self) -> None:
        """A key has come."""
        self._stage = KEY_ALONE

    def takes(self, byte: int) -> bool:
        """Whether a byte belongs to the key before it."""
        is_check = self._stage == KEY_ALONE and byte >= 0x80
        is_end = self._stage == KEY_WITH_CHECK and byte == CR
        self._stage = KEY_WITH_CHECK if is_check else ""
        return is_check or is_end


class Overheard:
    """What other drives send: whole lines are taken from it."""

    def __init__(self) -> None:
        self._data = bytearray()

    def clear(self) -> None:
        """Forget it."""
        self._data.clear()

    def add(self, data: bytes) -> bytes:
        """Add bytes; give the lines that are complete."""
        self._data += data
        end = self._data.rfind(b"\n") + 1
        lines = bytes(self._data[:end])
        del self._data[: max(end, len(self._data) - LINE_BUFFER)]
        return lines
