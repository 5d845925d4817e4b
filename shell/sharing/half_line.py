"""The line that the writer of a shared port has begun, and the rest of one that a stop has cut off."""

from __future__ import annotations

import re

ENDS = b"\r\n"
LONGEST = 80
"""Bytes of an unfinished line that are kept."""
_LINES = re.compile(b"[\r\n]")


class HalfLine:
    """The bytes of the present line. `framed`: messages carry their length, so no line is ever begun."""

    def __init__(self, framed: bool) -> None:
        self.text = b""
        self._framed = framed
        self._cut = False
        """The last stop came from another client within this line."""
        self._skipping = False
        """The rest of that line is dropped."""

    def written(self, data: bytes) -> list[bytes]:
        """Take bytes that were written; return the lines that they end, or the messages."""
        if self._framed:
            return [data]
        *ended, begun = _LINES.split(self.text + data)
        self.text = begun[-LONGEST:]
        return ended

    def stopped(self, others: bool) -> bytes:
        """Note a stop; return the beginning of the line that it cut off, which only the stop of `others` does."""
        begun, self.text = self.text, b""
        self._cut = others and bool(begun)
        return begun if self._cut else b""

    def dropped(self) -> None:
        """Note that the beginning of the line was dropped: its rest is dropped, too, if another client cut it."""
        self._skipping, self._cut = self._skipping or self._cut, False

    def ended(self) -> None:
        """Forget what was written of it."""
        self.text = b""

    def begin_writer(self) -> None:
        """Drop no rest: the next bytes are another line's."""
        self._skipping = False

    def rest(self, data: bytes) -> bytes:
        """Return bytes without the rest of a line whose beginning a stop has dropped."""
        if not self._skipping:
            return data
        end = next((at for at, byte in enumerate(data) if byte in ENDS), None)
        self._skipping = end is None
        return b"" if end is None else data[end + 1 :]
