"""The torque of a step motor: what a motion asks of it, when that is more than there is, and how far the rotor lags.

A motor has a curve of torque by speed at full current; the current scales it. A turn takes `load` (a part of the torque
at rest and full current, against every turn), `friction` for each rev/s and `inertia`, that of the rotor included, for
the acceleration. Along a segment of constant acceleration all of these are straight lines between the rows of the
curve, so the time at which a motion asks for too much is a formula; an S-curve is divided into `CURVE_PARTS`. The jump
to the initial velocity asks for nothing. A rotor that turns lags its field by an angle whose sine is the part of the
torque that it needs: a full step at most, with all of it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import asin, inf, pi
from types import MappingProxyType

from multidrop.simulator.cell.spec import MotorSpec, WorldSpec
from multidrop.simulator.kinematics import Profile, Segment

MOTORS: Mapping[str, MotorSpec] = MappingProxyType(
    {
        "nema17": MotorSpec(((0, 0.45), (2, 0.44), (5, 0.38), (10, 0.27), (20, 0.13), (40, 0.04), (60, 0.0)), 5.4e-6),
        "nema23": MotorSpec(((0, 1.2), (2, 1.15), (5, 0.95), (10, 0.65), (20, 0.3), (40, 0.09), (60, 0.0)), 3.0e-5),
        "nema34": MotorSpec(((0, 4.5), (2, 4.1), (5, 3.2), (10, 1.9), (20, 0.8), (40, 0.2), (60, 0.0)), 1.9e-4),
    }
)
"""Figures of our own for a common motor of each size on 48 V; none is measured."""
FULL_STEPS = 200
CURVE_PARTS = 16
TOLERANCE = 1e-9
"""Seconds, and parts of a torque or a speed, that are rounding."""


class Torque:
    """The torque of one shaft. Profiles have `turn` steps a turn; `share` is the current, of the full one."""

    def __init__(self, spec: WorldSpec) -> None:
        self._spec = spec
        self._curve, rotor = spec.motor or MotorSpec(())
        self.limited = bool(self._curve)
        """There is a motor; without one there is any torque."""
        self._holding = self._curve[0][1] if self._curve else 0.0
        self._inertia = spec.inertia + rotor

    def available(self, speed: float) -> float:
        """The torque at full current and a speed, rev/s; none beyond the last row."""
        curve = self._curve
        n = bisect_right(curve, speed, key=lambda row: row[0])
        if n == len(curve):
            return curve[-1][1] if speed <= curve[-1][0] * (1 + TOLERANCE) else 0.0
        (low, least), (high, most) = curve[n - 1], curve[n]
        return least + (most - least) * (speed - low) / (high - low)

    def needed(self, speed: float, acceleration: float) -> float:
        """The torque along the turn that a speed and an acceleration along it take, rev/s and rev/s2."""
        spec = self._spec
        return spec.load * self._holding + spec.friction * speed + 2 * pi * self._inertia * acceleration

    def starts(self, share: float) -> bool:
        """Whether the load lets a rotor at rest begin to turn."""
        return not self.limited or self.needed(0.0, 0.0) <= share * self._holding

    def fails_at(self, profile: Profile, after: float, share: float, turn: float) -> float:
        """Find the first time from `after` on at which a motion asks for more than there is; infinite: never."""
        if not self.limited or profile.end <= after:
            return inf
        for segment in profile.ahead(after):
            rows = self._balance(segment, max(after, segment.start), share, turn)
            times = [t for t, there, needed in rows[:1] if abs(needed) > there * (1 + TOLERANCE)]
            for (low, first, was), (high, last, needed) in pairwise(rows):
                for sign in (1, -1):  # driving and braking
                    before, behind = first - sign * was, last - sign * needed
                    if behind < -TOLERANCE * last:
                        times.append(low if before <= 0 else low + (high - low) * before / (before - behind))
            if times:
                return min(times)
        return inf

    def used(self, profile: Profile, t: float, share: float, turn: float) -> float:
        """The part of the torque that a motion needs at a time, with the sign of its direction; 0 at rest."""
        if not self.limited or not profile.moving(t):
            return 0.0
        direction = profile.direction(t)
        speed, rate = profile.velocity(t) * direction / turn, profile.acceleration(t) * direction / turn
        there = share * self.available(speed)
        return direction * max(-1.0, min(1.0, self.needed(speed, rate) / there)) if there else direction

    def most_used(self, profile: Profile, share: float, turn: float) -> float:
        """The largest part of the torque that a motion needs; infinite where there is none."""
        rows = [row for segment in profile.segments for row in self._balance(segment, segment.start, share, turn)]
        return max((abs(needed) / there if there else inf for _, there, needed in rows), default=0.0)

    def lag(self, profile: Profile, t: float, share: float, turn: float) -> float:
        """The steps by which the rotor lags its field."""
        return asin(self.used(profile, t, share, turn)) * 2 / pi * turn / FULL_STEPS

    def _balance(self, segment: Segment, begin: float, share: float, turn: float) -> list[tuple[float, float, float]]:
        """The available and the needed torque at times between which both are straight lines."""
        rows = []
        for t in sorted(self._joints(segment, begin, turn)):
            speed = max(0.0, segment.velocity_at(t) * segment.direction / turn)
            rate = segment.acceleration_at(t) * segment.direction / turn
            rows.append((t, share * self.available(speed), self.needed(speed, rate)))
        return rows

    def _joints(self, segment: Segment, begin: float, turn: float) -> Iterator[float]:
        yield begin
        if segment.end == inf or segment.end <= begin:
            return
        yield segment.end
        if segment.gain:
            yield from (begin + (segment.end - begin) * n / CURVE_PARTS for n in range(1, CURVE_PARTS))
        elif segment.acceleration:
            for speed, _ in self._curve:
                t = segment.start + (speed * turn * segment.direction - segment.velocity) / segment.acceleration
                if begin < t < segment.end:
                    yield t
