"""The axis's steps in the world: where the rotor is for the switches, the wall and the index marks.

A step of the world is 1/51200 of a turn whatever MS is. RD turns the axis round. Manual 5.1.110.
"""

from __future__ import annotations

from math import copysign, floor, inf

from multidrop.simulator.kinematics.profile import Profile
from multidrop.simulator.world import REVOLUTION, World

TOUCH = 1e-6
"""Steps that are rounding."""
AFTER = (0.0, 1e-12, 1e-9, 1e-6)
"""Seconds after which a switch that is passed is seen changed, whatever rounding does."""


class WorldFrame:
    """Positions of one axis, turned into the world's and back."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._side = 1.0 if (world.stall_at or 0.0) >= 0 else -1.0
        self._rate = 1.0
        self._origin = world.pushed

    @property
    def turn(self) -> float:
        """Motor steps in a turn."""
        return REVOLUTION / abs(self._rate)

    def orient(self, here: float, steps_per_turn: float, reverse: bool) -> None:
        """MS, SA or RD may have changed: the rotor stays, at `here`, and a step means something else from now on."""
        rate = REVOLUTION / steps_per_turn * (-1 if reverse else 1)
        if rate != self._rate:
            self._origin += (self._rate - rate) * here
            self._rate = rate

    def physical(self, steps: float) -> float:
        """A place in the world's steps."""
        return self._origin + self._rate * steps

    def next_switch(self, profile: Profile, shift: float, t: float) -> float:
        """When a switch of the world next changes because the rotor moves on a profile; infinite: never."""
        if profile.end <= t:
            return inf
        physical = profile if self._rate == 1.0 else profile.scaled(self._rate)
        found = self._world.next_switch(physical, t, self._origin + self._rate * shift)
        if found is None:
            return inf
        if physical is profile and not (self._origin or shift):
            return found
        before = self._switches(profile, shift, t)
        seen = (found + later for later in AFTER if self._switches(profile, shift, found + later) != before)
        return next(seen, found + AFTER[-1])

    def _switches(self, profile: Profile, shift: float, t: float) -> tuple[bool, bool, bool]:
        return self._world.switches(self.physical(profile.position(t) + shift))

    def index_ahead(self, here: float, direction: float, offset: float = 0.0) -> float:
        """The next place beyond `here` that is `offset` (steps of 1/51200 turn) from an index mark."""
        zero = (self._world.index - self._origin) / self._rate + offset * self.turn / REVOLUTION
        turns = (here - zero) / self.turn
        return zero + self.turn * (floor(turns + TOUCH) + 1 if direction > 0 else -floor(-turns + TOUCH) - 1)

    def wall(self) -> tuple[float, float] | None:
        """Where the rotor cannot pass, and in which direction that lies."""
        if self._world.stall_at is None:
            return None
        return (self._world.stall_at - self._origin) / self._rate, copysign(1.0, self._side * self._rate)

    def pushed(self, steps: float, here: float) -> float:
        """A push by the world's steps, which ends at the wall, in the axis's."""
        if self._world.stall_at is not None:
            room = (self._world.stall_at - self.physical(here)) * self._side
            steps = steps if steps * self._side <= room else room * self._side
        return steps / self._rate
