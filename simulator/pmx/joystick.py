"""Joystick control of one axis (manual 7.15): an analog input commands the speed, within soft limits.

The manual's figures 7.7 and 7.8 are lines: the speed grows in proportion from the edge of the zero zone to the ends of
the stick's way, and between the inner and the outer soft limit it shrinks in proportion to what is left. The stick is
looked at every `PERIOD`, and the speed changes by at most JV3 or JV4 each time (0: as much as is asked for), which is a
ramp of constant acceleration between two looks.
"""

from __future__ import annotations

from math import copysign, inf

from simulator.kinematics.profile import slew
from simulator.pmx.axis import Axis
from simulator.pmx.settings import AXES
from simulator.pmx.states import Doing, Pace

PERIOD = 0.01
"""Seconds between two looks at the stick (ours: the manual does not tell it)."""
MIDDLE = 2500
"""Millivolts at which it stands still."""
SLOWEST = 1.0
"""Pulses/s; anything slower is standing."""


class Stick:
    """The joystick of one axis: when it is looked at next, and what that makes of the motion."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self.number = AXES.index(axis.name)
        self.due: float | None = None

    def switch(self, on: bool, t: float) -> None:
        """Begin to look, or stop looking."""
        self.due = t if on else None

    def wanted(self, millivolts: int, t: float) -> float:
        """The speed that the stick asks for here, pulses/s, signed."""
        settings, n = self._axis.settings, self.number
        fastest, zone = settings[f"JV{1 + n}"], settings[f"JV{5 + n}"]
        out = abs(millivolts - MIDDLE) - zone
        if out <= 0:
            return 0.0
        way = copysign(1.0, millivolts - MIDDLE)
        return way * fastest * min(out / (MIDDLE - zone), 1.0) * self._room(way, t)

    def steer(self, millivolts: int, t: float) -> None:
        """Look at the stick, and move on with what it asks for."""
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
        """When the outer soft limit ahead is met; infinite: it is not."""
        path = self._axis.pulses.profile
        if self.due is None or not path.moving(after):
            return inf
        way = path.way(after)
        place = self.edge(way) - self._axis.pulses.counter(after) + path.position(after)
        found = path.crossing(place, after, way)
        return inf if found is None else found

    def edge(self, way: float) -> float:
        """The outer soft limit in a direction, as the counter has it."""
        return self._axis.settings[f"JL{self.number * 4 + (4 if way > 0 else 1)}"]

    def _room(self, way: float, t: float) -> float:
        """The part of the speed that the soft limits leave."""
        first = self.number * 4
        outer = self.edge(way)
        inner = self._axis.settings[f"JL{first + (3 if way > 0 else 2)}"]
        place = self._axis.pulses.counter(t)
        left = (outer - place) * way
        if left <= 0:
            return 0.0
        if (place - inner) * way <= 0:
            return 1.0
        return left / max((outer - inner) * way, left)
