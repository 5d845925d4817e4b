"""The reference search of a simulated TMCL motor (RFS), as a machine of phases.

Modes (axis parameter 193): 1 the left switch; 2 the right one, then the left one; 3 the right one, then the home
switch. Ruling: the motor turns to a switch at the search velocity, stops at once where it closes, and leaves it at the
switch velocity; where it opens is position 0. Mode 2 keeps the distance between the two switches in parameter 196.
"""

from __future__ import annotations

from enum import Enum
from itertools import pairwise

from multidrop.dialects.tmcl.manual.commands import Axis
from multidrop.simulator.tmcl.motor import Motor, wrapped

HOME, RIGHT, LEFT = 0, 1, 2
"""Places in what `Shaft.switches` gives."""


class Phase(Enum):
    """What a search does now."""

    TO_RIGHT = "turn right until the right switch closes"
    TO_LEFT = "turn left until the left switch closes"
    TO_HOME = "turn left until the home switch closes"
    OFF_LEFT = "turn right until the left switch opens"
    OFF_HOME = "turn right until the home switch opens"
    DONE = "stand at position 0"


ROUTES: dict[int, tuple[Phase, ...]] = {
    1: (Phase.TO_LEFT, Phase.OFF_LEFT, Phase.DONE),
    2: (Phase.TO_RIGHT, Phase.TO_LEFT, Phase.OFF_LEFT, Phase.DONE),
    3: (Phase.TO_RIGHT, Phase.TO_HOME, Phase.OFF_HOME, Phase.DONE),
}
"""The phases of each mode."""
STEPS: dict[Phase, tuple[int, int, bool, Axis]] = {
    Phase.TO_RIGHT: (1, RIGHT, True, Axis.SEARCH_SPEED),
    Phase.TO_LEFT: (-1, LEFT, True, Axis.SEARCH_SPEED),
    Phase.TO_HOME: (-1, HOME, True, Axis.SEARCH_SPEED),
    Phase.OFF_LEFT: (1, LEFT, False, Axis.SWITCH_SPEED),
    Phase.OFF_HOME: (1, HOME, False, Axis.SWITCH_SPEED),
}
"""Direction, switch, the state of it that ends the phase, and the parameter that holds the velocity."""


class ReferenceSearch:
    """One search of a motor."""

    def __init__(self, motor: Motor, mode: int, t: float) -> None:
        self._motor = motor
        self._follower = dict(pairwise(ROUTES[mode]))
        self._right_at = 0
        self.phase = Phase.DONE
        self._enter(ROUTES[mode][0], t)

    @property
    def running(self) -> bool:
        """Whether it has not come to its end."""
        return self.phase is not Phase.DONE

    def live(self, t: float) -> None:
        """Go on to the next phase where this one has found its switch."""
        while self.running and self._found(t):
            if self.phase is Phase.TO_RIGHT:
                self._right_at = self._motor.position(t)
            elif self.phase is Phase.TO_LEFT:
                distance = wrapped(self._right_at - self._motor.position(t))
                self._motor.parameters[Axis.SWITCH_DISTANCE] = distance if Phase.TO_RIGHT in self._follower else 0
            self._motor.freeze(t)
            self._enter(self._follower[self.phase], t)

    def _found(self, t: float) -> bool:
        _, switch, closed, _ = STEPS[self.phase]
        return self._motor.shaft.switches(t)[switch] is closed

    def _enter(self, phase: Phase, t: float) -> None:
        self.phase = phase
        if phase is Phase.DONE:
            self._motor.set_zero(t)
            return
        way, _, _, speed = STEPS[phase]
        self._motor.rotate(way * self._motor.parameters[speed], t)
