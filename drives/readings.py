"""What was read of a drive's motion and programs, and what several readings show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from multidrop.dialects import Motion

LEAST_REST = 0.05
"""The least time between two readings that show a drive at rest, s."""
RECENT = 1.0
"""The longest time between two readings that are compared where nothing else is known of the time between, s."""


@dataclass(frozen=True)
class MotionReading:
    """The last reading of a drive's motion."""

    at: float
    """When it was requested, s of the link's clock."""
    velocity: int
    """Velocity of the fastest axis, signed, per second; where it reads 0 on the way, as the positions show it."""
    velocities: tuple[int, ...] = ()
    """That of each axis."""
    transmitted_at: float = float("-inf")
    """When its last request had left."""
    confirms: float = float("-inf")
    """When the latest reading was requested that shows the same rest, and at least LEAST_REST earlier; -inf: none
    does.
    """

    def at_rest(self, since: float | None = None) -> bool:
        """Whether two readings after `since`, LEAST_REST apart, show it at rest; by default two recent ones."""
        return self.confirms > (self.at - RECENT if since is None else since)


class Judged:
    """The readings of a drive's motion, each judged by those before it."""

    def __init__(self) -> None:
        self.still: list[float] = []
        """When the last readings in a row were requested that show it at rest in one place."""
        self._last = (float("-inf"), tuple[int, ...]())

    def reading(self, at: float, transmitted_at: float, axes: Sequence[Motion], in_place: bool) -> MotionReading:
        """Judge a reading. `in_place`: at rest the position must stay, too."""
        (before, places), here = self._last, tuple(axis.position for axis in axes)
        self._last = at, here
        velocities = [axis.velocity for axis in axes]
        displaced = in_place and here != places
        if displaced and len(here) == len(places) and 0 < at - before < RECENT:
            for number, way in enumerate(after - earlier for earlier, after in zip(places, here, strict=True)):
                if way and not velocities[number]:
                    velocities[number] = round(way / (at - before))  # at least 1: RECENT is a second
        velocity = max(velocities, key=abs)
        if velocity or displaced:
            self.still.clear()
        earlier = [rest for rest in self.still if rest <= at - LEAST_REST]
        if not velocity:
            self.still = [*earlier[-1:], *self.still[len(earlier) :], at]
        return MotionReading(at, velocity, tuple(velocities), transmitted_at, earlier[-1] if earlier else float("-inf"))


@dataclass(frozen=True)
class ProgramReading:
    """The last reading of a drive's programs."""

    at: float
    """When it was requested, s of the link's clock."""
    runs: bool
    """Whether one runs, which can move the drive again."""
