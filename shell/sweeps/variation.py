"""The KEY of `--vary KEY=VALUES`: the place of a value in the table of a drive, and that table with other values."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from multidrop.dialects import Diagnostic
from multidrop.shell.sweeps.values import Value
from multidrop.simulator.cell.worlds import ENCODER_KEYS, KEYS

SEED = "seed"
WORLD, SETTINGS = "world", "set"
AXES = ("x", "y")
"""The axes that have a world of their own; keys without an axis belong to the first."""
OWN_KEYS = ("program", "program_text")
"""Keys of a drive's table that a program test does not use."""
Drive = Mapping[str, Any]
"""The table of a drive."""


@dataclass(frozen=True)
class Key:
    """A key as it is written, and its place: `world` or `set`, the axis, the name in a drive's table; or the seed."""

    text: str
    part: str
    name: str
    axis: str = ""

    def own(self, drive: Drive) -> Value | None:
        """The value in a drive's table; None: it has none."""
        if self.part == SEED:
            return None
        table = _table(drive, self.part)
        if self.part == SETTINGS:
            return next((value for name, value in table.items() if name.upper() == self.name), None)
        of_axis = _table(table, self.axis or AXES[0])
        found: Value | None = of_axis.get(self.name)
        return table.get(self.name) if found is None and self.axis in ("", AXES[0]) else found

    def put(self, drive: Drive, value: Value) -> Drive:
        """A drive's table with another value."""
        if self.part == SEED:
            return drive
        table = dict(_table(drive, self.part))
        if self.part == SETTINGS:
            table = {name: each for name, each in table.items() if name.upper() != self.name}
        axis = self.axis or (AXES[0] if self.name in _table(table, AXES[0]) else "")
        if axis == AXES[0]:
            table.pop(self.name, None)
        entry = {axis: {**_table(table, axis), self.name: value}} if axis else {self.name: value}
        return {**drive, self.part: {**table, **entry}}


def parse(text: str, names: Container[str]) -> tuple[str, Key]:
    """Parse a key; return its drive, empty for none, and the key. `names` are the drives'. Raises Diagnostic."""
    if text == SEED:
        return "", Key(text, SEED, SEED)
    drive, dot, rest = text.partition(".")
    if drive not in names:
        if dot and drive.lower() not in AXES:
            raise Diagnostic(f"no drive {drive}", f"--vary {text}")
        drive, rest = "", text
    axis, dot, name = rest.partition(".")
    axis, name = (axis.lower(), name) if dot else ("", rest)
    of_an_axis = axis in AXES and _in_world(name)
    if not name or (dot and not of_an_axis):
        raise Diagnostic("is not a key", f"--vary {text}", "valid: seed, DRIVE.KEY, or KEY with one drive")
    if axis or _in_world(name):
        return drive, Key(text, WORLD, name.lower(), axis)
    return drive, Key(text, SETTINGS, name.upper())


def hint(key: Key) -> str:
    """What a refused setting may have meant: a key of the world with a similar name; empty if none has."""
    near = get_close_matches(key.name.lower(), (*KEYS, *ENCODER_KEYS), 1, 0.7) if key.part == SETTINGS else ()
    return f"did you mean the world's {near[0]}?" if near else ""


def _in_world(name: str) -> bool:
    return name.lower() in (*KEYS, *ENCODER_KEYS)


def _table(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found: Mapping[str, Any] = table.get(key, {})
    return found
