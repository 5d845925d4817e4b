"""The controls of an axis: buttons whose lines a family gives in a table.

Every move among them is bounded: it ends by itself. A line holds `{by}` for a distance and `{to}` for a position.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from multidrop.base.files import rows

BY, TO, HOME_MINUS, HOME_PLUS = "by", "to", "home-", "home+"
STOP, ENABLE, DISABLE = "stop", "enable", "disable"
NAMES = (BY, TO, HOME_MINUS, HOME_PLUS, STOP, ENABLE, DISABLE)
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
    """Read the controls of an axis: `controls.csv` beside a module, whose `__file__` is given.

    Its lines are divided by ` // `; in them `{axis}` is the name of the axis, and `{number}` its number.
    """
    controls = {}
    for row in rows(module, "controls.csv"):
        lines = row["lines"].replace("{axis}", axis).replace("{number}", str(number)).split(" // ")
        controls[row["name"]] = Control(tuple(filter(None, lines)), row["about"], row.get("absent", ""))
    return controls
