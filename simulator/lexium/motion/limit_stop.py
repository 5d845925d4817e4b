"""What LM makes of a limit that is reached: the stop, the error, the end of the program (manual 5.1.76, 5.1.78).

In homing LM=1 and 4 turn the motion round at the first limit (see `homing`).
"""

from __future__ import annotations

from collections.abc import Callable

from simulator.lexium.motion.axis import TORQUE, Axis
from simulator.lexium.motion.homing import WITHOUT_RAMP, Homing
from simulator.lexium.motion.inputs import Inputs
from simulator.lexium.motion.limits import DIRECTIONS, ERRORS, Limits
from simulator.lexium.motion.program_control import ProgramControl
from simulator.lexium.state.memory import Memory
from simulator.lexium.state.timeline import Event, Timeline

WITH_PROGRAM = (3, 6)
"""Values of LM that end the program too."""


class LimitStop:
    """The stop at a limit, of one drive."""

    def __init__(
        self,
        memory: Memory,
        timeline: Timeline,
        limits: Limits,
        axis: Axis,
        homing: Homing,
        inputs: Inputs,
        program: ProgramControl,
    ) -> None:
        self._values, self._timeline, self._limits, self._axis = memory.values, timeline, limits, axis
        self._homing, self._inputs, self._program = homing, inputs, program
        self._barred = 0

    def next(self, t: float) -> Event:
        """When P next passes a software limit on its way out."""
        at, direction = self._limits.next_passed(t)
        return at, lambda at: self.reach(direction, at)

    def reach(self, direction: int, t: float) -> None:
        """Stop what moves in the direction of a limit that has become active."""
        axis = self._axis
        if axis.heading(t) * direction <= 0:
            return
        self._timeline.replan()
        if self._homing.limit(direction, t):
            return
        if self._values["LM"] in WITHOUT_RAMP:
            axis.stop(t)
        else:
            axis.slow_to(0, t, kind=TORQUE if axis.kind == TORQUE else "")
        self._report(direction)

    def bars(self, t: float, steps: int) -> bool:
        """Whether an active limit keeps steps of a clock from being made; the first of them is the error."""
        code = self._limits.refuse(t, steps)
        if code and code != self._barred:
            self._report(1 if steps > 0 else -1)
        self._barred = code
        return bool(code)

    def turn_back(self, t: float) -> None:
        """Forgo the way back that loads the axis (BM=1) where it leads towards an active limit."""
        back = self._axis.back
        if self._limits.refuse(t, back):
            self._axis.forgo_way_back()
            self._report(1 if back > 0 else -1)

    def wired(self, n: int, was: int, t: float) -> None:
        """Act on an input that has just become a limit switch and is active already."""
        kind, active = self._inputs.types[n][:2]
        closed = self._inputs.active(n) and self._inputs.level(n) == active
        if kind in DIRECTIONS and kind != was and closed:
            self.reach(DIRECTIONS[kind], t)

    def relocate(self, change: Callable[[], None], t: float) -> None:
        """Change P or a software limit. A limit that P is beyond only now is reached, without having been passed."""
        before = self._limits.beyond(t)
        change()
        for direction in ERRORS:
            if direction not in before and direction in self._limits.beyond(t):
                self.reach(direction, t)

    def _report(self, direction: int) -> None:
        if self._values["LM"] in WITH_PROGRAM:
            self._program.finish()
        self._program.raise_error(ERRORS[direction])
