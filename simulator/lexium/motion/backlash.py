"""Backlash: what a move is lengthened by to make up for play in the gear (manual 5.1.10 to 5.1.12).

Mode 0 (BM=0) adds |BL| to each move that reverses the axis; the counters show it. The sum of all that was added is part
of the targets of absolute moves until P is set again, so these stay true on both flanks. The first move counts as along
the flank that is loaded already. Mode 1 passes a target by |BL| and returns, unless the move has the direction of BL's
sign. So it reaches every target from one side.
"""

from __future__ import annotations

from collections.abc import Mapping

from simulator.lexium.state.expressions import Value


class Backlash:
    """The flank that is loaded, and the sum of what was added, in the unit of commands."""

    def __init__(self, values: Mapping[str, Value]) -> None:
        self.values = values
        self.flank = 0
        self.added = 0

    def restart(self) -> None:
        """Begin at power-up: no flank is loaded."""
        self.flank = self.added = 0

    def forget(self) -> None:
        """Forget what was added: P has been set, and it is part of the position now."""
        self.added = 0

    def convert(self, ratio: float) -> None:
        """Convert what was added to another unit of commands."""
        self.added = round(self.added * ratio)

    def plan(self, distance: int, absolute: bool) -> tuple[int, int]:
        """The distance to go for a move, and the distance to go after that."""
        values = self.values
        if not values.get("BE"):
            self.flank, self.added = (distance > 0) - (distance < 0) or self.flank, 0
            return distance, 0
        amount, sign = abs(int(values["BL"])), 1 if values["BL"] >= 0 else -1
        if values["BM"]:
            loads = not distance or (distance > 0) == (sign > 0)
            return (distance, 0) if loads else (distance - sign * amount, sign * amount)
        if absolute:
            distance += self.added
        flank = (distance > 0) - (distance < 0)
        if flank and self.flank and flank != self.flank:
            self.added += flank * amount
            distance += flank * amount
        self.flank = flank or self.flank
        return distance, 0
