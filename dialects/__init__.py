"""The languages of drives, as pure functions of bytes and text: requests, replies, tables, programs.

Each name below is imported from its module at its first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from multidrop.base.on_demand import imported

if TYPE_CHECKING:
    from multidrop.dialects.codec import Codec as Codec
    from multidrop.dialects.codec import Decoded as Decoded
    from multidrop.dialects.codec import End as End
    from multidrop.dialects.codec import Kind as Kind
    from multidrop.dialects.codec import Priority as Priority
    from multidrop.dialects.codec import Procedure as Procedure
    from multidrop.dialects.codec import Reply as Reply
    from multidrop.dialects.codec import Request as Request
    from multidrop.dialects.codec import Started as Started
    from multidrop.dialects.codec import StopPiece as StopPiece
    from multidrop.dialects.family import Family as Family
    from multidrop.dialects.family import Hints as Hints
    from multidrop.dialects.family import Motion as Motion
    from multidrop.dialects.family import Progress as Progress
    from multidrop.dialects.state import DriveState as DriveState
    from multidrop.dialects.state import Owed as Owed

_MODULES = {
    "codec": ("Codec", "Decoded", "End", "Kind", "Priority", "Procedure", "Reply", "Request", "Started", "StopPiece"),
    "family": ("Family", "Hints", "Motion", "Progress"),
    "state": ("DriveState", "Owed"),
}
_PLACES = {name: f"multidrop.dialects.{module}:{name}" for module, names in _MODULES.items() for name in names}


if not TYPE_CHECKING:  # else a checker of types would take any name

    def __getattr__(name: str) -> Any:
        if name not in _PLACES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return imported(_PLACES[name])
