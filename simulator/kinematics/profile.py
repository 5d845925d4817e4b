"""Motion in closed form: the position of a motor at any time, without ticks and without a clock.

Theory of operation. A motion is a `Profile`: a row of segments, each with its own start and formula. Position,
velocity and the time of passing a mark are formulas, and no error accumulates. A profile is made once, when a motion
begins or is changed; a change on the fly makes a new one from the position and velocity at that time.

Step motors start and stop with a jump: from rest the velocity is VI at once, and at the end it falls from
VI to 0 (VI, VM, A and D are the manual's 3.4.1 and 7.3.5). So a motion has a speed between 0 and VI only if that speed
was commanded, and a reversal is: decelerate to VI, stop, start in the other direction at VI.

Units: steps, steps/s, steps/s2, seconds; all floats. A profile ends exactly on its target. Where two segments
meet the later one counts: at its start a motion already has VI, at its end the velocity is 0.

Ramps are made in one place, `_Path._add` (how far a ramp goes is `_ramp_length`). S-curves (`segments`) last as
long and go as far as linear ramps, so only `segments` knows them. A motion that is changed during an S-curve begins
the new ramp without acceleration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import copysign, inf, nextafter, sqrt
from typing import NamedTuple

from multidrop.simulator.kinematics.segments import LINEAR, Segment, Shape, ramp

__all__ = ["Profile", "Segment", "Shape", "halt", "meeting", "move", "slew"]

LINE = Shape()
_HALVINGS = 80
_TOUCH = 1e-6
"""Steps; less than this is rounding, and causes neither overshoot nor return."""


class Profile(NamedTuple):
    """One motion from `start` to `end`; `end` and `target` are infinite for one that never ends."""

    start: float
    end: float
    origin: float
    target: float
    segments: tuple[Segment, ...] = ()

    def moving(self, t: float) -> bool:
        """Whether steps are being made."""
        return self.start <= t < self.end

    def position(self, t: float) -> float:
        """Steps; the origin before the start, exactly the target from the end on."""
        if t >= self.end:
            return self.target
        for segment in reversed(self.segments):
            if t >= segment.start:
                return segment.position_at(t)
        return self.origin

    def velocity(self, t: float) -> float:
        """Signed, steps/s; 0 before the start and from the end on."""
        segment = self._at(t)
        return 0.0 if segment is None else segment.velocity_at(t)

    def acceleration(self, t: float) -> float:
        """Signed, steps/s2; it has the velocity's sign while the motor accelerates."""
        segment = self._at(t)
        return 0.0 if segment is None else segment.acceleration_at(t)

    def changing(self, t: float) -> bool:
        """Whether it accelerates or decelerates."""
        segment = self._at(t)
        return segment is not None and segment.changing

    def scaled(self, factor: float) -> Profile:
        """Scale the motion about position 0; a negative factor reverses it."""
        segments = tuple(each.scaled(factor) for each in self.segments)
        return Profile(self.start, self.end, factor * self.origin, factor * self.target, segments)

    def direction(self, t: float) -> float:
        """The direction of the motion at a time, or of the last motion before: 1 or -1; 0 if it has not moved yet."""
        return next((segment.direction for segment in reversed(self.segments) if t >= segment.start), 0.0)

    def turning(self, direction: float, after: float) -> float | None:
        """Find the first time from `after` on at which it moves in a direction; None: never."""
        for segment in self._ahead(after):
            if segment.direction * direction > 0:
                return max(after, segment.start)
        return None

    def crossing(self, position: float, after: float, direction: float = 0.0) -> float | None:
        """Find the first time from `after` on at which it is at a position or passes it; None: never.

        With a `direction` other than 0, only passing in that direction counts.

        At that time it is there, or past it by less than rounding, and never short of it. A motion that is at the
        position at `after`, even as it leaves, gives `after`; a motor at rest there gives None.
        """
        for segment in self._ahead(after):
            if not direction or segment.direction * direction >= 0:
                found = self._crossing_in(segment, position, after)
                if found is not None:
                    return found
        return None

    def _ahead(self, after: float) -> Sequence[Segment]:
        """Return the segments that are not over; where two meet only the later one."""
        found, then = [], inf
        for segment in reversed(self.segments):
            if segment.end > after and then > after:
                found.append(segment)
            then = segment.start
        found.reverse()
        return found

    def _at(self, t: float) -> Segment | None:
        if t >= self.end:
            return None
        for segment in reversed(self.segments):
            if t >= segment.start:
                return segment
        return None

    def _crossing_in(self, segment: Segment, position: float, after: float) -> float | None:
        """Find the crossing within one segment, in which the velocity does not change its sign."""
        direction, end = segment.direction, segment.end
        begin = max(after, segment.start)
        if (position - self.position(begin)) * direction < 0:
            return None
        if end < inf and (position - self.position(end)) * direction > 0:
            return None
        return segment.when_at(position, begin, end)


