"""multidrop: a terminal and a scripting shell for motion drives on a shared line.

The public Python API, imported from the rooms on first use:

    from multidrop import Session          # everything open: run(line), stop()
    from multidrop import parse_url        # the settings in a URL
"""

from __future__ import annotations

import importlib
import os
import sys

TYPE_CHECKING = False  # `typing` is not imported: this file runs at the start of every command

if TYPE_CHECKING:
    from typing import Any

    from dialects import Diagnostic, DriveError, NoAnswer, Refused, Stopped
    from drives.bus import Bus
    from drives.drive import Drive
    from macros import Macro, MacroStore
    from shell.connect.urls import Connection
    from shell.connect.urls import parse as parse_url
    from shell.events import By
    from shell.session import Session
    from transports import TransportLost, Unreachable

__version__ = "0.1.0"
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
    home = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
    for room in rooms:
        origin = _origin(room)
        if origin is None:
            return f"the part of multidrop that is called {room} is missing: install multidrop again"
        if os.path.dirname(os.path.realpath(origin)) != os.path.join(home, room):
            return f"{origin} hides a part of multidrop that is called {room}: rename that file"
    return ""


def _origin(room: str) -> str | None:
    """Find the file that an import of the room runs or ran. `importlib.util` does it in twice the time of a start."""
    if room in sys.modules:
        return getattr(sys.modules[room], "__file__", None)
    specs = (finder.find_spec(room, None) for finder in sys.meta_path)
    return next((spec.origin for spec in specs if spec is not None), None)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if found := hidden():
        raise ImportError(found, name=__name__)
    module, attribute = _PUBLIC[name]
    return getattr(importlib.import_module(module), attribute)
