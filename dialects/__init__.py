"""The languages of drives, as pure functions of bytes and text: requests, replies, tables, programs."""

from dialects.codec import Codec, Decoded, End, Kind, Priority, Procedure, Reply, Request, StopPiece
from dialects.errors import Diagnostic, DriveError, Inexpressible, NoAnswer, Refused, Stopped
from dialects.family import Family, Hints, Motion, Progress
from dialects.files import SourceLine
from dialects.state import DriveState, Owed

__all__ = [
    "Codec",
    "Decoded",
    "Diagnostic",
    "DriveError",
    "DriveState",
    "End",
    "Family",
    "Hints",
    "Inexpressible",
    "Kind",
    "Motion",
    "NoAnswer",
    "Owed",
    "Priority",
    "Procedure",
    "Progress",
    "Refused",
    "Reply",
    "Request",
    "SourceLine",
    "StopPiece",
    "Stopped",
]
