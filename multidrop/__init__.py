"""multidrop: a terminal and a scripting shell for motion drives on a shared line.

The public Python API, imported from the rooms on first use:

    from multidrop import Session          # everything open: run(line), stop()
    from multidrop import parse_url        # the settings in a URL
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dialects import Diagnostic, DriveError, NoAnswer, Refused, Stopped
    from drives.bus import Bus
    from drives.drive import Drive
    from macros import Macro, MacroStore
    from shell.connect.urls import Connection
    from shell.connect.urls import parse as parse_url
    from shell.events import By
    from shell.session import Session
    from transports import TransportLost, Unreachable

ROOMS = ("dialects", "transports", "drives", "simulator", "macros", "shell", "tui")
_PUBLIC = {
    "Bus": ("drives.bus", "Bus"),
    "By": ("shell.events", "By"),
    "Connection": ("shell.connect.urls", "Connection"),
    "Diagnostic": ("dialects", "Diagnostic"),
    "Drive": ("drives.drive", "Drive"),
    "DriveError": ("dialects", "DriveError"),
    "Macro": ("macros", "Macro"),
    "MacroStore": ("macros", "MacroStore"),
    "NoAnswer": ("dialects", "NoAnswer"),
    "Refused": ("dialects", "Refused"),
    "Session": ("shell.session", "Session"),
    "Stopped": ("dialects", "Stopped"),
    "TransportLost": ("transports", "TransportLost"),
    "Unreachable": ("transports", "Unreachable"),
    "parse_url": ("shell.connect.urls", "parse"),
}
__all__ = [
    "Bus",
    "By",
    "Connection",
    "Diagnostic",
    "Drive",
    "DriveError",
    "Macro",
    "MacroStore",
    "NoAnswer",
    "Refused",
    "Session",
    "Stopped",
    "TransportLost",
    "Unreachable",
    "parse_url",
]


def hidden(rooms: tuple[str, ...] = ROOMS) -> str:
    """Return the remedy if a file of the same name hides one of the rooms; empty if none does.

    The rooms are packages with plain names, so a `drives.py` beside a person's own script comes first.
    """
    home = Path(__file__).resolve().parent.parent
    for room in rooms:
        spec = getattr(sys.modules.get(room), "__spec__", None) or importlib.util.find_spec(room)
        origin = spec.origin if spec is not None else None
        if origin is not None and Path(origin).resolve().parent != home / room:
            return f"{origin} hides a part of multidrop that is called {room}: rename that file"
        if spec is None:
            return f"the part of multidrop that is called {room} is missing: install multidrop again"
    return ""


if _hidden := hidden():
    raise ImportError(_hidden, name=__name__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("multidrop")
        except PackageNotFoundError:  # run from a source tree that was not installed
            return "0+source"
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _PUBLIC[name]
    return getattr(importlib.import_module(module), attribute)
