"""Torque mode of hMT (AS=3): the motor turns at TS towards TD, as long as TQ is more than the load needs.

Manual 5.1.6, 5.1.122 to 5.1.124, 8.2.
"""

from __future__ import annotations

from math import inf

from multidrop.simulator.kinematics.profile import halt
from multidrop.simulator.lexium.motion.axis import TORQUE, Axis
from multidrop.simulator.lexium.motion.bridges import Bridges
from multidrop.simulator.lexium.motion.limits import Limits
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.timeline import Timeline
from multidrop.simulator.world import World

FIXED, VARIABLE, TORQUE_MODE = 1, 2, 3
"""Values of AS."""


class Torque:
    """Torque mode of one drive. `halted`: a stop lets it stand until AS is set again, a pause until it goes on."""

    def __init__(
        self, memory: Memory, timeline: Timeline, world: World, axis: Axis, bridges: Bridges, limits: Limits
    ) -> None:
        self._values, self._timeline, self._world = memory.values, timeline, world
        self._axis, self._bridges, self._limits = axis, bridges, limits
        self.halted = False

    @property
    def active(self) -> bool:
        """Whether the drive is in torque mode."""
        return self._values.get("AS") == TORQUE_MODE

    def set_speed(self, speed: int) -> None:
        """Set TS, steps/s."""
        self._values["TS"] = speed
        self._timeline.replan()

    def halt(self) -> bool:
        """Slow down and stand, in torque mode. Gives whether the drive is in that mode."""
        if not self.active:
            return False
        self.halted = True
        self._timeline.replan()
        return True

    def go_on(self, t: float) -> None:
        """Turn again after a pause."""
        self.halted = False
        self._timeline.replan()

    def turn(self, t: float) -> bool:
        """Turn as TS and TD say, or stand while halted or at a limit. Gives whether something holds the rotor."""
        values, axis = self._values, self._axis
        direction = 1.0 if values["TD"] else -1.0
        free = self._bridges.driving and not self.halted and not self._limits.refuse(t, direction)
        speed = float(values["TS"]) if free else 0.0
        if speed and self._held(direction):
            if axis.profile.moving(t) and axis.profile.velocity(t) * direction >= 0:
                axis.begin(TORQUE, halt(t, axis.position(t)), t)
                self._timeline.replan()
            return True
        wanted = direction * speed
        final = axis.profile.segments[-1].velocity if axis.profile.end == inf else 0.0
        if wanted != final and (wanted or axis.profile.end == inf):
            axis.slow_to(wanted, t, kind=TORQUE)
            self._timeline.replan()
        return False

    def _held(self, direction: float) -> bool:
        return self._axis.rotor.holds(direction) or self._values["TQ"] <= 100 * self._world.load
