"""Joystick control of one axis (manual 7.15): an analog input commands the speed, within soft limits.

The manual's figures 7.7 and 7.8 are lines: the speed grows in proportion from the edge of the zero zone to the ends of
the joystick, and between the inner and the outer soft limit it shrinks in proportion to the distance left. The joystick
is sampled every `PERIOD`. The speed changes by at most JV3 or JV4 a sample (0: without a limit), which is a ramp of
constant acceleration between two samples.
"""

from __future__ import annotations

from math import copysign, inf

from simulator.kinematics.profile import slew
from simulator.pmx.axis import Axis
from simulator.pmx.settings import AXES
from simulator.pmx.states import Doing, Pace

PERIOD = 0.01
"""Seconds between two samples of the joystick (our choice: the manual does not give it)."""
MIDDLE = 2500
"""Millivolts at which the motor is at rest."""
SLOWEST = 1.0
"""Pulses/s; anything slower is rest."""


class Stick:
    """The joystick of one axis: the time of its next sample, and the motion that follows."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self.number = AXES.index(axis.name)
        self.due: float | None = None

    def switch(self, on: bool, t: float) -> None:
        """Begin or end sampling."""
        self.due = t if on else None

    def wanted(self, millivolts: int, t: float) -> float:
        """The speed that the joystick commands here, pulses/s, signed."""
        settings, n = self._axis.settings, self.number
        fastest, zone = settings[f"JV{1 + n}"], settings[f"JV{5 + n}"]
        out = abs(millivolts - MIDDLE) - zone
        if out <= 0:
            return 0.0
        direction = copysign(1.0, millivolts - MIDDLE)
        return direction * fastest * min(out / (MIDDLE - zone), 1.0) * self._room(direction, t)

    def steer(self, millivolts: int, t: float) -> None:
        """Sample the joystick, and move at the commanded speed."""
        axis = self._axis
        self.due = t + PERIOD
        if axis.homing or axis.trouble or (axis.pulses.moving(t) and axis.doing is not Doing.STICK):
            return
        now = axis.pulses.profile.velocity(t)
        change = self.wanted(millivolts, t) - now
        most = axis.settings[f"JV{3 + self.number}"] or abs(change)
        speed = now + copysign(min(abs(change), most), change)
        if now * speed < 0 or abs(speed) < SLOWEST:
            speed = 0.0
        if speed or now:
            rate = max(abs(speed - now), SLOWEST) / PERIOD
            path = slew(t, axis.pulses.place(t), now, speed, vi=0.0, a=rate, d=rate)
            axis.start(Doing.STICK, path, t, Pace(0.0, abs(speed), rate, max(rate, abs(speed) / PERIOD)))

    def fence(self, after: float) -> float:
        """The time at which the outer soft limit ahead is met; infinite: never."""
        path = self._axis.pulses.profile
        if self.due is None or not path.moving(after):
            return inf
        direction = path.direction(after)
        place = self.edge(direction) - self._axis.pulses.counter(after) + path.position(after)
        found = path.crossing(place, after, direction)
        return inf if found is None else found

    def edge(self, direction: float) -> float:
        """The outer soft limit in a direction, as a count of the counter."""
        return self._axis.settings[f"JL{self.number * 4 + (4 if direction > 0 else 1)}"]

    def _room(self, direction: float, t: float) -> float:
        """The fraction of the speed that the soft limits allow."""
        first = self.number * 4
        outer = self.edge(direction)
        inner = self._axis.settings[f"JL{first + (3 if direction > 0 else 2)}"]
        place = self._axis.pulses.counter(t)
        left = (outer - place) * direction
        if left <= 0:
            return 0.0
        if (place - inner) * direction <= 0:
            return 1.0
        return left / max((outer - inner) * direction, left)
