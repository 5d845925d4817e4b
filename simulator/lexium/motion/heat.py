"""Current and temperature of a simulated drive.

The current is RC while the motor turns and for MT and HT after it, then HC (RC stays where both are 0); in torque mode
TQ; with AS=2 what the load asks for, a quarter of RC at least; none while the bridges are off. The bridge heats up
towards 35 degrees C and 25 more at full current without load, in proportion to (1 + load) and to the square of the
current, with a time constant of 300 s; the controller half as much. These figures are plausible, no more: what matters
is that WT (71) and the limit of 85 (72, bridges off) can be reached, with loads of 1 and more at currents near 100 %.
When they will be is solved. Manual 5.1.51, 5.1.55, 5.1.67, 5.1.86, 5.1.109, 5.1.143.
"""

from __future__ import annotations

from math import exp, inf, log
from typing import TYPE_CHECKING

from simulator.lexium.motion.hmt import TORQUE_MODE, VARIABLE

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice
    from simulator.lexium.motion.rotor import Event

AMBIENT, RISE, TIME_CONSTANT = 35.0, 25.0, 300.0
HOTTEST = 85.0
LEAST_SHARE = 0.25
WARNING, OVER = 71, 72


class Heat:
    """The temperature of one drive: an exponential from where it was at a time towards where it would end."""

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device
        self._since, self._was, self._towards = 0.0, AMBIENT, AMBIENT
        self._warned = self._tripped = False
        self._sensed = "IT" in device.memory.values

    def current(self, t: float) -> float:
        """Percent of the greatest one."""
        device, axis = self.device, self.device.axis
        values = device.memory.values
        if not values["DE"] or not axis.supply or axis.locked() or not device.powered:
            return 0.0
        if values.get("AS") == TORQUE_MODE:
            return float(values["TQ"])
        share = min(1.0, max(LEAST_SHARE, device.world.load)) if values.get("AS") == VARIABLE else 1.0
        return values["RC"] * share if t < self.holds_at() else float(values["HC"])

    def holding(self, t: float) -> bool:
        """Whether the current is the holding one."""
        axis, values = self.device.axis, self.device.memory.values
        off = not values["DE"] or not axis.supply or axis.locked() or values.get("AS") == TORQUE_MODE
        return not off and t >= self.holds_at()

    def holds_at(self) -> float:
        """When the current falls to HC; infinite if it does not."""
        axis, values = self.device.axis, self.device.memory.values
        delay = values["HT"] + values["MT"]
        if self.device.model.holds_without_ht and not values["HT"]:
            return inf
        return axis.over_at() + delay / 1000 if delay else inf

    def bridge(self, t: float) -> float:
        """Degrees C."""
        return self._towards + (self._was - self._towards) * exp(-(t - self._since) / TIME_CONSTANT)

    def controller(self, t: float) -> float:
        """Degrees C."""
        return AMBIENT + (self.bridge(t) - AMBIENT) / 2

    def look(self, t: float) -> None:
        """The current may have changed."""
        towards = AMBIENT + RISE * (self.current(t) / 100) ** 2 * (1 + self.device.world.load)
        if towards != self._towards:
            self._was, self._since, self._towards = self.bridge(t), t, towards
        here = self.bridge(t)
        self._warned = self._warned and here > self.device.memory.values["WT"] - 1
        self._tripped = self._tripped and here > HOTTEST - 1

    def next(self, t: float) -> Event:
        """A warning, the end of it all, or the change to the holding current."""
        hold = self.holds_at()
        if not self._sensed:
            return (hold if hold > t else inf), lambda at: None
        return min(
            (inf if self._warned else self._reaches(float(self.device.memory.values["WT"]), t), self._warn),
            (inf if self._tripped else self._reaches(HOTTEST, t), self._trip),
            (hold if hold > t else inf, lambda at: None),
            key=lambda each: each[0],
        )

    def _reaches(self, limit: float, t: float) -> float:
        if self._towards <= limit:
            return inf
        if self.bridge(t) > limit:
            return t
        return self._since + TIME_CONSTANT * log((self._towards - self._was) / (self._towards - limit))

    def _warn(self, t: float) -> None:
        self._warned = True
        self.device.raise_error(WARNING)

    def _trip(self, t: float) -> None:
        self._tripped = True
        self.device.motor.enable(0, t)
        self.device.raise_error(OVER)
