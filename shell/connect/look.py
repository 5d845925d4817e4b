"""The part of the configuration that is for the screen: colours, signs, times, and keys by the names of functions.

[screen]
theme = "multidrop-light"
signs = "ascii"             # auto, full, boxes, ascii
times = "last"              # of the lines in a transcript: off, clock, start, last

[keys]
palette = "^G"
panel-plot = "F9"
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from multidrop.dialects import Diagnostic
from multidrop.shell.transcripts import TIMES

SIGNS = ("auto", "full", "boxes", "ascii")
CHOICES = {"signs": SIGNS, "times": tuple(TIMES)}
"""The settings that have one of a few words."""


@dataclass(frozen=True)
class Look:
    """The settings of the screen. The screen itself checks the names of themes, functions and keys."""

    theme: str = ""
    signs: str = "auto"
    keys: Mapping[str, str] = field(default_factory=dict)
    where: str = ""
    """The file, for messages."""
    times: str = "clock"


DEFAULT = Look()


def read(screen: Any, keys: Any, where: str) -> Look:
    """Read the tables `[screen]` and `[keys]`. Raises Diagnostic."""
    if not isinstance(screen, dict) or not isinstance(keys, dict):
        table = "keys" if isinstance(screen, dict) else "screen"
        raise Diagnostic(f"{table} is not a table", where, f"write [{table}]")
    for key, value in screen.items():
        if key != "theme" and key not in CHOICES:
            raise Diagnostic(f"no key screen.{key}", where, f"valid: {', '.join([*CHOICES, 'theme'])}")
        if not isinstance(value, str):
            raise Diagnostic(f"screen.{key} is not text", where)
        if key in CHOICES and value not in CHOICES[key]:
            raise Diagnostic(f"screen.{key}: {value!r} is unknown", where, f"valid: {', '.join(CHOICES[key])}")
    for name, key in keys.items():
        if not isinstance(key, str):
            raise Diagnostic(f"keys.{name} is not text", where, 'write a key as in "^T" or "F9"')
    chosen = {key: screen[key] for key in CHOICES if key in screen}
    return Look(screen.get("theme", ""), keys=keys, where=where, **chosen)
