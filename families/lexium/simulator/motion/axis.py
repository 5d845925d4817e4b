"""The motion commands of a simulated MCode drive, the motion that is under way, and what the drive reports of it.

Positions are motor steps since power-up. `profile` is what the drive commands; the rotor follows it (`rotor`), and
the counters read both (`counters`). With EE=1 targets and speeds come in encoder counts and become steps here. A
motion that ends between two steps ends on the nearest one. Manual 5.1.8, 5.1.16, 5.1.17, 5.1.38, 5.1.80 to 5.1.88,
5.1.110, 5.1.117, 5.1.137, 5.1.139, 7.3.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import floor, inf
from typing import Protocol

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.simulator.motion.counters import Counters
from multidrop.families.lexium.simulator.motion.rotor import CATCHING, LexiumRotor
from multidrop.families.lexium.simulator.state.errors import DriveFault
from multidrop.families.lexium.simulator.state.expressions import Value
from multidrop.families.lexium.simulator.state.memory import Memory
from multidrop.simulator.kinematics import LINE, LINEAR, MotionPace, Profile, Shape, halt, move, slew


class Bridges:
    """The output bridges of one drive (manual 5.1.29, 5.1.127, 8.2).

    `powered`: the drive has power at all. `supply`: +V is there.
    `locked`: a locked rotor has switched the bridges off, until CF. `count_when_disabled`: with DE=0 the product counts
    moves, and does not refuse them.
    """

    def __init__(self, memory: Memory) -> None:
        self._values, self.count_when_disabled = memory.values, memory.model.disabled_moves
        self.powered = self.supply = True
        self.locked = False

    @property
    def enabled(self) -> bool:
        return bool(self._values["DE"])

    @property
    def driving(self) -> bool:
        """Return whether they can turn the motor: enabled, supplied, and not switched off by a locked rotor."""
        return bool(self._values["DE"]) and self.supply and not self.locked

    def check(self) -> None:
        """Check that a motion may be commanded at all. Raises DriveFault (94, 96)."""
        if self.locked or not (self.enabled or self.count_when_disabled):
            raise DriveFault(E.DRIVE_DISABLED)
        if not self.supply:
            raise DriveFault(E.NO_MOTOR_VOLTAGE)


STEEPEST = 1.1e9
"""The highest acceleration that a drive makes, steps/s2; an S-curve's peak may not be above it."""


class Backlash:
    """The compensation of play in the gear (manual 5.1.10 to 5.1.12): the loaded flank, the sum of what was added.

    Mode 0 (BM=0) adds |BL| to each move that reverses the axis; the counters show it. The sum of all that was added, in
    the unit of commands, is part of the targets of absolute moves until P is set again, so these stay true on both
    flanks. The first move counts as along the flank that is loaded already. Mode 1 passes a target by |BL| and returns,
    unless the move has the direction of BL's sign. So it reaches every target from one side.
    """

    def __init__(self, values: Mapping[str, Value]) -> None:
        self.values = values
        self.flank = 0
        self.added = 0

    def restart(self) -> None:
        self.flank = self.added = 0

    def forget(self) -> None:
        """Forget what was added: P has been set, and it is part of the position now."""
        self.added = 0

    def convert(self, ratio: float) -> None:
        self.added = round(self.added * ratio)

    def plan(self, distance: int, absolute: bool) -> tuple[int, int]:
        """The distance to go for a move, and the distance to go after that."""
        values = self.values
        if not values.get("BE"):
            self.flank, self.added = (distance > 0) - (distance < 0) or self.flank, 0
            return distance, 0
        amount, sign = abs(int(values["BL"])), 1 if values["BL"] >= 0 else -1
        if values["BM"]:
            loads = not distance or (distance > 0) == (sign > 0)
            return (distance, 0) if loads else (distance - sign * amount, sign * amount)
        if absolute:
            distance += self.added
        flank = (distance > 0) - (distance < 0)
        if flank and self.flank and flank != self.flank:
            self.added += flank * amount
            distance += flank * amount
        self.flank = flank or self.flank
        return distance, 0


MOVES, SLEW = ("MA", "MR"), "SL"
CORRECTION, HOMING, TORQUE = "correction", "homing", "torque"
"""Kinds of motion that no MA, MR or SL has asked for."""
FASTEST_COUNTS, FASTEST_STEPS = 200_000, 5_000_000
"""The range of SL (manual 5.1.117)."""


