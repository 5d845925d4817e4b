"""Limits: switches on inputs (IS types 2 and 3) and positions in software (LS), and what LM makes of them.

A limit acts on motion in its own direction only, and while it is active nothing moves further that way (83, 84). In
homing LM=1 and 4 turn the motion round at the first limit (see `homing`). Manual 5.1.76, 5.1.78.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nextafter
from typing import TYPE_CHECKING

from simulator.lexium.motion.axis import TORQUE
from simulator.lexium.motion.inputs import MINUS, PLUS
from simulator.lexium.motion.rotor import TOUCH

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice
    from simulator.lexium.motion.rotor import Event

WAYS = {PLUS: 1, MINUS: -1}
"""Types of the limit switches, and their directions."""
ERRORS = {1: 83, -1: 84}
"""Codes by direction."""
WITHOUT_RAMP, WITH_PROGRAM, TURNS_ROUND = (4, 5, 6), (3, 6), (1, 4)
"""Values of LM."""
SOFTWARE = {1: 1, 0: -1}
"""The first number of LS, and its direction."""


class Limits:
    """The limits of one drive."""

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device
        self._barred = 0

    def refuse(self, t: float, way: float) -> int:
        """What forbids a motion in a direction: 83, 84 or 0."""
        sign = 1 if way > 0 else -1
        if not way:
            return 0
        return ERRORS[sign] if sign in self.device.axis.blocked or self._beyond(t, sign) else 0

    def next(self, t: float) -> Event:
        """When P next passes a software limit on its way out."""
        times = {way: self._passes(t, way) for way in self._enabled()}
        way = min(times, key=times.__getitem__, default=0)
        return times.get(way, inf), lambda at: self.reach(way, at)

    def reach(self, way: int, t: float) -> None:
        """A limit has become active: stop what moves that way."""
        device, axis = self.device, self.device.axis
        if axis.heading(t) * way <= 0:
            return
        mode = device.memory.values["LM"]
        device.stale = True
        if device.motor.homing.limit(way, t):
            return
        if mode in WITHOUT_RAMP:
            axis.stop(t)
        else:
            axis.slow_to(0, t, kind=TORQUE if axis.kind == TORQUE else "")
        self._tell(way)

    def bars(self, t: float, steps: int) -> bool:
        """Whether an active limit keeps steps of a clock from being made; the first of them is the error."""
        code = self.refuse(t, steps)
        if code and code != self._barred:
            self._tell(1 if steps > 0 else -1)
        self._barred = code
        return bool(code)

    def turn_back(self, t: float) -> None:
        """A move has come to where it turns back to load the axis (BM=1), which it does not towards an active limit."""
        axis = self.device.axis
        way = 1 if axis.way_back > 0 else -1
        if self.refuse(t, axis.way_back):
            axis.forgo()
            self._tell(way)

    def _tell(self, way: int) -> None:
        if self.device.memory.values["LM"] in WITH_PROGRAM:
            self.device.interpreter.finish()
        self.device.raise_error(ERRORS[way])

    def wired(self, n: int, was: int, t: float) -> None:
        """An input has been set up; as a limit switch it may be one that is active already."""
        kind, active = self.device.inputs.types[n][:2]
        closed = self.device.inputs.active(n) and self.device.inputs.level(n) == active
        if kind in WAYS and kind != was and closed:
            self.reach(WAYS[kind], t)

    def jump(self, t: float, change: Callable[[], None]) -> None:
        """Change P or a software limit: one that is beyond its limit by that is reached, without having been passed."""
        before = {way for way in self._enabled() if self._beyond(t, way)}
        change()
        for way in self._enabled():
            if way not in before and self._beyond(t, way):
                self.reach(way, t)

    def _enabled(self) -> list[int]:
        return [way for which, way in SOFTWARE.items() if self.device.limits[which][1]]

    def _place(self, way: int) -> float:
        return self.device.axis.trip_position(self.device.limits[1 if way > 0 else 0][0])

    def _beyond(self, t: float, way: int) -> bool:
        return way in self._enabled() and (self.device.axis.place(t) - self._place(way)) * way >= -TOUCH

    def _passes(self, t: float, way: int) -> float:
        axis, place = self.device.axis, self._place(way)
        if self._beyond(t, way):
            back = axis.passing(place, t, -way)
            t = inf if back == inf else nextafter(back, inf)
        return inf if t == inf else axis.passing(place, t, way)
