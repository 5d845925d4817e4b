"""The configuration test (SC): half a turn, to see what the encoder makes of it. Manual 5.1.115."""

from __future__ import annotations

from dialects.mcode.manual.errors import ErrorNumber as E
from simulator.kinematics.profile import move
from simulator.lexium.motion.axis import Axis
from simulator.lexium.motion.bridges import Bridges
from simulator.lexium.motion.motion_status import MotionStatus
from simulator.lexium.motion.program_control import ProgramControl
from simulator.lexium.motion.units import Units
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.memory import Memory
from simulator.lexium.state.timeline import Timeline

TEST = "test"
"""The kind of motion that SC makes."""


class ConfigurationTest:
    """The configuration test of one drive."""

    def __init__(
        self,
        memory: Memory,
        timeline: Timeline,
        units: Units,
        bridges: Bridges,
        axis: Axis,
        status: MotionStatus,
        program: ProgramControl,
    ) -> None:
        self._values, self._timeline, self._units, self._bridges = memory.values, timeline, units, bridges
        self._axis, self._status, self._program = axis, status, program
        self._begun_at = 0.0

    def start(self, t: float) -> None:
        """Begin. Raises Fault (89, 94, 96, 103)."""
        values, scale, axis = self._values, self._units.scale, self._axis
        if not self._bridges.enabled:
            raise Fault(E.NOT_TESTED)
        if self._status.moving(t):
            raise Fault(E.CALIBRATION_WHILE_MOVING)
        axis.allow(t, 1.0)
        here, vi = axis.position(t), values["VI"] * scale
        self._begun_at = axis.rotor.position(t)
        top, rate = values["VM"] * scale, values["A"] * scale
        target = here + self._units.steps_per_turn / 2
        axis.begin(TEST, move(t, here, 0.0, target, vi=vi, vm=top, a=rate, d=rate), t)
        self._timeline.replan()

    def moving(self, t: float) -> bool:
        """Whether its motion is under way."""
        return self._axis.kind == TEST and self._axis.profile.moving(t)

    def arrive(self, t: float) -> None:
        """Compare what the encoder has seen, where its motion has ended."""
        seen = self._axis.rotor.position(t) - self._begun_at
        if self._axis.kind == TEST and abs(seen - self._units.steps_per_turn / 2) > 1:
            self._program.raise_error(E.ENCODER_RESOLUTION_WRONG)
