"""The flags and values that a drive gives of its motion: MV, MP, VC, V, AV, and when a motion is over.

Manual 5.1.8, 5.1.83, 5.1.85, 5.1.86, 5.1.88, 5.1.137, 5.1.139.
"""

from __future__ import annotations

from math import inf

from multidrop.simulator.lexium.motion.axis import CORRECTION, MOVES, TORQUE, Axis, Supervisor
from multidrop.simulator.lexium.motion.rotor import CATCHING
from multidrop.simulator.lexium.motion.units import Units
from multidrop.simulator.lexium.state.memory import Memory


class MotionStatus:
    """The status of one axis."""

    def __init__(self, memory: Memory, units: Units, axis: Axis, supervisor: Supervisor) -> None:
        self._values, self._model, self._units = memory.values, memory.model, units
        self._axis, self._rotor, self._supervisor = axis, axis.rotor, supervisor

    def speed(self, t: float) -> int:
        """V: signed velocity as commanded, steps/s; counts/s with EE=1; 0 in torque mode."""
        return 0 if self._axis.kind == TORQUE else round(self._axis.profile.velocity(t) / self._units.scale)

    def rotor_speed(self, t: float) -> int:
        """AV: what the rotor does, steps/s; 0 without hMT."""
        return round(self._rotor.velocity(t)) if self._values.get("AS") else 0

    def moving(self, t: float) -> bool:
        """Whether pulses are put out, or about to be; those of make-up are some too."""
        if t < self._axis.profile.end or self._supervisor.homing_active:
            return True
        return self._rotor.state == CATCHING and t < self._rotor.caught_up_at()

    def reported(self, t: float) -> bool:
        """MV: moving, and on some products the settling time MT after it."""
        if self.moving(t):
            return True
        return self._model.settles and self._axis.kind != "" and t < self.settled_at()

    def positioning(self, t: float) -> bool:
        """MP: whether MA or MR is under way, or in what follows it: HT and MT, or MT alone."""
        values, axis = self._values, self._axis
        delay = (values["MT"] if self._model.settles else values["HT"] + values["MT"]) / 1000
        return axis.kind in (*MOVES, CORRECTION) and axis.profile.start <= t < self.over_at() + delay

    def moving_or_settling(self, t: float) -> bool:
        """The moving output: with the settling and holding delays after a motion of any kind (manual 5.1.93)."""
        values = self._values
        if self._model.settles:
            return self.reported(t)
        delay = (values["HT"] + values["MT"]) / 1000
        return self.moving(t) or (self._axis.kind != "" and t < self.over_at() + delay)

    def changing(self, t: float) -> bool:
        """VC: whether it speeds up or slows down."""
        return self._axis.profile.changing(t)

    def over_at(self) -> float:
        """When the pulses of the motion that is under way end; infinite while nothing will end it."""
        axis, rotor = self._axis, self._rotor
        if self._supervisor.homing_active or axis.back:
            return inf
        late = rotor.caught_up_at() if rotor.closed else -inf
        if late == inf and abs(rotor.lag(axis.profile.end)) < self._units.bound:
            late = -inf
        return max(axis.profile.end, late)

    def settled_at(self) -> float:
        """When what H waits for is over: the motion, then MT."""
        return self.over_at() + self._values["MT"] / 1000

    def at_index(self, t: float) -> bool:
        """I6: whether the encoder is at its index mark."""
        here, reach = self._rotor.position(t), self._units.steps_per_count / 2
        return self._rotor.frame.index_ahead(here - reach, 1) <= here + reach
