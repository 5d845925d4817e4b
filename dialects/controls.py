"""The controls of an axis by key: the lines that each one sends, or the reason for its absence.

Every move among them is bounded: it ends by itself. A line holds `{by}` for a distance and `{to}` for a position.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

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

    def filled(self, by: int = 0, to: int = 0) -> tuple[str, ...]:
        """The lines with their numbers."""
        return tuple(line.format(by=by, to=to) for line in self.lines)

    def shown(self, by: str = "", to: str = "") -> str:
        """The lines as a person reads them."""
        return ", ".join(line.format(by=by, to=to) for line in self.lines)


Controls = Mapping[str, Control]
"""Controls by name; every name of `NAMES` is there."""
