"""The part of the configuration that is for the screen: colours, signs, and keys by the names of functions.

[screen]
theme = "multidrop-light"
signs = "ascii"             # auto, full, boxes, ascii

[keys]
palette = "^G"
panel-plot = "F9"
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dialects import Diagnostic

SIGNS = ("auto", "full", "boxes", "ascii")


@dataclass(frozen=True)
class Look:
    """The settings of the screen. The screen itself checks the names of themes, functions and keys."""

    theme: str = ""
    signs: str = "auto"
    keys: Mapping[str, str] = field(default_factory=dict)
    where: str = ""
    """The file, for messages."""


DEFAULT = Look()


def read(screen: Any, keys: Any, where: str) -> Look:
    """Read the tables `[screen]` and `[keys]`. Raises Diagnostic."""
    if not isinstance(screen, dict) or not isinstance(keys, dict):
        table = "keys" if isinstance(screen, dict) else "screen"
        raise Diagnostic(f"{table} is not a table", where, f"write [{table}]")
    for key, value in screen.items():
        if key not in ("theme", "signs"):
            raise Diagnostic(f"no key screen.{key}", where, "valid: signs, theme")
        if not isinstance(value, str):
            raise Diagnostic(f"screen.{key} is not text", where)
    signs = screen.get("signs", "auto")
    if signs not in SIGNS:
        raise Diagnostic(f"screen.signs: {signs!r} is unknown", where, f"valid: {', '.join(SIGNS)}")
    for name, key in keys.items():
        if not isinstance(key, str):
            raise Diagnostic(f"keys.{name} is not text", where, 'write a key as in "^T" or "F9"')
    return Look(screen.get("theme", ""), signs, keys, where)
