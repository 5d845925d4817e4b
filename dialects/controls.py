"""The controls of an axis: buttons whose lines a family gives in a table.

Every move among them is bounded: it ends by itself. A line holds `{by}` for a distance, and `{to}` for a position or a
speed. The homings of an axis are a table of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from multidrop.base.files import rows

BY, TO, STOP, ENABLE, DISABLE = "by", "to", "stop", "enable", "disable"
SET, SPEED, TARGET = "set", "speed", "target"
"""The position that it is at from now on; the velocity, and the target, of a move that is under way."""
NAMES = (BY, TO, STOP, ENABLE, DISABLE, SET, SPEED, TARGET)
UNKNOWN = "such drives have no line for it, as far as is known"
LOW, HIGH = -(2**31), 2**31 - 1
"""The range of positions of every family."""


@dataclass(frozen=True)
class Control:
    """One control. `about`: what it does, where its lines do not say it."""

    lines: tuple[str, ...] = ()
    about: str = ""
    absent: str = ""
    """The reason for which the family has no such control; it has no lines then."""

    def filled(self, by: int | str = 0, to: int | str = 0) -> tuple[str, ...]:
        return tuple(line.format(by=by, to=to) for line in self.lines)

    def shown(self, by: str = "", to: str = "") -> str:
        return ", ".join(line.format(by=by, to=to) for line in self.lines)


Controls = Mapping[str, Control]
"""Controls by name; every name of `NAMES` is there."""


@cache
def controls_of(module: str, axis: str = "", number: int = 1) -> Controls:
    """Read the controls of an axis: `controls.csv` next to a module, whose `__file__` is given.

    Its lines are divided by ` // `; in them `{axis}` is the name of the axis, and `{number}` its number.
    """
    controls = {name: Control(absent=UNKNOWN) for name in NAMES}
    for row in rows(module, "controls.csv"):
        lines = _lines(row["lines"], axis, number)
        about = row["about"].replace("{axis}", axis)
        controls[row["name"]] = Control(lines, about, row.get("absent", ""))
    return controls


def _lines(text: str, axis: str, number: int = 1) -> tuple[str, ...]:
    lines = text.replace("{axis}", axis).replace("{number}", str(number)).split(" // ")
    return tuple(filter(None, lines))


@dataclass(frozen=True)
class Homing:
    """One way to home an axis."""

    mode: str
    sign: str
    """The direction in which it begins; empty: settings of the drive fix it."""
    lines: tuple[str, ...]
    about: str = ""


@cache
def homings_of(module: str, axis: str = "") -> tuple[Homing, ...]:
    """Read the homings of an axis: `homings.csv` next to a module, in the form of `controls.csv`."""
    found = rows(module, "homings.csv")
    return tuple(Homing(row["mode"], row["sign"], _lines(row["lines"], axis), row["about"]) for row in found)


def by_mode(homings: Sequence[Homing]) -> dict[str, dict[str, str]]:
    """The homings of one line, by mode and direction."""
    modes: dict[str, dict[str, str]] = {}
    for homing in homings:
        if len(homing.lines) == 1:
            modes.setdefault(homing.mode, {})[homing.sign] = homing.lines[0]
    return modes


def homings_by_mode(modes: Mapping[str, Mapping[str, str]]) -> list[Homing]:
    """The homings of a family without such a table, from the lines by mode and direction."""
    return [Homing(mode, sign, (line,)) for mode, lines in modes.items() for sign, line in lines.items()]