class Supervisor(Protocol):
    """What the axis asks before a motion, and informs of one: the motor, which the axis is built before."""

    @property
    def homing_active(self) -> bool:
        """Return whether a homing is under way, which other motions have to wait for."""

    def refuse(self, t: float, direction: float) -> int:
        """The code of what forbids a motion in a direction, or 0."""

    def motion_began(self) -> None:
        """Take note that a motion has taken the place of the one before."""


class Axis:
    """One motor. `kind` is what moves or moved it: MA, MR, SL, or one of the kinds above.

    `announce`: the drive's name is sent when the motion is over. `arriving`: the motion will end by itself. `mark` is
    when a motion that runs on passes its target (infinite: never), `back` the steps that follow the motion (BM=1).
    """

    def __init__(self, memory: Memory, rotor: LexiumRotor, counters: Counters, supervisor: Supervisor) -> None:
        self._memory, self._supervisor = memory, supervisor
        self.rotor, self.counters, self.bridges = rotor, counters, Bridges(memory)
        self.status = MotionStatus(self, memory, supervisor)
        self.backlash = Backlash(memory.values)
        self.profile: Profile = rotor.command
        self.kind = ""
        self.announce = False
        self.arriving = False
        self.mark = inf
        self.back = 0.0
        self.aligned = 0.0
        self._top = 0.0
        self._direction = 1.0
        self._stopping = False

    # The motion under way.

    def position(self, t: float) -> float:
        """Motor steps since power-up, as commanded."""
        return self.profile.position(t)

    def commanded(self, t: float) -> bool:
        """Return whether a motion is under way, or is being worked out and about to begin."""
        return t < self.profile.end

    def heading(self, t: float) -> float:
        """The velocity, or where a motion that is about to begin will go: its sign is the direction."""
        profile = self.profile
        return profile.velocity(t) if t >= profile.start else profile.target - profile.origin

    def at_rest(self, t: float) -> bool:
        """Return whether no motion is commanded."""
        return not self.commanded(t) and not self._supervisor.homing_active

    def direction(self, t: float) -> float:
        """1 or -1, the direction of the last motion."""
        return self.profile.direction(t) or self._direction

    # What is commanded.

    def go(self, kind: str, value: int, t: float, announce: bool = False, run_on: bool = False) -> None:
        """Carry out MA or MR. Raises DriveFault.

        `announce`: send the name when it is over; `run_on`: do not stop there.
        """
        counters = self.counters
        if not -0x80000000 <= value <= 0x7FFFFFFF:
            raise DriveFault(E.OUT_OF_RANGE)
        distance = value - counters.position(t) if kind == "MA" else value
        here, raw = self.profile.position(t), counters.raw(counters.source, t)
        self._ready(t, distance)
        if self.kind == CORRECTION and self.commanded(t):
            raise DriveFault(E.STILL_CORRECTING)
        velocity, pace = self.profile.velocity(t), self._pace()
        if self.kind in (SLEW, HOMING, TORQUE):
            self.backlash.flank = int(self.direction(t))
        first, after = self.backlash.plan(distance, absolute=kind == "MA")
        if run_on:  # and does not turn back
            first, after = first + after, 0
        place = counters.place_of_raw(raw + first) + counters.stator_shift(t)
        self.back = counters.place_of_raw(raw + first + after) - counters.place_of_raw(raw + first) if after else 0.0
        self._top = pace.vm
        begin = t if self.profile.moving(t) else t + self._memory.model.compute
        if run_on and (distance or velocity):
            signed = pace.vm if (distance or velocity) > 0 else -pace.vm
            self.begin(kind, slew(begin, here, velocity, signed, pace), t)
            self.mark = self.profile.crossing(place, t)
        else:
            self.begin(kind, move(begin, here, velocity, place, pace), t)
        self.announce = announce

    def slew(self, value: int, t: float) -> None:
        """Carry out SL: turn at a velocity, or slow down and stop. Raises DriveFault."""
        counting, fastest = self._memory.counting, self._memory.model.per_microstep
        if abs(value) > (FASTEST_COUNTS if counting else FASTEST_STEPS):
            raise DriveFault(E.OUT_OF_RANGE)
        if fastest and not counting and abs(value) > self._memory.values["MS"] * fastest:
            raise DriveFault(E.VELOCITY_TOO_HIGH)
        if value:
            self._ready(t, value)
        self.slow_to(value * self._memory.scale, t, stopping=not value and self.kind in MOVES)

    def slow_to(self, velocity: float, t: float, stopping: bool = False, kind: str = "") -> None:
        """Change to a velocity, steps/s, with the ramps in force. `kind`: what asks for it, if not SL."""
        if not velocity and t < self.profile.start:
            self.stop(t)
        if not velocity and not self.commanded(t):
            return
        here, now = self.profile.position(t), self.profile.velocity(t)
        default = SLEW if velocity or self.kind not in MOVES else self.kind
        self.back = 0.0
        self.begin(kind or default, slew(t, here, now, velocity, self._pace()), t)
        self._stopping, self.announce = stopping, False

    def correct(self, distance: float, t: float) -> None:
        """Go back to where the last motion should have ended: at VI, without ramps (PM)."""
        here, vi = self.profile.position(t), self._memory.values["VI"] * self._memory.scale
        self.begin(CORRECTION, move(t, here, 0.0, here + distance, MotionPace(vi, vi, 1.0, 1.0)), t)

    def step(self, steps: int, t: float) -> None:
        """Make a few steps at once, as a clock on the inputs asks for them (FL)."""
        if self.at_rest(t) and self.bridges.driving:
            self._direction = 1.0 if steps > 0 else -1.0
            self.profile = halt(t, self.profile.position(t) + steps)
            self.rotor.jump(self.profile, t)

    def stop(self, t: float, direction: int = 0) -> None:
        """Stand at once, without a ramp: on the nearest step, or on the next one in a direction."""
        here = self.profile.position(t)
        place = floor(here) + 1 if direction > 0 else -floor(-here) - 1 if direction < 0 else floor(here + 0.5)
        self._take(halt(t, place), t)
        self.kind, self.mark, self.back = "", inf, 0.0
        self.announce = self.arriving = self._stopping = False

    def begin(self, kind: str, profile: Profile, t: float) -> None:
        self.kind, self.mark = kind, inf
        self.arriving = profile.end < inf
        self._stopping = False
        self._supervisor.motion_began()
        if not self.rotor.closed:
            self.align(t)
        self._take(profile, t)
        if kind not in MOVES:
            self.announce = False

    def arrive(self, t: float) -> bool:
        """End the motion on a whole step, or go on with what follows. Return whether the name is sent."""
        self._take(halt(t, floor(self.profile.target + 0.5)), t)
        self.arriving = self._stopping = False
        if self.back:
            place, self.back = self.profile.position(t) + self.back, 0.0
            announce, pace = self.announce, self._pace()._replace(vm=self._top)
            self.begin(self.kind, move(t, self.profile.position(t), 0.0, place, pace), t)
            self.announce = announce
            return False
        announce, self.announce = self.announce, False
        return announce

    def forgo_way_back(self) -> None:
        """End the motion before its target: the steps that would follow may not be made."""
        self.back, self.announce = 0.0, False

    def pass_mark(self) -> bool:
        """Take note that a motion that runs on passes its target. Return whether the name is sent."""
        announce, self.announce, self.mark, self.kind = self.announce, False, inf, SLEW
        return announce

    def pause(self, t: float) -> Callable[[float], None]:
        """Slow down and stop; what is given goes on with the motion, and with the name that is to be sent."""
        goal_kind, goal = self.kind, self.profile.target
        if self.profile.end == inf:
            goal_kind, goal = SLEW, self.profile.segments[-1].velocity
        elif self.kind == SLEW:
            goal = 0.0
        kind, announce, back = self.kind, self.announce, self.back
        place = None if self.mark == inf else self.profile.position(self.mark)
        self.slow_to(0, t)
        if place is not None and (mark := self.profile.crossing(place, t)) < inf:
            self.mark, self.announce = mark, announce
            kind, announce, place = SLEW, False, None
        else:
            self.announce = False

        def go_on(t: float) -> None:
            here, now = self.profile.position(t), self.profile.velocity(t)
            if distance := goal if goal_kind == SLEW else goal - here:
                self._ready(t, distance)
            if goal_kind == SLEW:
                self.slow_to(goal, t)
            elif goal_kind == CORRECTION:
                self.correct(distance, t)
            else:
                self.begin(goal_kind, move(t, here, now, goal, self._pace()), t)
            self.back = back
            if place is not None:
                self.kind, self.mark = kind, self.profile.crossing(place, t)
            self.announce = announce

        return go_on

    def _take(self, profile: Profile, t: float) -> None:
        self._direction = self.direction(t)
        self.profile = profile
        self.rotor.follow(profile, t)

    def align(self, t: float) -> None:
        """Count what the rotor should reach from where it is."""
        self.aligned = self.profile.position(t) - self.rotor.position(t)

    def restart(self, t: float) -> None:
        """Power-up or reset: stand, where the rotor is."""
        self.stop(t)
        self.rotor.release(t)
        self.aligned = self.rotor.slip
        self.backlash.restart()

    # What is checked.

    def allow(self, t: float, direction: float) -> None:
        """Check that the bridges may turn the motor in a direction. Raises DriveFault (83, 84, 85, 88, 94, 96)."""
        self.bridges.check()
        code = self._supervisor.refuse(t, direction)
        if code:
            raise DriveFault(code)

    def check_ramps(self) -> None:
        """Check that a motion may begin with these S-curves. Raises DriveFault (98, 99) for too steep a middle."""
        values = self._memory.values
        if values.get("AT", LINEAR) == LINEAR == values.get("DT", LINEAR):
            return
        for shape, rate, code in (("AT", "A", E.NO_ACCELERATION_FITS), ("DT", "D", E.NO_DECELERATION_FITS)):
            if self._shape(shape, rate) is None:
                raise DriveFault(code)

    def _pace(self) -> MotionPace:
        """VI, VM, A and D in steps (manual 5.1.7, 5.1.9, 5.1.27, 5.1.30) with both ramps.

        They are straight where a curve would be too steep, as a stop is never refused.
        """
        values, scale = self._memory.values, self._memory.scale
        up, down = self._shape("AT", "A") or LINE, self._shape("DT", "D") or LINE
        vi, vm, a, d = (values[word] * scale for word in ("VI", "VM", "A", "D"))
        return MotionPace(vi, vm, a, d, up, down)

    def _shape(self, kind: str, rate: str) -> Shape | None:
        """Make a shape of AT and AJ, or DT and DJ; None where the middle of the ramp would be too steep."""
        values = self._memory.values
        if (number := values.get(kind, LINEAR)) == LINEAR:
            return LINE
        shape = Shape(int(number), int(values.get(f"{rate}J", 0)))
        return shape if values[rate] * self._memory.scale * shape.peak <= STEEPEST else None

    def _ready(self, t: float, direction: float) -> None:
        """Check that a motion may begin at all. Raises DriveFault."""
        if self._supervisor.homing_active or (self._stopping and self.commanded(t)):
            raise DriveFault(E.HOMING_OR_MOVING)
        self.allow(t, direction)
        self.check_ramps()

    # What a motor step and an encoder count are: EE, AS, MS, SA, EL, RD. The rotor stays where it is.

    def set_counter(self, name: str, value: int, t: float) -> None:
        self.counters.set(name, value, t)
        if name == self.counters.source:
            self.backlash.forget()

    def switch_unit(self, word: str, value: int, t: float) -> None:
        """Change EE or AS, and with them perhaps the unit of commands."""
        if value == self._memory.values[word]:
            return
        unit = self._memory.scale
        self.rescale(lambda: self._memory.switch(word, value), t)
        self.backlash.convert(unit / self._memory.scale)
        self.align(t)

    def rescale(self, change: Callable[[], None], t: float) -> None:
        """Change what a step and a count are: the encoder goes on counting where it is."""
        self.counters.hold_counts(t)
        change()
        self.orient(t)

    def orient(self, t: float) -> None:
        """Keep the rotor where it is after MS, SA or RD may have changed."""
        self.rotor.orient(t, self._memory.steps_per_turn, bool(self._memory.values.get("RD")))


