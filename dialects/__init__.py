"""The languages of drives, as pure functions of bytes and text: requests, replies, tables, programs.

Each name below is imported from its module at its first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from multidrop.dialects.on_demand import imported

if TYPE_CHECKING:
    from multidrop.dialects.codec import (
        Codec,
        Command,
        Decoded,
        End,
        Kind,
        Priority,
        Procedure,
        Reply,
        Request,
        StopPiece,
    )
    from multidrop.dialects.errors import Diagnostic, DriveError, Inexpressible, NoAnswer, Refused, Stopped
    from multidrop.dialects.family import Family, Hints, Motion, Progress
    from multidrop.dialects.files import SourceLine
    from multidrop.dialects.state import DriveState, Owed

_MODULES = {
    "codec": ("Codec", "Command", "Decoded", "End", "Kind", "Priority", "Procedure", "Reply", "Request", "StopPiece"),
    "errors": ("Diagnostic", "DriveError", "Inexpressible", "NoAnswer", "Refused", "Stopped"),
    "family": ("Family", "Hints", "Motion", "Progress"),
    "files": ("SourceLine",),
    "state": ("DriveState", "Owed"),
}
_PLACES = {name: f"multidrop.dialects.{module}:{name}" for module, names in _MODULES.items() for name in names}
__all__ = [
    "Codec",
    "Command",
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


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return imported(_PLACES[name])
