"""What drives speak, as pure functions of bytes and text: requests, replies, tables, programs."""

from dialects.base import (
    Decoded,
    Dialect,
    End,
    Hints,
    Kind,
    Known,
    Motion,
    Priority,
    Progress,
    Registered,
    Reply,
    Request,
    SourceLine,
    Stated,
    Talk,
)
from dialects.errors import Diagnostic, DriveError, Inexpressible, NoAnswer, Refused, Stopped

__all__ = [
    "Decoded",
    "Dialect",
    "Diagnostic",
    "DriveError",
    "End",
    "Hints",
    "Inexpressible",
    "Kind",
    "Known",
    "Motion",
    "NoAnswer",
    "Priority",
    "Progress",
    "Refused",
    "Registered",
    "Reply",
    "Request",
    "SourceLine",
    "Stated",
    "Stopped",
    "Talk",
]
