"""The parts of a simulated drive's motion, put together: what they see, and what happens next.

The axis moves, the rotor follows; homing, limits, encoder, hMT, heat and the clock inputs watch both and command the
axis in turn. The device asks `next` for the next event and lets it happen; `look` reads what has changed from outside.
The configuration test (SC) makes half a turn and compares what the encoder has seen of it. The jog inputs (types 7 and
8) turn at VM while one of them is active and JE=1; chosen where the manual is silent: a jog does not change another
motion, and both inputs at once cancel each other. Manual 3.4.3, 5.1.64, 5.1.103, 5.1.112, 5.1.115, 7.2.3.

Current and temperature. The current is RC while the motor turns and for MT and HT after it, then HC (RC stays where
both are 0); in torque mode TQ; with AS=2 what the load asks for, a quarter of RC at least; none while the bridges are
off. The bridge heats up towards 35 degrees C and 25 more at full current without load, in proportion to (1 + load) and
to the square of the current, with a time constant of 300 s; the controller half as much. These figures are plausible,
no more: loads of 1 and more at currents near 100 % reach WT (71) and the limit of 85 (72, bridges off). The times of
both are solved. Manual 5.1.51, 5.1.55, 5.1.67, 5.1.86, 5.1.109, 5.1.143.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, inf, log

from multidrop.families.lexium.manual.errors import JOG_IN_CLOCK_MODE
from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.simulator.motion.axis import HOMING, SLEW, Axis
from multidrop.families.lexium.simulator.motion.counters import DIRECTIONS, Counters, DriveLimits, Trips
from multidrop.families.lexium.simulator.motion.feedback import VARIABLE, Encoder, Hmt, TorqueMode
from multidrop.families.lexium.simulator.motion.homing import LexiumHoming, LimitStop
from multidrop.families.lexium.simulator.motion.inputs import HOME, JOG_MINUS, JOG_PLUS, ClockInputs, Inputs
from multidrop.families.lexium.simulator.motion.rotor import LexiumRotor
from multidrop.families.lexium.simulator.state.errors import CRLF, DriveFault, Event, nothing, when
from multidrop.families.lexium.simulator.state.interpreter import Core
from multidrop.simulator.kinematics import MotionPace, move

AMBIENT, RISE, TIME_CONSTANT = 35.0, 25.0, 300.0
HOTTEST = 85.0
LEAST_SHARE = 0.25


class Heat:
    """The temperature of one drive: an exponential from where it was at a time towards where it would end."""

    def __init__(self, core: Core, axis: Axis, torque: TorqueMode, disable: Callable[[float], None]) -> None:
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


TEST = "test"
"""The kind of motion that SC makes."""


class LexiumMotor:
    """The motor of one drive. It is the axis's supervisor. `jog` is the direction of the jog, 0 while there is none."""

    def __init__(self, core: Core) -> None:
        self._core, self._memory, self._timeline = core, core.memory, core.timeline
        self.rotor = rotor = LexiumRotor(core)
        self.inputs = inputs = Inputs(core, rotor)
        self.counters = Counters(core.memory, rotor)
        self.axis = axis = Axis(core.memory, rotor, self.counters, self)
        self.status, self.bridges = axis.status, axis.bridges
        self.limits = limits = DriveLimits(self.counters)
        self.trips = Trips(core, self.counters, inputs)
        self.homing = LexiumHoming(core, axis, inputs, limits)
        self.limit_stop = LimitStop(core, axis, inputs, limits, self.homing)
        self.encoder = Encoder(core, axis, limits, self.stop)
        self.torque = TorqueMode(core, axis, limits)
        self.hmt = Hmt(core, axis, self.torque, self.trips, self.stop)
        self.heat = Heat(core, axis, self.torque, lambda t: self.enable(0, t))
        self.jog = 0
        self._tested_from = 0.0
        self._clock = ClockInputs(core, inputs)

    # What the axis asks.

    @property
    def homing_active(self) -> bool:
        return self.homing.phase != ""

    def refuse(self, t: float, direction: float) -> int:
        if self.hmt.calibrating or (self.axis.kind == TEST and self.axis.profile.moving(t)):
            return E.MOVE_WHILE_CALIBRATING
        return E.HOMING_OR_MOVING if self.torque.active else self.limits.refuse(t, direction)

    def motion_began(self) -> None:
        """End what another kind of motion was about: a motion has begun."""
        self.encoder.begin()
        if self.axis.kind != HOMING:
            self.homing.cancel()

    # What happens.

    def next(self, t: float) -> Event:
        axis = self.axis
        return min(
            self.limit_stop.next(t),
            self.rotor.next(t),
            self.hmt.next(t),
            (axis.profile.end if axis.arriving else inf, self._arrive),
            (self.homing.mark_at(t), self.homing.pass_mark),
            (axis.mark, self._pass_mark),
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
        # Make the steps that a clock asks for, where the command may jump.
        steps = self._clock.steps()
        if steps and not self.hmt.calibrating and not self.torque.active and not self.limit_stop.bars(t, steps):
            before = self.counters.place(t)
            self.axis.step(steps, t)
            self._timeline.replan()
            self.trips.displaced(before, self.counters.place(t), t)
            self.encoder.look(t)
        # See which limit switches are active; a clock knows no limits (MDrivePlus 5-13).
        switches = self.limits.switches
        switches.clear()
        if not self._memory.values.get("CM"):
            for kind in self.inputs.active_types():
                if kind in DIRECTIONS:
                    switches.add(DIRECTIONS[kind])

    def input_changed(self, kind: int, active: bool, t: float) -> None:
        """Act on an input of a type that acts on motion."""
        if kind == HOME:
            self.homing.home(active, t)
        elif kind in DIRECTIONS and active and not self._memory.values.get("CM"):
            self.limit_stop.reach(DIRECTIONS[kind], t)

    # What is commanded.

    def stop(self, t: float) -> None:
        self.homing.cancel()
        self.axis.stop(t)
        self.encoder.begin()
        self.end_jog()

    def pause_program(self) -> None:
        """Carry out PS: the program pauses; the motion slows down and stops. Raises DriveFault (40)."""
        thread, t = self._core.thread, self._timeline.now
        if not thread.running:
            raise DriveFault(E.NO_PROGRAM_RUNNING)
        again: Callable[[float], None] | None = None
        if not thread.paused and self.status.moving(t):
            if self.torque.halt():
                again = self.torque.go_on
            elif (again := self.homing.again()) is None:
                again = self.axis.pause(t)
            else:
                self.axis.slow_to(0, t)
        thread.pause(again)

    def resume_program(self) -> None:
        """Carry out RS. Raises DriveFault (40, 41, and the motion's own where it may not begin again)."""
        thread, t = self._core.thread, self._timeline.now
        if not thread.paused:
            raise DriveFault(E.PROGRAM_RUNNING if thread.running else E.NO_PROGRAM_RUNNING)
        again = thread.go_on(t)
        if again is not None:
            again(t)

    def slew(self, velocity: int, t: float) -> None:
        """Carry out SL; 0 stops torque mode too."""
        if velocity or not self.torque.halt():
            self.axis.slew(velocity, t)

    def start_test(self, t: float) -> None:
        """Carry out SC 1. Raises DriveFault (89, 94, 96, 103)."""
        memory, values, axis = self._memory, self._memory.values, self.axis
        if not self.bridges.enabled:
            raise DriveFault(E.NOT_TESTED)
        if self.status.moving(t):
            raise DriveFault(E.CALIBRATION_WHILE_MOVING)
        axis.allow(t, 1.0)
        here, vi = axis.position(t), values["VI"] * memory.scale
        self._tested_from = self.rotor.position(t)
        top, rate = values["VM"] * memory.scale, values["A"] * memory.scale
        target = here + memory.steps_per_turn / 2
        axis.begin(TEST, move(t, here, 0.0, target, MotionPace(vi, top, rate, rate)), t)
        self._timeline.replan()

    def update_jog(self) -> None:
        """Turn as the jog inputs and JE say now; a motion that may not begin is an error that no line has caused."""
        t, before, wanted, values, inputs = self._timeline.now, self.jog, 0, self._memory.values, self.inputs
        try:
            if values["JE"] and inputs.watched:
                if values.get("CM"):
                    raise DriveFault(JOG_IN_CLOCK_MODE)
                wanted = inputs.wants(JOG_PLUS) - inputs.wants(JOG_MINUS)
            if wanted == before or (not before and self.status.moving(t)):
                return
            self.jog = 0
            self._timeline.replan()
            if wanted:
                self.axis.slew(wanted * int(values["VM"]), t)
                self.jog = wanted
            elif self.axis.kind == SLEW:
                self.axis.slow_to(0, t)
                self._core.thread.drop_motion()
        except DriveFault as fault:
            self._core.interpreter.raise_error(fault.code)

    def end_jog(self) -> None:
        """Forget the jog: its input, once released, then stops nothing that was begun since."""
        self.jog = 0

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
        """Switch +V. Return whether it is lost."""
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
        self.axis.rescale(load, t)
        if was != (self._memory.counting, values["DE"]):
            self.axis.align(t)
        self.hmt.changed(mode, t)
        self.hmt.tune()

    def restart(self, t: float) -> None:
        self.homing.cancel()
        self.encoder.restart()
        self.hmt.restart()
        self.axis.restart(t)
        self.axis.orient(t)
        self.counters.restart(t)
        self.limits.switches.clear()
        self.jog = 0
        self.hmt.tune()

    def _arrive(self, t: float) -> None:
        self.encoder.arrive(t)
        seen = self.rotor.position(t) - self._tested_from
        if self.axis.kind == TEST and abs(seen - self._memory.steps_per_turn / 2) > 1:
            self._core.interpreter.raise_error(E.ENCODER_RESOLUTION_WRONG)
        self.hmt.arrive(t)
        self.limit_stop.turn_back(t)
        if self.axis.arrive(t):
            self._announce()
        if self.homing.phase:
            self.homing.arrive(t)

    def _pass_mark(self, t: float) -> None:
        if self.axis.pass_mark():
            self._announce()

    def _announce(self) -> None:
        self._core.printer.emit(self._memory.name + CRLF)
