"""The checksum of MCode frames and printed lines.

Theory of operation. The sum of all characters in front of the terminator, the drive's name (or `*`) included,
is taken modulo 128 and negated, so that summing frame and checksum gives 0 in the lower seven bits; bit 7 is set
so that the byte can never be taken for a terminator or a printable character. It travels as a raw byte.
(MCode reference 7.1.2, 5.1.21.)
"""

from __future__ import annotations


def checksum(data: bytes) -> int:
    """The check byte (0x80 to 0xFF) of the characters in front of it. `MR 51200` gives 0xC9."""
    return (-sum(data) & 0x7F) | 0x80


def sealed(data: bytes) -> bytes:
    """The characters with their check byte behind them."""
    return data + bytes([checksum(data)])


def unsealed(line: bytes) -> bytes | None:
    """The characters of a line whose last byte is their check byte; None where it is missing or wrong.

    The sum does not see bit 7, which no printed character has: a character with it is as wrong as a sum.
    """
    if line and line[:-1].isascii() and line[-1] == checksum(line[:-1]):
        return line[:-1]
    return None
