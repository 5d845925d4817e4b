"""The commands that begin and change motions of a PMX: moves, lines, jogs, homing, the joystick, changes on the fly."""

from __future__ import annotations

from math import copysign, hypot, inf

from multidrop.families.pmx.simulator.axis import PmxAxis
from multidrop.families.pmx.simulator.pulses import Doing, paced, planned
from multidrop.families.pmx.simulator.settings import AXES, WINDOWS, PmxRefusal, PmxSettings
from multidrop.simulator.kinematics import MotionPace, Profile, halt, slew

JOYSTICK_PERIOD = 0.01
"""Seconds between two samples of the joystick (our choice: the manual does not give it)."""
MIDDLE = 2500
"""Millivolts at which the motor is at rest."""
SLOWEST_SPEED = 1.0
"""Pulses/s; anything slower is rest."""


def check(axis: PmxAxis, t: float) -> None:
    """Refuse a motion that may not begin."""
    if axis.pulses.profile.moving(t) or axis.homing:
        raise PmxRefusal("?Moving")
    if axis.loop.error:
        raise PmxRefusal("?Clear SNL Error")
    if axis.trouble:
        raise PmxRefusal("?Clear SNL Error" if axis.loop.on else "")


def aim(axis: PmxAxis, target: float, t: float) -> float:
    """Give the place of a target of the counter, pulses from power-up."""
    if axis.loop.on:
        here = axis.pulses.profile.position(t)
        return axis.pulses.whole(here + (target - axis.loop.target(t)) * axis.loop.ratio)
    return axis.pulses.place_of(target, t)


def go(axis: PmxAxis, target: int, t: float) -> None:
    """`X1000`: move to a position of the counter (counts with StepNLoop)."""
    check(axis, t)
    pace = axis.own_pace()
    axis.loop.attempts, axis.goal = 0, target
    axis.start(Doing.MOVE, axis.pulses.to_place(aim(axis, target, t), t, pace), t, pace)


def jog(axis: PmxAxis, direction: float, t: float) -> None:
    """`JX+`: turn until a stop."""
    check(axis, t)
    pace = axis.own_pace()
    axis.loop.attempts = 0
    axis.start(Doing.JOG, axis.pulses.to_speed(direction * pace.vm, t, pace), t, pace)


def home(axis: PmxAxis, word: str, direction: float, t: float) -> None:
    """`HX+`, `LX+`, ...: begin one of the homing routines (7.10)."""
    check(axis, t)
    pace = axis.own_pace()
    axis.loop.attempts = 0
    axis.home(word, direction, pace, t)


def retarget(axis: PmxAxis, target: int, t: float) -> None:
    """`TX`: change the target on the fly, for a move of this axis alone."""
    pulses = axis.pulses
    if pulses.doing is not Doing.MOVE or not pulses.profile.moving(t):
        raise PmxRefusal("?ABS/INC is not in operation")
    axis.goal = target
    profile = pulses.to_place_on_the_fly(aim(axis, target, t), t, pulses.pace)
    axis.start(Doing.MOVE, profile, t, pulses.pace)


def respeed(axis: PmxAxis, speed: int, t: float) -> None:
    """`SSPDX=`: change the speed on the fly, for a move or a jog; at rest only the value is checked."""
    pulses, wanted = axis.pulses, speed * axis.unit
    if pulses.doing is Doing.LINE:
        raise PmxRefusal("?ICommandOn")
    if axis["SCV"]:
        raise PmxRefusal("?S-curve on")
    mode = axis["SSPDM"]
    if not mode:
        raise PmxRefusal("?SSPD Mode not Initialized")
    limits = WINDOWS[mode - 1]
    if not max(limits.low, 1) <= wanted <= limits.high:
        raise PmxRefusal("?Speed out of range")
    if not pulses.profile.moving(t) or pulses.doing not in (Doing.MOVE, Doing.JOG):
        return
    pace = pulses.pace._replace(vm=wanted, vi=min(pulses.pace.vi, wanted))
    if pulses.doing is Doing.JOG:
        axis.start(Doing.JOG, pulses.to_speed(pulses.profile.direction(t) * wanted, t, pace), t, pace)
    else:
        axis.start(Doing.MOVE, pulses.to_place_on_the_fly(pulses.profile.target, t, pace), t, pace)


