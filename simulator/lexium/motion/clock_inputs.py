"""The clock inputs: with FL or CM one step for each pulse, or each edge of a quadrature, times CR.

Manual 5.1.46; MDrivePlus 5-13, 5-14.
"""

from __future__ import annotations

from simulator.lexium.motion.inputs import Inputs
from simulator.lexium.state.memory import Memory
from simulator.lexium.state.models import STEP_DIRECTION, UP_DOWN

_TURNS = {(0, 0): 0, (0, 1): 1, (1, 1): 2, (1, 0): 3}
"""The four states of A and B in the order that counts up."""


class ClockInputs:
    """The clock of one drive, which is two of its inputs."""

    def __init__(self, memory: Memory, inputs: Inputs) -> None:
        self._values, self._inputs = memory.values, inputs
        self._states = (1, 1)
        self._part = 0.0

    def steps(self) -> int:
        """Whole steps that the clock has asked for since the last look, with a sign."""
        values, inputs, points = self._values, self._inputs, self._inputs.points
        kind = points.clock_types.get(inputs.types[points.clocks[0]][0]) if points.clocks else None
        if kind is None:
            return 0
        was, now = self._states, tuple(int(inputs.level(n) == inputs.types[n][1]) for n in points.clocks)
        self._states = (now[0], now[1])
        if not values.get(points.follow) or was == now:
            return 0
        self._part += _pulses(kind, was, self._states) * values.get("CR", 1)
        steps = int(self._part)
        self._part -= steps
        return steps


def _pulses(kind: str, was: tuple[int, int], now: tuple[int, int]) -> int:
    """What a clock has counted between two states of its inputs, with a sign."""
    rises = [int(new and not old) for old, new in zip(was, now, strict=True)]
    if kind == STEP_DIRECTION:
        return rises[0] * (1 if now[1] else -1)
    if kind == UP_DOWN:
        return rises[0] - rises[1]
    steps = (_TURNS[now] - _TURNS[was] + 1) % 4 - 1
    return 0 if steps == 2 else steps
