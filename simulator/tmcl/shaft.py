"""The shaft behind a simulated TMCL motor: what the microsteps turn, and what it runs into.

Theory of operation. The motor commands microsteps (a `Profile`); the shaft follows in proportion, or stands: without
current, at a wall, or held fast. Steps that it misses are lost, as nothing measures it. Each stretch is the command's
own profile in another scale, so walls and switches are found by formulas. Positions are the world's motor steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import copysign

from simulator.kinematics.profile import Profile, halt
from simulator.world import World

TOUCH = 1e-6
"""Steps; less than this is rounding."""


class Shaft:
    """One shaft. The motor reports every new profile with `follow` and calls `settle` at events."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.powered = False
        self._scale = 1.0
        self._command = self._path = halt(0.0, 0.0)
        self._factor = self._offset = 0.0
        self._pushed = world.pushed
        self._wall = 0.0 if world.stall_at is None else copysign(1.0, world.stall_at)

    def position(self, t: float) -> float:
        """Physical motor steps."""
        return self._path.position(t) + self._offset

    def switches(self, t: float) -> tuple[bool, bool, bool]:
        """Home, right, left: which switches are closed."""
        return self.world.switches(self.position(t))

    def follow(self, command: Profile, scale: float, t: float) -> None:
        """Follow another profile from now on; `scale` is the motor steps of one microstep."""
        place = self.position(t)
        self._command, self._scale = command, scale
        self._begin(self._coupling(place, t), place, t)

    def settle(self, t: float) -> None:
        """Take in what has changed at this time: pushes, walls, locks, current."""
        place = self._this_side(self.position(t) + self.world.pushed - self._pushed)
        factor = self._coupling(place, t)
        if factor != self._factor or self.world.pushed != self._pushed:
            self._pushed = self.world.pushed
            self._begin(factor, place, t)

    def events(self, after: float) -> Iterator[float]:
        """Times at which a switch changes, or the shaft stops or goes on by itself."""
        yield self.world.next_lock(after)
        if not self._command.moving(after):
            return
        if not self._factor:
            turning = self._command.turning(-self._wall, after)
            if turning is not None:
                yield turning
            return
        switch = self.world.next_switch(self._path, after, self._offset)
        if switch is not None:
            yield switch
        if self.world.stall_at is not None:
            stall = self._path.crossing(self.world.stall_at - self._offset, after, self._wall)
            if stall is not None:
                yield stall

    def _coupling(self, place: float, t: float) -> float:
        """Motor steps that a microstep turns now; 0 while the shaft stands."""
        if not self.powered or self.world.locked(t):
            return 0.0
        stall_at = self.world.stall_at
        at_wall = stall_at is not None and (stall_at - place) * self._wall <= TOUCH
        pushing = self._command.moving(t) and self._command.direction(t) == self._wall
        return 0.0 if at_wall and pushing else self._scale

    def _this_side(self, place: float) -> float:
        """The place, or the wall where it is beyond."""
        stall_at = self.world.stall_at
        beyond = stall_at is not None and (stall_at - place) * self._wall < 0
        return stall_at if stall_at is not None and beyond else place

    def _begin(self, factor: float, place: float, t: float) -> None:
        self._factor = factor
        self._path = self._command.scaled(factor) if factor else halt(t, 0.0)
        self._offset = place - self._path.position(t)
