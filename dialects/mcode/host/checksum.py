"""The checksum of MCode frames and printed lines.

Theory of operation. The checksum covers all characters before the terminator, the drive's name (or `*`) included. Their
sum modulo 128 is negated, so the lower seven bits of frame and checksum add up to 0. Bit 7 is set, so the check byte is
never a terminator or a printable character. It is sent as a raw byte. (MCode reference 7.1.2, 5.1.21.)
"""

from __future__ import annotations


def checksum(data: bytes) -> int:
    """Compute the check byte (0x80 to 0xFF) of a frame. `MR 51200` gives 0xC9."""
    return (-sum(data) & 0x7F) | 0x80


def sealed(data: bytes) -> bytes:
    """Append the check byte to the characters."""
    return data + bytes([checksum(data)])


def stripped(line: bytes) -> bytes:
    """Return a line without its check byte, if it has a right one: another drive of the line may use checksums."""
    return unsealed(line) or line


def unsealed(line: bytes) -> bytes | None:
    """Return a line without its check byte; None where that byte is missing or wrong.

    The sum does not cover bit 7, which no printed character has: a character with bit 7 is an error too.
    """
    if line and line[:-1].isascii() and line[-1] == checksum(line[:-1]):
        return line[:-1]
    return None
