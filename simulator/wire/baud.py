"""The bytes that a receiver samples from a signal of another baud rate."""

from __future__ import annotations

from math import ceil

BITS_A_BYTE = 10
"""A byte on the wire: a start bit, eight bits of data, a stop bit (8N1)."""


def resample(data: bytes, sent: float, received: float) -> bytes:
    """Sample bytes that are sent back to back at `sent` baud (8N1) with a receiver set to `received` baud.

    The receiver starts at a falling edge and samples the middle of each of its own bit times. It delivers the byte even
    if the stop bit is not one.
    """
    if sent == received:
        return data
    levels = [1]
    for byte in data:
        levels += [0, *((byte >> bit) & 1 for bit in range(8)), 1]
    ratio = sent / received
    out = bytearray()
    at = 1
    while at < len(levels):
        if levels[at] or not levels[at - 1]:
            at += 1
            continue
        bits = [_level(levels, at + (bit + 1.5) * ratio) for bit in range(8)]
        out.append(sum(level << bit for bit, level in enumerate(bits)))
        at = max(at + 1, ceil(at + 9.5 * ratio))
    return bytes(out)


def _level(levels: list[int], at: float) -> int:
    """The level of the wire at a time in sent bits; idle after the last byte."""
    return levels[int(at)] if at < len(levels) else 1
