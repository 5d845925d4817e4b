"""Current and temperature of a simulated drive.

The current is RC while the motor turns and for MT and HT after it, then HC (RC stays where both are 0); in torque mode
TQ; with AS=2 what the load asks for, a quarter of RC at least; none while the bridges are off. The bridge heats up
towards 35 degrees C and 25 more at full current without load, in proportion to (1 + load) and to the square of the
current, with a time constant of 300 s; the controller half as much. These figures are plausible, no more: loads of 1
and more at currents near 100 % reach WT (71) and the limit of 85 (72, bridges off). The times of both are solved.
Manual 5.1.51, 5.1.55, 5.1.67, 5.1.86, 5.1.109, 5.1.143.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, inf, log

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.motion.axis import Axis
from multidrop.simulator.lexium.motion.hmt import VARIABLE, Torque
from multidrop.simulator.lexium.state.interpreter import Core
from multidrop.simulator.lexium.state.timeline import Event, nothing, when

AMBIENT, RISE, TIME_CONSTANT = 35.0, 25.0, 300.0
HOTTEST = 85.0
LEAST_SHARE = 0.25


class Heat:
    """The temperature of one drive: an exponential from where it was at a time towards where it would end."""

    def __init__(self, core: Core, axis: Axis, torque: Torque, disable: Callable[[float], None]) -> None:
        self._values, self._model, self._world = core.values, core.model, core.world
        self._bridges, self._status, self._torque = axis.bridges, axis.status, torque
        self._interpreter, self._disable = core.interpreter, disable
        self._since, self._was, self._towards = 0.0, AMBIENT, AMBIENT
        self._warned = self._tripped = False
        self._sensed = "IT" in core.values

    def current(self, t: float) -> float:
        """Percent of the greatest one."""
        values = self._values
        if not (self._bridges.powered and self._bridges.driving):
            return 0.0
        if self._torque.active:
            return float(values["TQ"])
        share = min(1.0, max(LEAST_SHARE, self._world.load)) if values.get("AS") == VARIABLE else 1.0
        return values["RC"] * share if t < self.holds_at() else float(values["HC"])

    def holding(self, t: float) -> bool:
        """Return whether the current is the holding one."""
        return self._bridges.driving and not self._torque.active and t >= self.holds_at()

    def holds_at(self) -> float:
        """When the current falls to HC; infinite if it does not."""
        values = self._values
        delay = values["HT"] + values["MT"]
        if self._model.holds_without_ht and not values["HT"]:
            return inf
        return self._status.over_at() + delay / 1000 if delay else inf

    def bridge(self, t: float) -> float:
        """Degrees C."""
        return self._towards + (self._was - self._towards) * exp(-(t - self._since) / TIME_CONSTANT)

    def controller(self, t: float) -> float:
        """Degrees C."""
        return AMBIENT + (self.bridge(t) - AMBIENT) / 2

    def look(self, t: float) -> None:
        towards = AMBIENT + RISE * (self.current(t) / 100) ** 2 * (1 + self._world.load)
        if towards != self._towards:
            self._was, self._since, self._towards = self.bridge(t), t, towards
        if self._warned or self._tripped:
            here = self.bridge(t)
            self._warned = self._warned and here > self._values["WT"] - 1
            self._tripped = self._tripped and here > HOTTEST - 1

    def next(self, t: float) -> Event:
        """The warning, the switching off, or the change to the holding current."""
        hold = self.holds_at()
        to_hold: Event = (hold if hold > t else inf), nothing
        if not self._sensed:
            return to_hold
        return min(
            (inf if self._warned else self._reaches(float(self._values["WT"]), t), self._warn),
            (inf if self._tripped else self._reaches(HOTTEST, t), self._trip),
            to_hold,
            key=when,
        )

    def _reaches(self, limit: float, t: float) -> float:
        if self._towards <= limit:
            return inf
        if self.bridge(t) > limit:
            return t
        return self._since + TIME_CONSTANT * log((self._towards - self._was) / (self._towards - limit))

    def _warn(self, t: float) -> None:
        self._warned = True
        self._interpreter.raise_error(E.TEMPERATURE_WARNING)

    def _trip(self, t: float) -> None:
        self._tripped = True
        self._disable(t)
        self._interpreter.raise_error(E.OVERTEMPERATURE)
