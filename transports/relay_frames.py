"""The frames between multidrop here and `multidrop relay` on the machine that has the port.

A frame is a kind, the length of the payload (2 bytes, the high one first), and the payload. The far side begins with
one line of text, `GREETING`, once its port is open; frames follow it in both directions.

Bytes on their way through ssh cannot be taken back: pipes and windows on the way hold megabytes. So this side sends no
more than `CREDIT` bytes ahead of the far port, and at `DROP` the far side drops its queue. The far side reads all that
has arrived before it writes to its port. Thus a drop reaches the far side ahead of its queue.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum

WORD = "multidrop-relay"
VERSION = 1
GREETING = f"{WORD} {VERSION}"
CREDIT = 256
"""The largest number of bytes that were sent and that the far port has not reported as sent."""
MOST = 4096
"""The longest payload, bytes."""
BEAT = 1.5
"""The pause between two signs of life of this side, s; the far side replies to each."""
MISSED = 3
"""Without a reply to this many signs of life in turn the connection is lost."""
SILENCE = 6.0
"""Without a byte from this side for that long, s, the far side ends: a cut network must not keep the port locked.

By then this side has given up. What it sent before must not be executed later."""
_HEAD = 3


class Kind(IntEnum):
    """The kinds of frames."""

    DATA = ord("D")
    """Bytes for the port, or from it."""
    DROP = ord("X")
    """To the far side: drop all that the port has not sent."""
    DONE = ord("T")
    """To this side: how many bytes for the port are sent or dropped by now, since the beginning (8 bytes)."""
    BEAT = ord("P")
    """A sign of life, and the reply to it."""
    SET = ord("S")
    """To the far side: change a setting of the port (number, `Setting`, 4 bytes value)."""
    OUTCOME = ord("O")
    """To this side: the outcome of a change (number, text; no text: it is done)."""
    LOST = ord("L")
    """To this side: the port is lost (text)."""


class Setting(IntEnum):
    """The settings of a port that change while it is open."""

    BAUD = 1
    DTR = 2
    RTS = 3
    BREAK = 4


class Garbled(Exception):
    """Bytes that are not a frame."""


def frame(kind: Kind, payload: bytes | memoryview = b"") -> bytes:
    """Make one frame of at most `MOST` bytes payload."""
    return bytes([kind]) + len(payload).to_bytes(2) + payload


def data_frames(data: bytes) -> bytes:
    """Make as many data frames as these bytes need."""
    return b"".join(frame(Kind.DATA, data[at : at + MOST]) for at in range(0, len(data), MOST))


class Frames:
    """Divides the bytes that arrive into frames."""

    def __init__(self) -> None:
        self._held = bytearray()

    def take(self, data: bytes) -> Iterator[tuple[Kind, bytes]]:
        """Take bytes in, and return the frames that are whole by now. Raises Garbled at the first wrong byte."""
        self._held += data
        while len(self._held) >= _HEAD:
            kind, size = self._held[0], int.from_bytes(self._held[1:_HEAD])
            if kind not in _KINDS or size > MOST:
                raise Garbled(f"{bytes(self._held[:_HEAD]).hex(' ')} is not the beginning of a frame")
            if len(self._held) < _HEAD + size:
                return
            payload = bytes(self._held[_HEAD : _HEAD + size])
            del self._held[: _HEAD + size]
            yield Kind(kind), payload


_KINDS = frozenset(map(int, Kind))