class _Path:
    """A profile under construction, and its end so far. Speeds have no sign; a direction is 1 or -1."""

    __slots__ = ("down", "origin", "position", "segments", "start", "t", "up")

    def __init__(self, at: float, position: float, up: Shape, down: Shape) -> None:
        self.up, self.down = up, down
        self.start = self.t = at
        self.origin = self.position = position
        self.segments: list[Segment] = []

    def ramp(self, direction: float, speed: float, to: float, rate: float) -> None:
        """Append a ramp between two speeds above 0 in one direction."""
        if speed != to:
            duration, distance = abs(to - speed) / rate, direction * _ramp_length(speed, to, rate)
            self._add(duration, direction * speed, direction * copysign(rate, to - speed), distance)

    def ramp_until(self, target: float, speed: float, to: float) -> None:
        """Append the ramp that reaches `to` exactly at the target: the distance left determines its rate."""
        left = target - self.position
        if left and speed + to:
            direction = copysign(1.0, left)
            self._add(2 * abs(left) / (speed + to), direction * speed, (to * to - speed * speed) / (2 * left), left)
        self.position = target

    def cruise(self, direction: float, speed: float, distance: float) -> None:
        """Append a stretch of constant speed, for a distance above 0."""
        if distance > 0:
            self._add(distance / speed, direction * speed, 0.0, direction * distance)

    def stop(self) -> Profile:
        """Give the profile that ends here."""
        return Profile(self.start, self.t, self.origin, self.position, tuple(self.segments))

    def go_on(self, velocity: float) -> Profile:
        """Give the profile that never ends."""
        self.segments.append(Segment(self.t, inf, self.position, velocity, 0.0))
        return Profile(self.start, inf, self.origin, copysign(inf, velocity), tuple(self.segments))

    def _add(self, duration: float, velocity: float, acceleration: float, distance: float) -> None:
        if duration > 0:
            shape = self.up if acceleration * velocity > 0 or not velocity else self.down
            segment = Segment(self.t, duration, self.position, velocity, acceleration)
            if shape.kind == LINEAR:
                self.segments.append(segment)
            else:
                self.segments += ramp(segment, shape)
            self.t += duration
        self.position += distance


def halt(at: float, position: float) -> Profile:
    """Make the profile of a motor at rest."""
    return Profile(at, at, position, position)


def move(
    at: float,
    p0: float,
    v0: float,
    target: float,
    *,
    vi: float,
    vm: float,
    a: float,
    d: float,
    up: Shape = LINE,
    down: Shape = LINE,
) -> Profile:
    """Move to a target from any position and velocity: a trapezoid, or a triangle if it is too near for `vm`.

    A motor that moves away from the target, or is too fast to stop there, decelerates, stops and comes back; from a
    speed above `vm` it decelerates to `vm`. `vi` is at least 0, the others are above it. A `vm` below `vi` replaces
    both.
    """
    vi = min(vi, vm)
    path = _Path(at, p0, up, down)
    speed = abs(v0)
    if speed:
        direction = copysign(1.0, v0)
        ahead = (target - p0) * direction
        if ahead < 0 or _stop_length(speed, vi, d) > ahead + _TOUCH:
            if speed > vi:
                path.ramp(direction, speed, vi, d)
            speed = 0.0
    if path.position != target:
        _run(path, target, max(speed, vi), vi=vi, vm=vm, a=a, d=d)
    return path.stop()