class Stick:
    """The joystick of one axis (manual 7.15): an analog input commands the speed, within soft limits.

    The manual's figures 7.7 and 7.8 are lines: the speed grows in proportion from the edge of the zero zone to the ends
    of the joystick, and between the inner and the outer soft limit it shrinks in proportion to the distance left. The
    joystick is sampled every `JOYSTICK_PERIOD`. The speed changes by at most JV3 or JV4 a sample (0: without a limit),
    which is a ramp of constant acceleration between two samples. `due` is the time of the next sample; None: it is off.
    """

    def __init__(self, axis: PmxAxis) -> None:
        self._axis = axis
        self.number = AXES.index(axis.name)
        self.due: float | None = None

    def switch(self, on: bool, t: float) -> None:
        self.due = t if on else None

    def wanted(self, millivolts: int, t: float) -> float:
        """The speed that the joystick commands here, pulses/s, signed."""
        settings, n = self._axis.settings, self.number
        fastest, zone = settings[f"JV{1 + n}"], settings[f"JV{5 + n}"]
        out = abs(millivolts - MIDDLE) - zone
        if out <= 0:
            return 0.0
        direction = copysign(1.0, millivolts - MIDDLE)
        outer, inner = self.edge(direction), settings[f"JL{n * 4 + (3 if direction > 0 else 2)}"]
        place = self._axis.pulses.counter(t)
        left = (outer - place) * direction
        if left <= 0:
            return 0.0
        room = 1.0 if (place - inner) * direction <= 0 else left / max((outer - inner) * direction, left)
        return direction * fastest * min(out / (MIDDLE - zone), 1.0) * room

    def steer(self, millivolts: int, t: float) -> None:
        """Sample the joystick, and move at the commanded speed."""
        axis, profile = self._axis, self._axis.pulses.profile
        self.due = t + JOYSTICK_PERIOD
        if axis.homing or axis.trouble or (profile.moving(t) and axis.pulses.doing is not Doing.STICK):
            return
        now = profile.velocity(t)
        change = self.wanted(millivolts, t) - now
        most = axis.settings[f"JV{3 + self.number}"] or abs(change)
        speed = now + copysign(min(abs(change), most), change)
        if now * speed < 0 or abs(speed) < SLOWEST_SPEED:
            speed = 0.0
        if speed or now:
            rate = max(abs(speed - now), SLOWEST_SPEED) / JOYSTICK_PERIOD
            path = slew(t, profile.position(t), now, speed, MotionPace(0.0, abs(speed), rate, rate))
            axis.start(Doing.STICK, path, t, MotionPace(0.0, abs(speed), rate, max(rate, abs(speed) / JOYSTICK_PERIOD)))

    def fence(self, after: float) -> float:
        """The time at which the outer soft limit ahead is met; infinite: never."""
        path = self._axis.pulses.profile
        if self.due is None or not path.moving(after):
            return inf
        direction = path.direction(after)
        place = self.edge(direction) - self._axis.pulses.counter(after) + path.position(after)
        return path.crossing(place, after, direction)

    def edge(self, direction: float) -> float:
        """The outer soft limit in a direction, as a count of the counter."""
        return self._axis.settings[f"JL{self.number * 4 + (4 if direction > 0 else 1)}"]


class StraightMove:
    """A straight line of both axes (manual 7.8.2): one motion along the path, of which each axis makes its share.

    The global speeds are those along the path (the manual leaves that open), in pulses/s with StepNLoop too (7.17).
    What ends the line for one axis ends it for the other. Raises PmxRefusal for a line that cannot begin.
    """

    def __init__(self, axes: tuple[PmxAxis, PmxAxis], settings: PmxSettings) -> None:
        self._axes = axes
        self._settings = settings
        self._members: tuple[PmxAxis, ...] = ()

    def begin(self, targets: tuple[int, int], t: float) -> None:
        axes, settings = self._axes, self._settings
        for axis in axes:
            check(axis, t)
        speeds, times = (settings["LSPD"], settings["HSPD"]), (settings["ACC"], settings["DEC"])
        pace = paced(settings, axes[0].name, speeds, times)
        pairs = zip(axes, targets, strict=True)
        shares = [aim(axis, target, t) - axis.pulses.profile.position(t) for axis, target in pairs]
        length = hypot(*shares)
        whole = planned(t, 0.0, length, pace)
        self._members = tuple(axis for axis, share in zip(axes, shares, strict=True) if share)
        for axis, target, share in zip(axes, targets, shares, strict=True):
            axis.loop.attempts, axis.goal = 0, target
            part = _part(whole, axis.pulses.profile.position(t), share, length)
            factor = abs(share) / length if length else 0.0
            vi, vm, a, d = (speed * factor for speed in pace[:4])
            axis.pulses.begin(Doing.LINE, part, t, MotionPace(vi, vm, a, d, pace.up, pace.down))
        for axis in axes:
            axis.live(t)
        self.watch(t)

    def others(self, axis: PmxAxis) -> tuple[PmxAxis, ...]:
        """The axes that stop with this one: all axes of a line, or only this one."""
        return self._members if axis in self._members and axis.pulses.doing is Doing.LINE else (axis,)

    def watch(self, t: float) -> None:
        """Stop the other axis if one was ended before its time."""
        left = [axis for axis in self._members if axis.pulses.doing is Doing.LINE]
        if len(left) < len(self._members):
            for axis in left:
                axis.abort(t)
            self._members = ()


def _part(whole: Profile, here: float, share: float, length: float) -> Profile:
    """The share of one axis: the whole path, scaled, from where the axis is."""
    if not share:
        return halt(whole.start, here)
    part = whole.scaled(share / length)
    segments = tuple(segment._replace(position=segment.position + here) for segment in part.segments)
    return Profile(part.start, part.end, here, here + share, segments)
