"""One stretch of a motion: velocity and position as formulas of time, for constant and for changing acceleration.

The acceleration of a stretch goes from one value to another: not at all (it is constant), in proportion to time, or
along half a cosine. A ramp of a motion is one stretch of constant acceleration, or an S-curve of three: the
acceleration rises, stays, falls (AT, DT, AJ and DJ; manual 5.1.3, 5.1.7).

The law of the S-curves, which the manual draws and does not write down: a ramp lasts (V - VI) / A whatever its shape,
so A is its mean acceleration and it covers the same distance as a linear one. Of its 256 samples the 2n in the middle
(n: AJ, DJ) have one constant acceleration, and those before and after rise from 0 and fall to 0, straight or as a
raised cosine. Hence the plateau is 2A / (1 + n/128): twice A without a plateau, A itself for a ramp that is all
plateau.

Units: steps, steps/s, steps/s2, seconds.
"""

from __future__ import annotations

from math import cos, inf, nextafter, pi, sin, sqrt
from typing import NamedTuple

LINEAR, TRIANGLE, SINUSOIDAL = 1, 2, 3
"""Kinds of ramp, as AT and DT number them."""
SAMPLES = 256
_HALVINGS = 80


class Shape(NamedTuple):
    """The course of a ramp's acceleration: its kind, and n of AJ or DJ."""

    kind: int = LINEAR
    plateau: int = 0

    @property
    def flat(self) -> float:
        """The part of the ramp's time in which the acceleration is constant, 0 to 1."""
        return 1.0 if self.kind == LINEAR else 2 * self.plateau / SAMPLES

    @property
    def peak(self) -> float:
        """The greatest acceleration, in units of the mean one."""
        return 2 / (1 + self.flat)


class Segment(NamedTuple):
    """A stretch in which the velocity does not change its sign. All values are signed; the duration may be infinite.

    `gain` is the change of the acceleration until the end, along a line or (`kind` SINUSOIDAL) half a cosine.
    """

    start: float
    duration: float
    position: float
    velocity: float
    acceleration: float
    gain: float = 0.0
    kind: int = LINEAR

    @property
    def end(self) -> float:
        """The time of its end."""
        return self.start + self.duration

    @property
    def direction(self) -> float:
        """1 or -1; 0 at rest."""
        lead = self.velocity or self.acceleration or self.gain
        return 1.0 if lead > 0 else -1.0 if lead < 0 else 0.0

    @property
    def changing(self) -> bool:
        """Whether the velocity changes in it."""
        return bool(self.acceleration or self.gain)

    def position_at(self, t: float) -> float:
        """The position at a time of the profile; the caller ensures that the time lies in the segment."""
        dt = t - self.start
        place = self.position + dt * (self.velocity + 0.5 * self.acceleration * dt)
        if not self.gain:
            return place
        x, square = dt / self.duration, self.gain * self.duration**2
        return place + square * (x**3 / 6 if self.kind != SINUSOIDAL else x * x / 4 + (cos(pi * x) - 1) / (2 * pi * pi))

    def velocity_at(self, t: float) -> float:
        """The velocity at such a time."""
        dt = t - self.start
        velocity = self.velocity + self.acceleration * dt
        if not self.gain:
            return velocity
        x, whole = dt / self.duration, self.gain * self.duration
        return velocity + whole * (x * x / 2 if self.kind != SINUSOIDAL else x / 2 - sin(pi * x) / (2 * pi))

    def acceleration_at(self, t: float) -> float:
        """The acceleration at such a time."""
        if not self.gain:
            return self.acceleration
        x = (t - self.start) / self.duration
        return self.acceleration + self.gain * (x if self.kind != SINUSOIDAL else (1 - cos(pi * x)) / 2)

    def scaled(self, factor: float) -> Segment:
        """Scale the stretch about position 0; a negative factor reverses it."""
        return self._replace(
            position=factor * self.position,
            velocity=factor * self.velocity,
            acceleration=factor * self.acceleration,
            gain=factor * self.gain,
        )

    def when_at(self, place: float, begin: float, until: float) -> float:
        """Find the time, between two, at which it reaches a place that it passes between them."""
        direction = self.direction
        ahead = (place - self.position) * direction
        if self.gain:
            low, high = begin, until
            for _ in range(_HALVINGS):
                middle = (low + high) / 2
                low, high = (middle, high) if (place - self.position_at(middle)) * direction > 0 else (low, middle)
            return high
        root = self.velocity**2 + 2 * self.acceleration * direction * ahead
        pace = abs(self.velocity) + sqrt(max(root, 0.0))
        t = min(max(begin, self.start + (2 * ahead / pace if pace else 0.0)), until)
        jump = nextafter(t, inf) - t
        while t < until and (place - self.position_at(t)) * direction > 0:
            t, jump = min(t + jump, until), 2 * jump
        return t


def ramp(segment: Segment, shape: Shape) -> list[Segment]:
    """Shape a stretch of constant acceleration as a ramp of equal duration, distance and velocities."""
    if shape.kind == LINEAR or not segment.acceleration:
        return [segment]
    peak = segment.acceleration * shape.peak
    edge = segment.duration * (1 - shape.flat) / 2
    kind = shape.kind
    rise = Segment(segment.start, edge, segment.position, segment.velocity, 0.0, peak, kind)
    flat = Segment(rise.end, segment.duration - 2 * edge, rise.position_at(rise.end), rise.velocity_at(rise.end), peak)
    begin = segment.end - edge
    fall = Segment(begin, edge, flat.position_at(begin), flat.velocity_at(begin), peak, -peak, kind)
    return [rise, fall] if not shape.plateau else [rise, flat, fall]
