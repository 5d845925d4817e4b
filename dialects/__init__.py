"""What drives speak, as pure functions of bytes and text: requests, replies, tables, programs."""

from dialects.base import (
    Decoded,
    Dialect,
    End,
    Kind,
    Priority,
    Reply,
    Request,
    Talk,
)
from dialects.errors import Diagnostic, DriveError, NoAnswer, Refused, Stopped

__all__ = [
    "Decoded",
    "Dialect",
    "Diagnostic",
    "DriveError",
    "End",
    "Kind",
    "NoAnswer",
    "Priority",
    "Refused",
    "Reply",
    "Request",
    "Stopped",
    "Talk",
]
