"""Limits: switches on inputs (IS types 2 and 3) and positions in software (LS). Manual 5.1.76, 5.1.78.

A limit acts on motion in its own direction only. While it is active nothing moves further that way (83, 84). What LM
makes of one that is reached: `homing.LimitStop`.
"""

from __future__ import annotations

from math import inf, nextafter

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.motion.counters import Counters
from multidrop.simulator.lexium.motion.inputs import MINUS, PLUS
from multidrop.simulator.lexium.motion.world_frame import TOUCH

DIRECTIONS = {PLUS: 1, MINUS: -1}
"""Types of the limit switches, and their directions."""
ERRORS = {1: E.PLUS_LIMIT, -1: E.MINUS_LIMIT}
"""Codes by direction."""
SOFTWARE = {1: 1, -1: 0}
"""The first number of LS, by direction."""
FRESH = {0: (0, 0), 1: (0, 0)}
"""LS from the factory: position and whether it is enabled."""


class Limits:
    """The limits of one drive. `switches` are the directions of limit switches that are active, `software` is LS."""

    def __init__(self, counters: Counters) -> None:
        self._counters = counters
        self.switches: set[int] = set()
        self.software: dict[int, tuple[int, ...]] = dict(FRESH)

    def refuse(self, t: float, direction: float) -> int:
        """What forbids a motion in a direction: 83, 84 or 0."""
        sign = 1 if direction > 0 else -1
        if not direction:
            return 0
        return ERRORS[sign] if sign in self.switches or self._beyond(t, sign) else 0

    def beyond(self, t: float) -> set[int]:
        """The directions of the software limits that P is beyond."""
        return {direction for direction in SOFTWARE if self._beyond(t, direction)}

    def next_passed(self, t: float) -> tuple[float, int]:
        """When P next passes a software limit on its way out, and in which direction."""
        first = inf, 0
        for direction, n in SOFTWARE.items():
            if self.software[n][1] != 0 and (at := self._passes(t, direction)) < first[0]:
                first = at, direction
        return first

    def _enabled(self, direction: int) -> bool:
        return self.software[SOFTWARE[direction]][1] != 0

    def _place(self, direction: int) -> float:
        return self._counters.place_of(self.software[SOFTWARE[direction]][0])

    def _beyond(self, t: float, direction: int) -> bool:
        if not self._enabled(direction):
            return False
        return (self._counters.place(t) - self._place(direction)) * direction >= -TOUCH

    def _passes(self, t: float, direction: int) -> float:
        counters, place = self._counters, self._place(direction)
        if self._beyond(t, direction):
            back = counters.passing(place, t, -direction)
            t = inf if back == inf else nextafter(back, inf)
        return inf if t == inf else counters.passing(place, t, direction)
