"""Modbus/TCP frames: messages cut out of a stream, and which answer fits which request. Pure functions.

Theory of operation. A message is a header of seven bytes (transaction, protocol 0, how many bytes follow, unit) and a
PDU: a function code and its data, big-endian. The answer bears the request's transaction number, and its function
code, with the top bit set for an exception. Messages carry their length, so a stream is never searched for its
beginning: what cannot be a header means that the other end speaks something else. What stands in a PDU is for `pdus`.
(MODBUS Application Protocol V1.1b3, 6; MODBUS Messaging on TCP/IP V1.0b, 3.1.3; Modbus/TCP manual 3.2, 4.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

READ_COILS, READ_INPUTS, READ_REGISTERS = 0x01, 0x02, 0x03
WRITE_COIL, WRITE_REGISTERS = 0x05, 0x10
IDENTIFY, DEVICE_ID = 0x2B, 0x0E
READ_SPECIFIC, WRITE_SPECIFIC = 0x41, 0x42
EXCEPTION = 0x80
ON, OFF = 0xFF00, 0x0000
LONGEST_STRING = 28
"""Characters that a manufacturer specific write takes (4.3.3)."""

EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    5: "acknowledge",
    6: "device busy",
    10: "gateway path unavailable",
    11: "gateway target does not respond",
}

_LEAST, _MOST = 2, 254
"""What the header's length may say: a unit and at least a function code, at most 253 bytes of PDU."""


class NotModbus(Exception):
    """The bytes are no Modbus/TCP."""


@dataclass(frozen=True)
class Message:
    """One message, and where it ends in the buffer that it was found in."""

    transaction: int
    unit: int
    pdu: bytes
    end: int


def first(buffer: bytes, start: int = 0) -> Message | None:
    """The message that begins at `start`; None while it is not whole. Raises NotModbus."""
    if buffer[start + 2 : start + 4].strip(b"\0") or buffer[start + 4 : start + 5].strip(b"\0"):
        raise NotModbus
    if len(buffer) < start + 6:
        return None
    length = buffer[start + 5]
    if not _LEAST <= length <= _MOST:
        raise NotModbus
    end = start + 6 + length
    if len(buffer) < end:
        return None
    return Message(int.from_bytes(buffer[start : start + 2]), buffer[start + 6], buffer[start + 7 : end], end)


def words_of(value: int, count: int) -> tuple[int, ...]:
    """A signed number as words, the low one first (4.2.5's example: 600000 is 27C0 0009)."""
    return tuple((value >> 16 * place) & 0xFFFF for place in range(count))


def signed(words: Sequence[int]) -> int:
    """The signed number in words, the low one first."""
    value = sum(word << 16 * place for place, word in enumerate(words))
    return value - (1 << 16 * len(words)) if value >> (16 * len(words) - 1) else value


def fits(asked: bytes, answer: bytes) -> bool:
    """Whether an answer of the same function can be the answer to the request."""
    function, size = asked[0], len(answer)
    if answer[0] & EXCEPTION:
        return size == 2
    if function == READ_REGISTERS:
        count = int.from_bytes(asked[3:5])
        return size == 2 + 2 * count and answer[1] == 2 * count
    if function in (READ_COILS, READ_INPUTS):
        count = (int.from_bytes(asked[3:5]) + 7) // 8
        return size == 2 + count and answer[1] == count
    if function in (WRITE_COIL, WRITE_REGISTERS):
        return answer == asked[:5]
    if function == IDENTIFY:
        return size >= 7 and answer[1:3] == asked[1:3]
    if function == READ_SPECIFIC:  # the manual leaves room for one byte more than was counted
        return size >= 2 and size - 2 - answer[1] in (0, 1)
    return size >= 2
