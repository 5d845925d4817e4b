"""Frames of nine bytes: requests out, replies in (TMCL firmware manuals, "Binary command format").

Fields are big-endian. The last byte is the sum of the others modulo 256.
"""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

from multidrop.dialects.tmcl.manual.commands import Call

LENGTH = 9
_FIELDS = Struct(">BBBBi")


class Frame(NamedTuple):
    """A reply: addresses of host and module, status, the command that it repeats, and a value."""

    host: int
    module: int
    status: int
    command: int
    value: int


def request(address: int, call: Call) -> bytes:
    """The frame of a command."""
    return _sealed(_FIELDS.pack(address, call.command, call.type, call.motor, call.value))


def reply(frame: bytes) -> Frame | None:
    """The fields of a reply; None where its checksum is wrong."""
    return Frame(*_FIELDS.unpack(frame[:-1])) if _sealed(frame[:-1]) == frame else None


def call_of(frame: bytes) -> tuple[int, Call]:
    """The address and the command in the frame of a request."""
    address, command, kind, motor, value = _FIELDS.unpack(frame[:-1])
    return address, Call(command, kind, motor, value)


def moves(frames: bytes) -> bool:
    """Whether requests can start a motion or a program; a part of one may belong to any."""
    pieces = [frames[at : at + LENGTH] for at in range(0, len(frames), LENGTH)]
    return any(len(each) < LENGTH or call_of(each)[1].moves for each in pieces)


def _sealed(body: bytes) -> bytes:
    return body + bytes([sum(body) % 256])
