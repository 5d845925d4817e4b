"""A shaft that a motor without feedback turns: what the commanded steps move, and what the shaft runs into.

Theory of operation. The motor commands steps (a `Profile`); the shaft follows in proportion, or is at rest:
without current, at a wall, or held fast. Steps that it misses are lost, as nothing measures it. Each stretch is the
command's own profile in another scale, so walls and switches are found by formulas. A new stretch begins where the
profile or the scale changes. Positions are the world's motor steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import copysign

from multidrop.simulator.kinematics.profile import Profile, halt
from multidrop.simulator.world import World

TOUCH = 1e-6
"""Steps; less than this is rounding."""


class Shaft:
    """One shaft. The motor reports every new profile with `follow` and calls `settle` at events."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.powered = False
        self.scale = 1.0
        """Motor steps that a commanded step turns while nothing holds the shaft; signed. `settle` takes it in."""
        self.factor = 0.0
        """Motor steps that a commanded step turns now; 0 while the shaft is at rest."""
        self.path = halt(0.0, 0.0)
        """The motion of the shaft, up to an offset."""
        self._command = self.path
        self.offset = 0.0
        """Motor steps between `path` and the position."""
        self._pushed = world.pushed
        self._wall = 0.0 if world.stall_at is None else copysign(1.0, world.stall_at)

    def position(self, t: float) -> float:
        """Physical motor steps."""
        return self.path.position(t) + self.offset

    def switches(self, t: float) -> tuple[bool, bool, bool]:
        """Home, plus, minus: which switches are closed."""
        return self.world.switches(self.position(t))

    def follow(self, command: Profile, t: float, rounded: float = 0.0) -> None:
        """Follow another profile from now on. `rounded`: commanded steps by which it begins further on."""
        place = self.position(t) + self.factor * rounded
        self._command = command
        self._begin(self._coupling(place, t), place, t)

    def settle(self, t: float) -> None:
        """Take in what has changed at this time: pushes, walls, locks, current, scale."""
        place = self._this_side(self.position(t) + self.world.pushed - self._pushed)
        factor = self._coupling(place, t)
        if factor != self.factor or self.world.pushed != self._pushed:
            self._pushed = self.world.pushed
            self._begin(factor, place, t)

    def events(self, after: float) -> Iterator[float]:
        """Times at which a switch changes, or the shaft stops or continues by itself."""
        yield self.world.next_lock(after)
        if after >= self._command.end:
            return
        if not self.factor:
            turning = self._command.turning(-self._wall * self._sense, after)
            if turning is not None and self.world.stall_at is not None:
                yield turning
            return
        switch = self.world.next_switch(self.path, after, self.offset)
        if switch is not None:
            yield switch
        if self.world.stall_at is not None:
            stall = self.path.crossing(self.world.stall_at - self.offset, after, self._wall)
            if stall is not None:
                yield stall

    @property
    def _sense(self) -> float:
        return copysign(1.0, self.scale)

    def _coupling(self, place: float, t: float) -> float:
        """Motor steps that a commanded step turns at a place."""
        if not self.powered or self.world.locked(t):
            return 0.0
        stall_at = self.world.stall_at
        at_wall = stall_at is not None and (stall_at - place) * self._wall <= TOUCH
        pushing = self._command.moving(t) and self._command.direction(t) * self._sense == self._wall
        return 0.0 if at_wall and pushing else self.scale

    def _this_side(self, place: float) -> float:
        """The place, or the wall where it is beyond."""
        stall_at = self.world.stall_at
        beyond = stall_at is not None and (stall_at - place) * self._wall < 0
        return stall_at if stall_at is not None and beyond else place

    def _begin(self, factor: float, place: float, t: float) -> None:
        self.factor = factor
        self.path = self._command.scaled(factor) if factor else halt(t, 0.0)
        self.offset = place - self.path.position(t)
