"""Backlash: what a move is lengthened by to make up for play in the gear (manual 5.1.10 to 5.1.12).

Mode 0 (BM=0) adds |BL| to every move that turns the axis round, and the counters show it; so that absolute moves stay
true on both flanks, the sum of what was added is part of their targets until P is set anew. The first move is taken to
be along the flank that is loaded already. Mode 1 goes past a target by |BL| and back whenever the move's direction is
not that of BL's sign, so that every target is reached from the same side.
"""

from __future__ import annotations

from collections.abc import Mapping

from simulator.lexium.state.expressions import Value


class Backlash:
    """Which flank is loaded, and what has been added so far; in the unit that commands are in."""

    def __init__(self, values: Mapping[str, Value]) -> None:
        self.values = values
        self.flank = 0
        self.added = 0

    def restart(self) -> None:
        """Begin at power-up: no flank is loaded."""
        self.flank = self.added = 0

    def forget(self) -> None:
        """P has been set, or the drive restarted: what was added is part of the position now."""
        self.added = 0

    def convert(self, ratio: float) -> None:
        """Commands are in another unit from now on."""
        self.added = round(self.added * ratio)

    def plan(self, way: int, absolute: bool) -> tuple[int, int]:
        """How far to go for a move by `way`, and how far to go after that."""
        values = self.values
        if not values.get("BE"):
            self.flank, self.added = (way > 0) - (way < 0) or self.flank, 0
            return way, 0
        amount, sign = abs(int(values["BL"])), 1 if values["BL"] >= 0 else -1
        if values["BM"]:
            return (way, 0) if not way or (way > 0) == (sign > 0) else (way - sign * amount, sign * amount)
        if absolute:
            way += self.added
        flank = (way > 0) - (way < 0)
        if flank and self.flank and flank != self.flank:
            self.added += flank * amount
            way += flank * amount
        self.flank = flank or self.flank
        return way, 0
