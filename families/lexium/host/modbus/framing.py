"""Modbus/TCP frames: messages cut out of a stream, and the match of reply and request. Pure functions.

Theory of operation. A message is a header of seven bytes (transaction, protocol 0, number of bytes that follow, unit)
and a PDU: a function code and its data, big-endian. The reply has the request's transaction number and its function
code, with the top bit set for an exception. Messages carry their length, so a stream is never searched for a beginning.
Bytes that cannot be a header show that the peer speaks another protocol. `pdu` handles the content of a PDU. (MODBUS
Application Protocol V1.1b3, 6; MODBUS Messaging on TCP/IP V1.0b, 3.1.3; Modbus/TCP manual 3.2, 4.)
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
"""Most characters in a manufacturer specific write (4.3.3)."""

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
NO_PATH, NO_TARGET = 10, 11
NO_RESULT = frozenset({5, NO_TARGET})
"""Exceptions after which a request may have been executed: the server works on it, or its reply did not arrive."""
NOT_EXECUTED = frozenset({1, 2, 3, 6, NO_PATH})
"""Exceptions that say that a request was not executed. After 04 that is not known, unless the drive has an error of its
own (the failure came in the execution), nor is it after a number that the standard has not."""
SAY_NOTHING = frozenset({NO_PATH, *NO_RESULT})
"""Exceptions that do not come from the device that was asked, or are no reply yet."""
GATEWAYS = {
    NO_PATH: "the gateway did not pass it on; check unit= and the gateway's settings",
    NO_TARGET: "the gateway got no reply; check the drive behind it, its power and unit=",
}
"""Exceptions of a gateway, not of a drive: what it did, and what to do."""

_LEAST, _MOST = 2, 254
"""Limits of the header's length: a unit and at least a function code, at most 253 bytes of PDU."""


class NotModbus(Exception):
    """The bytes are not Modbus/TCP."""


@dataclass(frozen=True)
class ModbusMessage:
    """One message, and its end in the buffer."""

    transaction: int
    unit: int
    pdu: bytes
    end: int


def first(buffer: bytes, start: int = 0) -> ModbusMessage | None:
    """Find the message that begins at `start`; None while it is incomplete. Raises NotModbus."""
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
    return ModbusMessage(int.from_bytes(buffer[start : start + 2]), buffer[start + 6], buffer[start + 7 : end], end)


def words_of(value: int, count: int) -> tuple[int, ...]:
    """Split a signed number into words, the low word first (4.2.5's example: 600000 is 27C0 0009)."""
    return tuple((value >> 16 * place) & 0xFFFF for place in range(count))


def signed(words: Sequence[int]) -> int:
    """Join words to a signed number, the low word first."""
    value = sum(word << 16 * place for place, word in enumerate(words))
    return value - (1 << 16 * len(words)) if value >> (16 * len(words) - 1) else value


def fits(asked: bytes, answer: bytes) -> bool:
    """Whether a reply of the same function can belong to the request."""
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
    if function == READ_SPECIFIC:  # the manual allows one byte more than the count
        return size >= 2 and size - 2 - answer[1] in (0, 1)
    return size >= 2
