"""The parts that have a hand in a simulated drive's motion, put together: what they see, and what happens next.

The axis moves, the rotor follows; homing, limits, encoder, hMT, heat and the clock inputs watch both and command the
axis in turn. The device asks `next` what happens next and lets it happen; `look` sees what has changed from outside.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.kinematics.profile import move
from multidrop.simulator.lexium.motion.axis import HOMING, Axis
from multidrop.simulator.lexium.motion.bridges import Bridges
from multidrop.simulator.lexium.motion.counters import Counters
from multidrop.simulator.lexium.motion.encoder import Encoder
from multidrop.simulator.lexium.motion.heat import Heat
from multidrop.simulator.lexium.motion.hmt import Hmt
from multidrop.simulator.lexium.motion.homing import Homing, LimitStop
from multidrop.simulator.lexium.motion.inputs import HOME, ClockInputs, Inputs
from multidrop.simulator.lexium.motion.jog import Jog
from multidrop.simulator.lexium.motion.limits import DIRECTIONS, Limits
from multidrop.simulator.lexium.motion.motion_status import MotionStatus
from multidrop.simulator.lexium.motion.program_control import ProgramControl
from multidrop.simulator.lexium.motion.rotor import Rotor
from multidrop.simulator.lexium.motion.scale import Scale
from multidrop.simulator.lexium.motion.torque import Torque
from multidrop.simulator.lexium.motion.trips import Trips
from multidrop.simulator.lexium.motion.units import Units
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.timeline import Event, Timeline, when
from multidrop.simulator.world import World

# The configuration test (SC): half a turn, to see what the encoder makes of it. Manual 5.1.115.


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


class Motor:
    """The motor of one drive. It is the axis's supervisor.

    `announce` sends the drive's name at the end of a motion that asks for that.
    """

    def __init__(
        self,
        memory: Memory,
        timeline: Timeline,
        world: World,
        rotor: Rotor,
        inputs: Inputs,
        program: ProgramControl,
        announce: Callable[[], None],
    ) -> None:
        values, model = memory.values, memory.model
        self._memory, self._timeline, self._announce = memory, timeline, announce
        self.rotor, self._inputs = rotor, inputs
        self.units = units = Units(memory)
        self.bridges = bridges = Bridges(values, model.disabled_moves)
        self.counters = Counters(memory, rotor, units)
        self.axis = axis = Axis(memory, units, bridges, rotor, self.counters, self)
        self.status = status = MotionStatus(memory, units, axis, self)
        self.limits = limits = Limits(self.counters)
        self.trips = Trips(memory, timeline, units, self.counters, inputs, program)
        self.homing = Homing(memory, timeline, units, bridges, axis, status, inputs, limits, program)
        self.limit_stop = LimitStop(memory, timeline, limits, axis, self.homing, inputs, program)
        self.encoder = Encoder(memory, timeline, units, bridges, axis, limits, program, self.stop)
        self.torque = torque = Torque(memory, timeline, world, axis, bridges, limits)
        self.scale = scale = Scale(memory, units, axis, self.counters)
        self.hmt = Hmt(memory, timeline, units, bridges, axis, scale, status, torque, self.trips, program, self.stop)
        self.test = ConfigurationTest(memory, timeline, units, bridges, axis, status, program)
        self.heat = Heat(memory, world, bridges, status, torque, program, lambda t: self.enable(0, t))
        self.jog = Jog(memory, timeline, axis, status, inputs, program)
        self._clock = ClockInputs(memory, inputs)

    # What the axis asks.

    @property
    def homing_active(self) -> bool:
        """Whether a homing is under way, which other motions have to wait for."""
        return self.homing.phase != ""

    def refuse(self, t: float, direction: float) -> int:
        """The code of what forbids a motion in a direction, or 0."""
        if self.hmt.calibrating or self.test.moving(t):
            return E.MOVE_WHILE_CALIBRATING
        return E.HOMING_OR_MOVING if self.torque.active else self.limits.refuse(t, direction)

    def motion_began(self) -> None:
        """End what another kind of motion was about: a motion has begun."""
        self.encoder.begin()
        if self.axis.kind != HOMING:
            self.homing.cancel()

    # What happens.

    def next(self, t: float) -> Event:
        """What happens next."""
        axis = self.axis
        return min(
            self.limit_stop.next(t),
            self.rotor.next(t),
            self.hmt.next(t),
            (axis.profile.end if axis.arriving else inf, self._arrive),
            (self.homing.mark_at(t), self.homing.pass_mark),
            (inf if axis.mark is None else axis.mark, self._pass_mark),
            self.encoder.next(t),
            self.heat.next(t),
            key=when,
        )

    def look(self, t: float) -> None:
        """See what hands, loads and clocks have done."""
        was = self.counters.place(t) if self.rotor.pushed else 0.0
        enabled = self.bridges.enabled
        if self.rotor.look(t, enabled, coasts=not enabled and self.bridges.count_when_disabled):
            self.trips.displaced(was, self.counters.place(t), t)
            self.hmt.pushed()
            self.encoder.look(t)
            self._timeline.replan()
        self.hmt.look(t)
        self.heat.look(t)
        self._follow_clock(t)

    def look_at_limits(self) -> None:
        """See which limit switches are active; a clock knows no limits (MDrivePlus 5-13)."""
        switches = self.limits.switches
        switches.clear()
        if not self._memory.values.get("CM"):
            switches.update([DIRECTIONS[kind] for kind in self._inputs.active_types() if kind in DIRECTIONS])

    def input_changed(self, kind: int, active: bool, t: float) -> None:
        """Act on an input of a type that is a matter of motion."""
        if kind == HOME:
            self.homing.home(active, t)
        elif kind in DIRECTIONS and active and not self._memory.values.get("CM"):
            self.limit_stop.reach(DIRECTIONS[kind], t)

    # What is commanded.

    def stop(self, t: float) -> None:
        """Stand at once, whatever it was doing."""
        self.homing.cancel()
        self.axis.stop(t)
        self.encoder.begin()
        self.jog.direction = 0  # the jog input, once released, then stops nothing that was begun since

    def pause(self, t: float) -> Callable[[float], None]:
        """Slow down and stop; what is given takes up the same motion again."""
        if self.torque.halt():
            return self.torque.go_on
        homing = self.homing.again()
        if homing is None:
            return self.axis.pause(t)
        self.axis.slow_to(0, t)
        return homing

    def slew(self, velocity: int, t: float) -> None:
        """Carry out SL; 0 stops torque mode too."""
        if velocity or not self.torque.halt():
            self.axis.slew(velocity, t)

    def enable(self, on: int, t: float) -> None:
        """Carry out DE."""
        was, self._memory.values["DE"] = self._memory.values["DE"], on
        if not on:
            self.stop(t)
            self.hmt.disable()
        elif not was:
            self.axis.align(t)
        self.hmt.tune()
        self._timeline.replan()

    def supply(self, on: bool, t: float) -> bool:
        """Switch +V. Gives whether it is lost."""
        was, self.bridges.supply = self.bridges.supply, on
        self.hmt.tune()
        if on and not was:
            self.axis.align(t)
        if was and not on:
            self.stop(t)
        return was and not on

    def reload(self, load: Callable[[], None], t: float) -> None:
        """Take other values from NVM: the rotor stays where it is, whatever its steps become."""
        values, mode = self._memory.values, self.hmt.mode
        was = self._memory.counting, values["DE"]
        self.scale.change(load, t)
        if was != (self._memory.counting, values["DE"]):
            self.axis.align(t)
        self.hmt.changed(mode, t)
        self.hmt.tune()

    def restart(self, t: float) -> None:
        """Begin at power-up or reset."""
        self.homing.cancel()
        self.encoder.restart()
        self.hmt.restart()
        self.axis.restart(t)
        self.scale.orient(t)
        self.counters.restart(t)
        self.limits.switches.clear()
        self.jog.direction = 0
        self.hmt.tune()

    def _arrive(self, t: float) -> None:
        self.encoder.arrive(t)
        self.test.arrive(t)
        self.hmt.arrive(t)
        self.limit_stop.turn_back(t)
        if self.axis.arrive(t):
            self._announce()
        if self.homing.phase:
            self.homing.arrive(t)

    def _pass_mark(self, t: float) -> None:
        if self.axis.pass_mark():
            self._announce()

    def _follow_clock(self, t: float) -> None:
        """Make the steps that a clock asks for, where the command may jump."""
        steps = self._clock.steps()
        if steps and not self.hmt.calibrating and not self.torque.active and not self.limit_stop.bars(t, steps):
            before = self.counters.place(t)
            self.axis.step(steps, t)
            self._timeline.replan()
            self.trips.displaced(before, self.counters.place(t), t)
            self.encoder.look(t)
