"""The jog inputs (types 7 and 8): turn at VM while one of them is active and JE=1.

Chosen where the manual is silent (3.4.3, 5.1.64, 7.2.3): a jog does not change another motion, and both inputs at once
cancel each other.
"""

from __future__ import annotations

from multidrop.dialects.mcode.manual.errors import JOG_IN_CLOCK_MODE
from multidrop.simulator.lexium.motion.axis import SLEW, Axis
from multidrop.simulator.lexium.motion.inputs import JOG_MINUS, JOG_PLUS, Inputs
from multidrop.simulator.lexium.motion.motion_status import MotionStatus
from multidrop.simulator.lexium.motion.program_control import ProgramControl
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.timeline import Timeline


class Jog:
    """The jog of one drive. `direction` is 0 while there is none."""

    def __init__(
        self,
        memory: Memory,
        timeline: Timeline,
        axis: Axis,
        status: MotionStatus,
        inputs: Inputs,
        program: ProgramControl,
    ) -> None:
        self._values, self._timeline = memory.values, timeline
        self._axis, self._status, self._inputs, self._program = axis, status, inputs, program
        self.direction = 0

    def update(self) -> None:
        """Turn as the jog inputs and JE say now; a motion that may not begin is an error that no line has caused."""
        try:
            self._update()
        except Fault as fault:
            self._program.raise_error(fault.code)

    def _update(self) -> None:
        t, before, wanted = self._timeline.now, self.direction, self._wanted()
        if wanted == before or (not before and self._status.moving(t)):
            return
        self.direction = 0
        self._timeline.replan()
        if wanted:
            self._axis.slew(wanted * int(self._values["VM"]), t)
            self.direction = wanted
        elif self._axis.kind == SLEW:
            self._axis.slow_to(0, t)
            self._program.drop_motion()

    def _wanted(self) -> int:
        """The direction that the inputs ask for. Raises Fault (87) where the motor follows a clock."""
        if not self._values["JE"] or not self._inputs.watched:
            return 0
        if self._values.get("CM"):
            raise Fault(JOG_IN_CLOCK_MODE)
        return self._inputs.wants(JOG_PLUS) - self._inputs.wants(JOG_MINUS)
