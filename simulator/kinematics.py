"""Motion in closed form: the position of a motor at any time, without ticks and without a clock.

A motion is a `Profile`: a row of segments, each with its own start and formula. Position, velocity and the time of
passing a mark are formulas, and no error accumulates. A profile is made once, when a motion begins or is changed; a
change on the fly makes a new one from the position and velocity at that time.

Step motors start and stop with a jump: from rest the velocity is VI at once, and at the end it falls from
VI to 0 (VI, VM, A and D are the manual's 3.4.1 and 7.3.5). So a motion has a speed between 0 and VI only if that speed
was commanded, and a reversal is: decelerate to VI, stop, start in the other direction at VI.

The acceleration of a segment is constant, or changes in proportion to time, or along half a cosine. A ramp is one
segment of constant acceleration, or an S-curve of three: the acceleration rises, stays, falls (AT, DT, AJ and DJ;
manual 5.1.3, 5.1.7). The law of the S-curves, which the manual draws and does not write down: a ramp lasts (V - VI) / A
whatever its shape, so A is its mean acceleration and it covers the same distance as a linear one. Of its 256 samples
the 2n in the middle (n: AJ, DJ) have one constant acceleration, and those before and after rise from 0 and fall to 0,
straight or as a raised cosine. Hence the plateau is 2A / (1 + n/128): twice A without a plateau, A itself for a ramp
that is all plateau. Ramps are made in one place, `_Path._add`; a motion that is changed during an
S-curve begins the new ramp without acceleration.

Units: steps, steps/s, steps/s2, seconds; all floats. A profile ends exactly on its target. Where two segments
meet the later one counts: at its start a motion already has VI, at its end the velocity is 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import copysign, cos, inf, nextafter, pi, sin, sqrt
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
        return self.start + self.duration

    @property
    def direction(self) -> float:
        """1 or -1; 0 at rest."""
        lead = self.velocity or self.acceleration or self.gain
        return 1.0 if lead > 0 else -1.0 if lead < 0 else 0.0

    @property
    def changing(self) -> bool:
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
        dt = t - self.start
        velocity = self.velocity + self.acceleration * dt
        if not self.gain:
            return velocity
        x, whole = dt / self.duration, self.gain * self.duration
        return velocity + whole * (x * x / 2 if self.kind != SINUSOIDAL else x / 2 - sin(pi * x) / (2 * pi))

    def acceleration_at(self, t: float) -> float:
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
            return _bisect(lambda t: place - self.position_at(t), direction, begin, until)
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


LINE = Shape()


class MotionPace(NamedTuple):
    """How a motion changes its speed: initial and highest speed, the rates up and down, the shapes of both ramps."""

    vi: float
    vm: float
    a: float
    d: float
    up: Shape = LINE
    down: Shape = LINE


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
        segment = self._at(t)
        return segment is not None and segment.changing

    def scaled(self, factor: float) -> Profile:
        """Scale the motion about position 0; a negative factor reverses it."""
        segments = tuple(segment.scaled(factor) for segment in self.segments)
        return Profile(self.start, self.end, factor * self.origin, factor * self.target, segments)

    def direction(self, t: float) -> float:
        """The direction of the motion at a time, or of the last motion before: 1 or -1; 0 if it has not moved yet."""
        return next((segment.direction for segment in reversed(self.segments) if t >= segment.start), 0.0)

    def turning(self, direction: float, after: float) -> float:
        """Find the first time from `after` on at which it moves in a direction; infinite: never."""
        for segment in self.ahead(after):
            if segment.direction * direction > 0:
                return max(after, segment.start)
        return inf

    def crossing(self, position: float, after: float, direction: float = 0.0) -> float:
        """Find the first time from `after` on at which it is at a position or passes it; infinite: never.

        With a `direction` other than 0, only passing in that direction counts.

        At that time it is there, or past it by less than rounding, and never short of it. A motion that is at the
        position at `after`, even as it leaves, gives `after`; a motor at rest there never is.
        """
        for segment in self.ahead(after):
            way, begin, end = segment.direction, max(after, segment.start), segment.end
            if (direction and way * direction < 0) or (position - segment.position_at(begin)) * way < 0:
                continue
            if end == inf or (position - self.position(end)) * way <= 0:
                return segment.when_at(position, begin, end)
        return inf

    def ahead(self, after: float) -> Sequence[Segment]:
        """Return the segments that are not over; where two meet only the later one."""
        segments, then = [], inf
        for segment in reversed(self.segments):
            if segment.end > after and then > after:
                segments.append(segment)
            then = segment.start
        segments.reverse()
        return segments

    def _at(self, t: float) -> Segment | None:
        if t >= self.end:
            return None
        for segment in reversed(self.segments):
            if t >= segment.start:
                return segment
        return None


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
        return Profile(self.start, self.t, self.origin, self.position, tuple(self.segments))

    def go_on(self, velocity: float) -> Profile:
        """Give the profile that never ends."""
        self.segments.append(Segment(self.t, inf, self.position, velocity, 0.0))
        return Profile(self.start, inf, self.origin, copysign(inf, velocity), tuple(self.segments))

    def _add(self, duration: float, velocity: float, acceleration: float, distance: float) -> None:
        if duration > 0:
            shape = self.up if acceleration * velocity > 0 or not velocity else self.down
            self.segments += ramp(Segment(self.t, duration, self.position, velocity, acceleration), shape)
            self.t += duration
        self.position += distance


def halt(at: float, position: float) -> Profile:
    return Profile(at, at, position, position)


def move(at: float, p0: float, v0: float, target: float, pace: MotionPace) -> Profile:
    """Move to a target from any position and velocity: a trapezoid, or a triangle if it is too near for `vm`.

    A motor that moves away from the target, or is too fast to stop there, decelerates, stops and comes back; from a
    speed above `vm` it decelerates to `vm`. `vi` is at least 0, the others are above it. A `vm` below `vi` replaces
    both.
    """
    vm, a, d = pace.vm, pace.a, pace.d
    vi = min(pace.vi, vm)
    path = _Path(at, p0, pace.up, pace.down)
    speed = abs(v0)
    if speed:
        direction = copysign(1.0, v0)
        ahead = (target - p0) * direction
        if ahead < 0 or _ramp_length(max(speed, vi), vi, d) > ahead + _TOUCH:
            if speed > vi:
                path.ramp(direction, speed, vi, d)
            speed = 0.0
    left, speed = target - path.position, max(speed, vi)
    direction, distance = copysign(1.0, left), abs(left)
    if not left:
        return path.stop()
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
    return path.stop()


def slew(at: float, p0: float, v0: float, velocity: float, pace: MotionPace) -> Profile:
    """Change to a signed velocity, up with `a` and down with `d`, and keep it; 0: decelerate to `vi` and stop.

    A velocity below `vi` is reached at once, after decelerating to `vi` if the motor was faster. A reversal leads
    through a stop.
    """
    vi, a, d = pace.vi, pace.a, pace.d
    path = _Path(at, p0, pace.up, pace.down)
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


def _ramp_length(speed: float, to: float, rate: float) -> float:
    """Steps of a ramp between two speeds."""
    return abs(to - speed) * (to + speed) / (2 * rate)


def meeting(one: Profile, other: Profile, shift: float, after: float) -> float:
    """Find the first time from `after` on at which `one` reaches `other` plus `shift`; infinite: never."""

    def gap(t: float) -> float:
        return one.position(t) - other.position(t) - shift

    sign = copysign(1.0, gap(after))
    for low, high in _monotonous(one, other, after):
        if gap(high) * sign <= 0:
            return _bisect(gap, sign, low, high)
    return inf


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
    ends = (segment.end for profile in (one, other) for segment in profile.segments)
    begin = after
    for joint in sorted(end for end in ends if after < end < inf):
        for n in range(4):
            yield begin + (joint - begin) * n / 4, begin + (joint - begin) * (n + 1) / 4
        begin = joint
    if one.end == inf or other.end == inf:
        for n in range(40):
            yield begin + 2.0**n - 1, begin + 2.0 ** (n + 1) - 1


@dataclass(frozen=True)
class Effort:
    """The motion that an axis commands, and what its reports tell of the torque that it takes."""

    profile: Profile
    turn: float
    """Steps of the profile in a turn."""
    count: float = 1.0
    """Steps of the profile in a count of the reported position."""
    current: float = 1.0
    """Of the full one."""
    measured: bool = False
    """The reported position is that of an encoder."""
    lag: str = ""
    """The word that reads how far the rotor lags, in steps of the profile; empty: none."""
    stalls: bool = False
    """A stall ends the motion."""
