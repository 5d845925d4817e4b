r"""What the drives hold of a line that has begun and not ended, as far as the bytes show that were written to them.

Theory of operation. Another writer's first end of a line would execute what the drives hold, so it is made harmless
before that, whatever it says. A drive may end a line with CR or, in party mode, with LF. There a CR only
separates commands, which wait for the LF; without party mode a LF is no part of a line. Where the mode is not known,
CR LF ends a line for certain, and so does either of them once a drive has replied after it. A reply proves nothing
while the line may belong to an end of the other kind shortly before.

Text that has no end overflows the drives' buffers (an error, and nothing else). Commands that wait in party mode
survive that: only a stop drops them.

In frames of a fixed size there is nothing of that kind: a part of a frame is kept here until the rest of it comes.
"""

from __future__ import annotations

import re

CR, LF = 0x0D, 0x0A
LONGEST_KEPT_TEXT = 80
"""Bytes of an unfinished line that are kept."""
REPLIED = 0.3
"""Seconds without a reply after which a reply is none to that end of a line."""
REPLY = re.compile(rb"\r\n|[\x06\x15]")
"""What a reply has, and the echo of a line that waits has not."""
_LINES = re.compile(b"[\r\n]")


class HalfLine:
    """The begun line. `ends`: the bytes that may end one; two of them: the drives' mode decides which does."""

    def __init__(self, ends: bytes) -> None:
        """`ends` is empty where messages carry their length: no line is ever begun."""
        self.text = b""
        """The bytes after the last byte that may have ended a line."""
        self.open: dict[int, float] = {}
        """Bytes that may not have ended their line, and the time at which each kind last did not, s."""
        self._lately: dict[int, float] = {}
        """When each kind was last written, s: a reply may be to any of them."""
        self._ends = ends
        self._after_cr = False
        self._proven: int | None = None
        """The end of a line that a reply has shown last; None: none has, or replies contradict each other."""

    @property
    def begun(self) -> bool:
        """The drives may hold a part of a line."""
        return bool(self.text or self.open)

    @property
    def waits(self) -> bool:
        """Whole commands may wait for a LF, which executes them all."""
        return CR in self.open

    def written(self, data: bytes, now: float) -> list[bytes]:
        """Take bytes that were written; return the lines that they end, or the messages."""
        if not self._ends:
            return [data]
        ended = _LINES.split(self.text + data)[:-1]
        for byte in data:
            if byte in (CR, LF):
                self._end(byte, now)
            else:
                self.text = (self.text + bytes([byte]))[-LONGEST_KEPT_TEXT:]
            self._after_cr = byte == CR
        return ended

    def _end(self, byte: int, now: float) -> None:
        self._lately[byte] = now
        if self._ends == bytes([byte]) or (byte == LF and self._after_cr and LF in self._ends):
            self.text, self.open = b"", {}
        elif byte == CR or LF in self._ends:
            if self.text:
                self.open[byte] = now
            self.text = b""

    def replied(self, data: bytes) -> None:
        """Take bytes of the drives: a reply shows that the last end of a line was one.

        The first that contradicts those before shows nothing: it may be the rest of an earlier reply.
        """
        if not self.open or len(self._ends) == 1 or not REPLY.search(data):
            return
        last = max(self.open, key=self.open.__getitem__)
        others = [at for byte, at in self._lately.items() if byte != last]
        if any(self.open[last] - at < REPLIED for at in others):
            return
        if self._proven in (None, last):
            self._proven, self.open = last, {}
        else:
            self._proven = None

    def cleared(self) -> None:
        """Note that the drives hold no part of a line."""
        self.text, self.open, self._after_cr = b"", {}, False

    def overflowed(self) -> None:
        """Note that the text was made harmless, but not the commands that may wait."""
        self.text = b""

    def doubted(self, now: float) -> None:
        """Note that bytes that were written may not have left: the drives may hold any part of them."""
        if self._ends:
            self.text = self.text or b"?"
            self.open |= dict.fromkeys((CR,) if LF in self._ends else (), now)


class Rest:
    """The rest of a client's line whose beginning was made harmless: it is dropped, up to the end of the line."""

    def __init__(self) -> None:
        self.dropping = False

    def left(self, data: bytes) -> bytes:
        """Return bytes without that rest."""
        if not self.dropping:
            return data
        end = _LINES.search(data)
        self.dropping = end is None
        return b"" if end is None else data[end.end() :]


class FrameDivider:
    """Divides a client's bytes into whole frames of one size; `size` 0: there are none, and all bytes pass."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.held = b""

    def whole(self, data: bytes) -> bytes:
        """Return the frames that are whole by now, and keep the rest."""
        if not self.size:
            return data
        data, self.held = self.held + data, b""
        at = len(data) // self.size * self.size
        self.held = data[at:]
        return data[:at]

    def forgotten(self) -> bytes:
        held, self.held = self.held, b""
        return held
