"""Homing: to the home switch (HM), to the encoder's index mark (HI), to a place beside it (HF).

A homing seeks at VM, slows down once it has found, and approaches at VI in the direction that its type says. On a
switch it ends where the switch opens; a switch that is closed to begin with is left at once. One that it has passed
while it slowed down is approached again and left; where its type approaches in the same direction it has left the
switch, and ends where it stopped. On a mark it ends at the mark, at which I6 reads 1; a mark that it begins on is not
counted. Limits end it as LM says: with LM=1 and 4 the first one that is met while it seeks turns it round. The other
one, or one met during the approach, ends it: error 82 if both have been met. One that is met while a pause slows the
homing down does the same once it goes on. Manual 5.1.48, 5.1.52 to 5.1.54, 5.1.76.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.simulator.motion.axis import HOMING, TORQUE, Axis
from multidrop.families.lexium.simulator.motion.counters import DIRECTIONS, ERRORS, DriveLimits
from multidrop.families.lexium.simulator.motion.inputs import HOME, Inputs
from multidrop.families.lexium.simulator.state.errors import DriveFault, Event
from multidrop.families.lexium.simulator.state.interpreter import Core
from multidrop.simulator.kinematics import MotionPace, slew
from multidrop.simulator.world import TOUCH

SEEK, BRAKE, TURN, APPROACH = "seek", "brake", "turn", "approach"
TYPES = {1: (-1, 1), 2: (-1, -1), 3: (1, -1), 4: (1, 1)}
"""The directions in which each type seeks and approaches."""
WITHOUT_RAMP, TURNS_ROUND = (4, 5, 6), (1, 4)
"""Values of LM."""


class LexiumHoming:
    """The homing of one drive. `phase` is empty while there is none."""

    def __init__(self, core: Core, axis: Axis, inputs: Inputs, limits: DriveLimits) -> None:
        self._memory, self._values, self._timeline = core.memory, core.values, core.timeline
        self._axis, self._inputs, self._limits, self._interpreter = axis, inputs, limits, core.interpreter
        self.phase = ""
        self._word = ""
        self._directions = (0, 0)
        self._met: set[int] = set()
        self._sought = 0
        self._mark = self._offset = self._turn = 0.0
        self._toward = 1

    def start(self, word: str, kind: int, t: float) -> None:
        """Begin HM, HI or HF. Raises DriveFault (80, 81, 83, 84, 85, 94, 96)."""
        if kind not in TYPES:
            raise DriveFault(E.NO_HOMING_TYPE)
        self._axis.bridges.check()
        if word == "HM" and not self._inputs.has(HOME):
            raise DriveFault(E.NO_HOME_INPUT)
        if self._axis.status.moving(t):
            raise DriveFault(E.HOMING_OR_MOVING)
        seek, approach = TYPES[kind]
        begun = word == "HM" and self._at_switch()
        self._set_out(word, (seek, approach), set(), 0 if begun else seek, t)
        if begun:
            self._approach(t)

    def _set_out(self, word: str, directions: tuple[int, int], met: set[int], direction: int, t: float) -> None:
        """Seek in a direction, 0 where it has found already, or turn round at once.

        Raises DriveFault (82 to 85, 94, 96).
        """
        blocked = direction and self._values["LM"] in TURNS_ROUND and self._limits.refuse(t, direction)
        if blocked and met:
            raise DriveFault(E.NO_HOME_SWITCH)
        there = -direction if blocked else direction
        self._axis.allow(t, there or directions[1])
        self._axis.check_ramps()
        self._word, self._directions, self._met = word, directions, {*met, direction} if blocked else set(met)
        self._timeline.replan()
        if there:
            self._seek(there, t)

    def _at_switch(self) -> bool:
        return bool(self._inputs.wants(HOME))

    def again(self) -> Callable[[float], None] | None:
        """Return a closure that goes on with the homing that is under way (PS, RS); None if there is none."""
        if not self.phase:
            return None
        word, directions, met = self._word, self._directions, self._met
        direction = -directions[0] if self.phase == TURN else self._sought
        approaches, braked = self.phase in (BRAKE, APPROACH), self.phase == BRAKE

        def go_on(t: float) -> None:
            again = approaches or (word == "HM" and self._at_switch())
            self._set_out(word, directions, met, 0 if again else direction, t)
            if braked:
                self._leave(t)
            elif again:
                self._approach(t)

        return go_on

    def cancel(self) -> None:
        self.phase = ""

    def home(self, active: bool, t: float) -> None:
        if self._word != "HM":
            return
        if self.phase == SEEK and active:
            self._brake(BRAKE, t)
        elif self.phase == APPROACH and not active:
            self._finish(t)

    def pass_mark(self, t: float) -> None:
        if self.phase == SEEK:
            self._brake(BRAKE, t)
        elif self.phase == APPROACH:
            self._finish(t)

    def arrive(self, t: float) -> None:
        if self.phase == TURN:
            self._seek(-self._directions[0], t)
        elif self.phase == BRAKE:
            self._leave(t)
        else:
            self.phase = ""

    def _leave(self, t: float) -> None:
        """Approach what it sought and slowed down after, unless it has passed the switch on the way off it."""
        on_its_way = self._word == "HM" and self._sought == self._directions[1]
        if on_its_way and not self._at_switch():
            self.phase = ""
        else:
            self._approach(t)

    def limit(self, direction: int, t: float) -> bool:
        """Act on a limit that is met. Return whether that was all there is to do."""
        if not self.phase:
            return False
        mode = self._values["LM"]
        self._met.add(direction)
        if len(self._met) == 2:
            self.phase = ""
            if mode in WITHOUT_RAMP:
                self._axis.stop(t)
            else:
                self._axis.slow_to(0, t)
            self._interpreter.raise_error(E.NO_HOME_SWITCH)
            return True
        if self.phase == SEEK and mode in TURNS_ROUND:
            if mode in WITHOUT_RAMP:
                self._axis.stop(t)
                self._seek(-self._directions[0], t)
            else:
                self._brake(TURN, t)
            return True
        self.phase = ""
        return False

    def _seek(self, direction: int, t: float) -> None:
        self.phase, self._sought = SEEK, direction
        self._axis.slow_to(direction * self._values["VM"] * self._memory.scale, t, kind=HOMING)
        self._set_mark(direction, t)

    def _brake(self, phase: str, t: float) -> None:
        self.phase = phase
        self._axis.slow_to(0, t, kind=HOMING)

    def _approach(self, t: float) -> None:
        self.phase = APPROACH
        here, direction, vi = self._axis.position(t), self._directions[1], self._values["VI"] * self._memory.scale
        self._axis.begin(HOMING, slew(t, here, 0.0, direction * vi, MotionPace(vi, vi, 1.0, 1.0)), t)
        self._set_mark(direction, t)

    def _set_mark(self, direction: int, t: float) -> None:
        """Find the next mark on its way, for the index."""
        if self._word == "HM":
            return
        self._offset, self._toward = self._values["FS"] if self._word == "HF" else 0.0, direction
        self._see_mark(self._axis.rotor.position(t) + direction * self._memory.steps_per_count / 2)

    def _see_mark(self, here: float) -> None:
        frame = self._axis.rotor.frame
        self._mark, self._turn = frame.index_ahead(here, self._toward, self._offset), frame.turn

    def mark_at(self, t: float) -> float:
        """When the rotor will be at the mark, whatever has held it up or pushed it until now; infinite: never."""
        if self._word == "HM" or self.phase not in (SEEK, APPROACH):
            return inf
        rotor = self._axis.rotor
        if rotor.frame.turn != self._turn:  # steps mean something else now
            self._see_mark(rotor.position(t))
        beyond = (rotor.position(t) - self._mark) * self._toward
        if abs(beyond) <= TOUCH:
            return t
        if beyond > 0:
            self._see_mark(rotor.position(t))
        profile, shift = rotor.path
        return profile.crossing(self._mark - shift, t, self._toward)

    def _finish(self, t: float) -> None:
        """Stop: a switch is left by a whole step, a mark is hit."""
        self.phase = ""
        self._axis.stop(t, self._directions[1] if self._word == "HM" else 0)


# What LM makes of a limit that is reached: the stop, the error, the end of the program (manual 5.1.76, 5.1.78).
#
# In homing LM=1 and 4 turn the motion round at the first limit.


WITH_PROGRAM = (3, 6)
"""Values of LM that end the program too."""


class LimitStop:
    """The stop at a limit, of one drive."""

    def __init__(self, core: Core, axis: Axis, inputs: Inputs, limits: DriveLimits, homing: LexiumHoming) -> None:
        self._values, self._timeline, self._thread = core.values, core.timeline, core.thread
        self._axis, self._inputs, self._limits, self._homing = axis, inputs, limits, homing
        self._interpreter = core.interpreter
        self._barred = 0

    def next(self, t: float) -> Event:
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
        """Return whether an active limit keeps steps of a clock from being made; the first of them is the error."""
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
            self._thread.finish()
        self._interpreter.raise_error(ERRORS[direction])