class MotionStatus:
    """The flags and values that a drive reports of its motion: MV, MP, VC, V, AV, I6, and when a motion is over."""

    def __init__(self, axis: Axis, memory: Memory, supervisor: Supervisor) -> None:
        self._memory, self._values, self._model = memory, memory.values, memory.model
        self._axis, self._rotor, self._supervisor = axis, axis.rotor, supervisor

    def speed(self, t: float) -> int:
        """V: signed velocity as commanded, steps/s; counts/s with EE=1; 0 in torque mode."""
        return 0 if self._axis.kind == TORQUE else round(self._axis.profile.velocity(t) / self._memory.scale)

    def rotor_speed(self, t: float) -> int:
        """AV: what the rotor does, steps/s; 0 without hMT."""
        return round(self._rotor.velocity(t)) if self._values.get("AS") else 0

    def moving(self, t: float) -> bool:
        """Return whether pulses are put out, or about to be; those of make-up are some too."""
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
        if late == inf and abs(rotor.lag(axis.profile.end)) < self._memory.bound:
            late = -inf
        return max(axis.profile.end, late)

    def settled_at(self) -> float:
        """When what H waits for is over: the motion, then MT."""
        return self.over_at() + self._values["MT"] / 1000

    def at_index(self, t: float) -> bool:
        """I6: whether the encoder is at its index mark."""
        here, reach = self._rotor.position(t), self._memory.steps_per_count / 2
        return self._rotor.frame.index_ahead(here - reach, 1) <= here + reach
