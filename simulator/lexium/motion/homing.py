"""Homing: to the home switch (HM), to the encoder's index mark (HI), to a place beside it (HF).

A homing seeks at VM, slows down once it has found, and creeps at VI the way that its type says. On a switch it ends
where the switch opens; a switch that is closed to begin with is crept off at once. One that it has passed while it
slowed down is crept back to, and off; where its type creeps on the same way it has left the switch, and ends where it
stands. On a mark it ends at the mark, at
which I6 reads 1; a mark that it begins on is not counted. Limits end it as LM says: with LM=1 and 4 the first one that
is met while it seeks turns it round, and the other one, or one met while it creeps, ends it: error 82 if both have been
met. One that is met while a pause slows the homing down does the same once it goes on. Manual 5.1.48, 5.1.52 to 5.1.54,
5.1.76.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import TYPE_CHECKING

from simulator.kinematics.profile import slew
from simulator.kinematics.segments import Shape
from simulator.lexium.motion.axis import HOMING
from simulator.lexium.motion.rotor import TOUCH
from simulator.lexium.state.errors import Fault

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

SEEK, BRAKE, TURN, CREEP = "seek", "brake", "turn", "creep"
TYPES = {1: (-1, 1), 2: (-1, -1), 3: (1, -1), 4: (1, 1)}
"""The directions in which each type seeks and creeps."""
NO_SWITCH, NO_TYPE, NOT_FOUND, BUSY = 80, 81, 82, 85
HOME_INPUT = 1
WITHOUT_RAMP, WITH_PROGRAM, TURNS_ROUND = (4, 5, 6), (3, 6), (1, 4)


class Homing:
    """The homing of one drive. `phase` is empty while there is none."""

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device
        self.phase = ""
        self._word = ""
        self._ways = (0, 0)
        self._met: set[int] = set()
        self._sought = 0
        self._mark = self._offset = self._turn = 0.0
        self._toward = 1

    def start(self, word: str, kind: int, t: float) -> None:
        """HM, HI or HF. Raises Fault (80, 81, 83, 84, 85, 94, 96)."""
        device, axis = self.device, self.device.axis
        if kind not in TYPES:
            raise Fault(NO_TYPE)
        axis.check_drive()
        if word == "HM" and not any(device.inputs.types[n][0] == HOME_INPUT for n in device.inputs.numbers):
            raise Fault(NO_SWITCH)
        if axis.moving(t):
            raise Fault(BUSY)
        ways = TYPES[kind]
        begun = word == "HM" and bool(device.inputs.wants(HOME_INPUT))
        met = set() if begun else self._blocked(ways[0], t)
        way = -ways[0] if met else ways[0]
        axis.allow(t, ways[1] if begun else way)
        axis.check_ramps()
        self._word, self._ways, self._met = word, ways, met
        device.stale = True
        if begun:
            self._creep(t)
        else:
            self._seek(way, t)

    def _blocked(self, way: int, t: float) -> set[int]:
        """The limit that would turn it round, if that is active to begin with."""
        device = self.device
        return {way} if device.memory.values["LM"] in TURNS_ROUND and device.motor.limits.refuse(t, way) else set()

    def again(self) -> Callable[[float], None] | None:
        """What goes on with the homing that is under way once the motor stands (PS, RS); None if there is none."""
        if not self.phase:
            return None
        word, ways, met = self._word, self._ways, self._met
        way = -ways[0] if self.phase == TURN else self._sought
        creeps, braked = self.phase in (BRAKE, CREEP), self.phase == BRAKE

        def go_on(t: float) -> None:
            found = creeps or (word == "HM" and bool(self.device.inputs.wants(HOME_INPUT)))
            hit = set() if found else self._blocked(way, t)
            if hit and met:
                raise Fault(NOT_FOUND)
            there = -way if hit else way
            self.device.axis.allow(t, ways[1] if found else there)
            self.device.axis.check_ramps()
            self._word, self._ways, self._met = word, ways, met | hit
            self.device.stale = True
            if braked:
                self._leave(t)
            elif found:
                self._creep(t)
            else:
                self._seek(there, t)

        return go_on

    def cancel(self) -> None:
        """Something else has stopped the motor."""
        self.phase = ""

    def home(self, active: bool, t: float) -> None:
        """The home switch has closed or opened."""
        if self._word != "HM":
            return
        if self.phase == SEEK and active:
            self._brake(BRAKE, t)
        elif self.phase == CREEP and not active:
            self._finish(t)

    def pass_mark(self, t: float) -> None:
        """The rotor is at the mark."""
        if self.phase == SEEK:
            self._brake(BRAKE, t)
        elif self.phase == CREEP:
            self._finish(t)

    def arrive(self, t: float) -> None:
        """The motor stands."""
        if self.phase == TURN:
            self._seek(-self._ways[0], t)
        elif self.phase == BRAKE:
            self._leave(t)
        else:
            self.phase = ""

    def _leave(self, t: float) -> None:
        """It has slowed down behind what it sought: creep off, unless it has passed the switch on the way off it."""
        on_its_way = self._word == "HM" and self._sought == self._ways[1]
        if on_its_way and not self.device.inputs.wants(HOME_INPUT):
            self.phase = ""
        else:
            self._creep(t)

    def limit(self, way: int, t: float) -> bool:
        """A limit is met. Gives whether that was all there is to do."""
        if not self.phase:
            return False
        mode = self.device.memory.values["LM"]
        self._met.add(way)
        if len(self._met) == 2:
            self._end(mode, t)
            self.device.raise_error(NOT_FOUND)
            return True
        if self.phase == SEEK and mode in TURNS_ROUND:
            if mode in WITHOUT_RAMP:
                self.device.axis.stop(t)
                self._seek(-self._ways[0], t)
            else:
                self._brake(TURN, t)
            return True
        self.phase = ""
        return False

    def _end(self, mode: float, t: float) -> None:
        self.phase = ""
        if mode in WITHOUT_RAMP:
            self.device.axis.stop(t)
        else:
            self.device.axis.slow_to(0, t)

    def _seek(self, way: int, t: float) -> None:
        self.phase, self._sought = SEEK, way
        axis = self.device.axis
        axis.slow_to(way * axis.memory.values["VM"] * axis.scale, t, kind=HOMING)
        self._set_mark(way, t)

    def _brake(self, phase: str, t: float) -> None:
        self.phase = phase
        self.device.axis.slow_to(0, t, kind=HOMING)

    def _creep(self, t: float) -> None:
        self.phase = CREEP
        axis, way = self.device.axis, self._ways[1]
        vi = axis.memory.values["VI"] * axis.scale
        still = Shape()
        axis.begin(HOMING, slew(t, axis.position(t), 0.0, way * vi, vi=vi, a=1.0, d=1.0, up=still, down=still), t)
        self._set_mark(way, t)

    def _set_mark(self, way: int, t: float) -> None:
        """For the index: the next mark on its way."""
        if self._word == "HM":
            return
        axis = self.device.axis
        self._offset, self._toward = axis.memory.values["FS"] if self._word == "HF" else 0.0, way
        self._see_mark(axis.rotor.position(t) + way * axis.steps_per_count / 2)

    def _see_mark(self, here: float) -> None:
        rotor = self.device.axis.rotor
        self._mark, self._turn = rotor.index_ahead(here, self._toward, self._offset), rotor.turn

    def mark_at(self, t: float) -> float:
        """When the rotor will be at the mark, whatever has held it up or pushed it until now; infinite: never."""
        if self._word == "HM" or self.phase not in (SEEK, CREEP):
            return inf
        rotor = self.device.axis.rotor
        if rotor.turn != self._turn:  # steps mean something else now
            self._see_mark(rotor.position(t))
        beyond = (rotor.position(t) - self._mark) * self._toward
        if abs(beyond) <= TOUCH:
            return t
        if beyond > 0:
            self._see_mark(rotor.position(t))
        profile, shift = rotor.path
        found = profile.crossing(self._mark - shift, t, self._toward)
        return inf if found is None else found

    def _finish(self, t: float) -> None:
        """A switch is left by a whole step; a mark is hit."""
        self.phase = ""
        self.device.axis.stop(t, self._ways[1] if self._word == "HM" else 0)