def slew(
    at: float,
    p0: float,
    v0: float,
    velocity: float,
    *,
    vi: float,
    a: float,
    d: float,
    up: Shape = LINE,
    down: Shape = LINE,
) -> Profile:
    """Change to a signed velocity, up with `a` and down with `d`, and keep it; 0: decelerate to `vi` and stop.

    A velocity below `vi` is reached at once, after decelerating to `vi` if the motor was faster. A reversal leads
    through a stop.
    """
    path = _Path(at, p0, up, down)
    speed = abs(v0)
    direction = copysign(1.0, v0)
    if v0 * velocity <= 0:
        if speed > vi:
            path.ramp(direction, speed, vi, d)
        speed = 0.0
    if not velocity:
        return path.stop()
    direction, wanted = copysign(1.0, velocity), abs(velocity)
    speed = max(speed, min(vi, wanted))
    floor = max(vi, wanted)
    if speed > floor:
        path.ramp(direction, speed, floor, d)
    elif speed < wanted:
        path.ramp(direction, speed, wanted, a)
    return path.go_on(velocity)


def _run(path: _Path, target: float, speed: float, *, vi: float, vm: float, a: float, d: float) -> None:
    """Move to the target ahead, from a speed that is not below `vi` and not too high to stop in time."""
    left = target - path.position
    direction, distance = copysign(1.0, left), abs(left)
    if speed > vm:
        peak = vm
        rest = distance - _ramp_length(speed, vm, d)
        path.ramp(direction, speed, vm, d)
    else:
        summit = sqrt((2 * a * d * distance + d * speed * speed + a * vi * vi) / (a + d))
        peak = max(min(summit, vm), speed)
        rest = distance - _ramp_length(speed, peak, a)
        path.ramp(direction, speed, peak, a)
    if peak == vm:
        path.cruise(direction, peak, rest - _ramp_length(peak, vi, d))
    path.ramp_until(target, peak, vi)


def _ramp_length(speed: float, to: float, rate: float) -> float:
    """Steps of a ramp between two speeds."""
    return abs(to - speed) * (to + speed) / (2 * rate)


def _stop_length(speed: float, vi: float, d: float) -> float:
    """Steps from a speed to rest."""
    return _ramp_length(speed, vi, d) if speed > vi else 0.0


def meeting(one: Profile, other: Profile, shift: float, after: float) -> float | None:
    """Find the first time from `after` on at which `one` reaches `other` plus `shift`; None: never."""

    def gap(t: float) -> float:
        return one.position(t) - other.position(t) - shift

    sign = copysign(1.0, gap(after))
    for low, high in _monotonous(one, other, after):
        if gap(high) * sign <= 0:
            return _bisect(gap, sign, low, high)
    return None


def _bisect(function: Callable[[float], float], sign: float, low: float, high: float) -> float:
    """Find where a function with this sign at `low`, and not at `high`, has reached 0; never short of that."""
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) * sign > 0 else (low, middle)
    return high


def _monotonous(one: Profile, other: Profile, after: float) -> Iterator[tuple[float, float]]:
    """Yield stretches in which two profiles only part, or only approach: up to where they are equally fast."""

    def parting(t: float) -> float:
        return one.velocity(t) - other.velocity(t)

    for low, high in _stretches(one, other, after):
        sign = copysign(1.0, parting(low))
        if parting(nextafter(high, low)) * sign < 0:
            middle = _bisect(parting, sign, low, nextafter(high, low))
            yield low, middle
            yield middle, high
        else:
            yield low, high


def _stretches(one: Profile, other: Profile, after: float) -> Iterator[tuple[float, float]]:
    """Yield quarters of the stretches between the joints of two profiles; the endless last one in doublings."""
    ends = (each.end for profile in (one, other) for each in profile.segments)
    begin = after
    for joint in sorted(end for end in ends if after < end < inf):
        for n in range(4):
            yield begin + (joint - begin) * n / 4, begin + (joint - begin) * (n + 1) / 4
        begin = joint
    if one.end == inf or other.end == inf:
        for n in range(40):
            yield begin + 2.0**n - 1, begin + 2.0 ** (n + 1) - 1
