"""One motor of a simulated TMCL module: its ramp generator, axis parameters, limit switches, reference search.

Rulings where the manuals are silent: a limit switch stops the motor at once and lets it run away from it; MVP REL
counts from the last target, with parameter 127 at 1 or 2 from the actual position; a position beyond 32 bits wraps
around, and a move takes the shorter way; an acceleration of 0 acts as 1. Parameter 206 is FREE while the motor turns
without load, less by the world's load, or by the part of the torque that a cell's `motor` needs, and 0 at rest or in a
stall; a stall at the velocity of parameter 181 or above stops the motor at once.

The reference search (RFS) is a sequence of steps by the mode in axis parameter 193. Ruling: the motor turns to a switch
at the search velocity, stops at once where it closes, and leaves it at the switch velocity; where it opens is position
0. "From both sides" adds a turn back at the switch velocity: position 0 is then where the switch closes again. Modes 2
and 3 keep the distance of the end switches in parameter 196; 197 keeps the position that became 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import NamedTuple

from multidrop.families.tmcl.manual.commands import AxisParameter
from multidrop.families.tmcl.manual.modules import INVERTED, MIRRORED, Module
from multidrop.families.tmcl.manual.parameters import RAMPS
from multidrop.simulator.kinematics import Effort, MotionPace, halt, move, slew
from multidrop.simulator.world import REVOLUTION, Shaft, World

FULL = 256
"""Microsteps of a full step, which is one motor step of the world."""
CLOCK = 16e6
"""The clock of a TMC428 or TMC429, Hz."""
FREE = 1023
"""The load value (parameter 206) of a motor that turns without load."""
FULL_CURRENT = 255
"""Parameter 6 at full current."""
FROM_TARGET = 0
"""The value of parameter 127 with which MVP REL counts from the last target."""


class TmclMotor:
    """One motor. Times are seconds, positions microsteps. `positioning`: it aims at a position, else at a velocity."""

    def __init__(self, world: World, module: Module) -> None:
        self.shaft = Shaft(world)
        self.parameters = {number: row.fresh for number, row in module.axis.items()}
        self.search: ReferenceSearch | None = None
        self.passes_limits = False
        """No limit switch holds it, for a search of the home switch alone."""
        self._chip_units = module.chip_units
        self._profile = halt(0.0, 0.0)
        self.positioning = True
        self._target = 0

    def read(self, number: int, t: float) -> int:
        home, right, left = self.shaft.switches(t)
        measured = {
            AxisParameter.TARGET_POSITION: self._target,
            AxisParameter.ACTUAL_POSITION: self.position(t),
            AxisParameter.ACTUAL_VELOCITY: round(self._profile.velocity(t) / self._units[0]),
            AxisParameter.POSITION_REACHED: int(self.reached(t)),
            AxisParameter.HOME_SWITCH: int(home),
            AxisParameter.RIGHT_SWITCH: int(right),
            AxisParameter.LEFT_SWITCH: int(left),
            AxisParameter.LOAD: round(FREE * (1 - self.shaft.used(t))) if self.moving(t) and self.shaft.factor else 0,
        }
        return measured[AxisParameter(number)] if number in measured else self.parameters[number]

    @property
    def effort(self) -> Effort:
        turn = REVOLUTION / FULL * 2 ** self.parameters[AxisParameter.MICROSTEPS]
        fastest = max((abs(segment.velocity) for segment in self._profile.segments), default=0.0)
        stalls = 0 < self._stall_speed <= fastest
        return Effort(self._profile, turn, current=self.shaft.current, stalls=stalls)

    def position(self, t: float) -> int:
        """The actual position, within 32 bits."""
        return wrapped(round(self._profile.position(t)))

    def moving(self, t: float) -> bool:
        return self._profile.moving(t)

    def reached(self, t: float) -> bool:
        return self.position(t) == self._target and not self.moving(t)

    def write(self, number: int, value: int, t: float) -> None:
        """Set an axis parameter; the value is in range."""
        if number == AxisParameter.TARGET_POSITION:
            self.go(value, t)
        elif number == AxisParameter.TARGET_VELOCITY:
            self.rotate(value, t)
        elif number == AxisParameter.ACTUAL_POSITION:
            self._follow_from(float(value), self._profile.velocity(t), t)  # here; on its way to a target it moves on
        else:
            self.parameters[number] = value
            if number in (AxisParameter.MICROSTEPS, AxisParameter.RUN_CURRENT):
                self._hand_on(t)
            elif number in RAMPS and (self.moving(t) or (self.positioning and not self.reached(t))):
                self._plan(t)

    def go(self, target: int, t: float) -> None:
        self.positioning, self._target = True, wrapped(target)
        self._plan(t)

    def go_by(self, distance: int, t: float) -> None:
        """Move by a distance from the last target, or from here, as parameter 127 says."""
        here = self.parameters.get(AxisParameter.RELATIVE_FROM, FROM_TARGET) != FROM_TARGET
        self.go((self.position(t) if here else self._target) + distance, t)

    def rotate(self, velocity: int, t: float) -> None:
        """Turn at a velocity, and on; 0 slows down to rest."""
        self.positioning = False
        self.parameters[AxisParameter.TARGET_VELOCITY] = velocity
        self._plan(t)

    def stand_at(self, position: int, t: float, target: int | None = None) -> None:
        """Give its present place this position, which is the target too unless the last move was broken off."""
        self._target = position if target is None else target
        self.positioning = self._target == position
        self._profile = halt(t, float(position))
        self._hand_on(t)

    def put(self, position: int, t: float) -> None:
        """Stand, and give its place this position. MVP REL counts on from a target that was not reached."""
        if self.reached(t):
            self._target = position
        else:
            self.freeze(t)
        self._profile = halt(t, float(position))
        self._hand_on(t)

    def freeze(self, t: float) -> None:
        """Stand at once, without a ramp."""
        self.positioning = False
        self.parameters[AxisParameter.TARGET_VELOCITY] = 0
        self._profile = halt(t, float(round(self._profile.position(t))))
        self._hand_on(t)

    def power(self, on: bool, t: float) -> None:
        """Switch the driver; it wakes up standing at position 0."""
        self.shaft.powered = on
        self.end_search()
        self.stand_at(0, t)
        self.parameters[AxisParameter.TARGET_VELOCITY] = 0

    def events(self, after: float) -> Iterator[float]:
        yield from self.shaft.events(after)
        if self.moving(after) and self._profile.end < inf:
            yield self._profile.end
        if self._stall_speed and not self.shaft.factor:  # when it becomes that fast
            for segment in self._profile.segments:
                if segment.acceleration:
                    yield (
                        segment.start
                        + (self._stall_speed * segment.direction - segment.velocity) / segment.acceleration
                    )

    def seek(self, t: float) -> None:
        self.search = ReferenceSearch(self, self.parameters[AxisParameter.SEARCH_MODE], t)

    def end_search(self) -> None:
        self.search, self.passes_limits = None, False

    def live(self, t: float) -> None:
        self.shaft.settle(t)
        if self.search is not None and self.search.over(t):
            self.end_search()
        fast = abs(self._profile.velocity(t)) >= self._stall_speed * (1 - 1e-9)
        stalled = self._stall_speed and not self.shaft.factor and fast
        if self.moving(t) and (stalled or self._blocked(self._profile.direction(t), t)):
            self.freeze(t)

    @property
    def _stall_speed(self) -> float:
        """From this velocity on a stall stops it, microsteps/s; 0: never."""
        return self.parameters.get(AxisParameter.STALL_VELOCITY, 0) * self._units[0]

    @property
    def _units(self) -> tuple[float, float]:
        """A unit of velocity in microsteps/s, and one of acceleration in microsteps/s2."""
        if not self._chip_units:
            return 1.0, 1.0
        pulse, ramp = self.parameters[AxisParameter.PULSE_DIVISOR], self.parameters[AxisParameter.RAMP_DIVISOR]
        return CLOCK / (2**pulse * 2048 * 32), CLOCK**2 / 2 ** (pulse + ramp + 29)

    def _blocked(self, way: float, t: float) -> bool:
        if self.passes_limits:
            return False
        _, right, left = self.shaft.switches(t)
        if way > 0:
            return right and not self.parameters[AxisParameter.RIGHT_LIMIT_OFF]
        return left and not self.parameters[AxisParameter.LEFT_LIMIT_OFF]

    def _plan(self, t: float) -> None:
        self._follow_from(self._profile.position(t), self._profile.velocity(t), t)

    def _follow_from(self, position: float, velocity: float, t: float) -> None:
        of_velocity, of_rate = self._units
        rate = max(1, self.parameters[AxisParameter.MAXIMUM_ACCELERATION]) * of_rate
        pace = MotionPace(0.0, self.parameters[AxisParameter.MAXIMUM_VELOCITY] * of_velocity, rate, rate)
        if not self.positioning or not pace.vm:
            wanted = 0 if self.positioning else self.parameters[AxisParameter.TARGET_VELOCITY]
            self._profile = slew(t, position, velocity, wanted * of_velocity, pace)
        else:
            here = round(position)
            place = float(here + wrapped(self._target - here))
            self._profile = move(t, position, velocity, place, pace)
        if self.moving(t) and self._blocked(self._profile.direction(t), t):
            self.freeze(t)
        else:
            self._hand_on(t)

    def _hand_on(self, t: float) -> None:
        self.shaft.scale = FULL / 2 ** self.parameters[AxisParameter.MICROSTEPS]
        self.shaft.current = min(1.0, self.parameters[AxisParameter.RUN_CURRENT] / FULL_CURRENT)
        self.shaft.follow(self._profile, t)


def wrapped(position: int) -> int:
    """A number as a signed one of 32 bits."""
    return (position + 2**31) % 2**32 - 2**31


HOME, RIGHT, LEFT = 0, 1, 2
"""Places in what `Shaft.switches` gives."""


class SearchStep(NamedTuple):
    """Turn, to the right with 1 and to the left with -1, until a switch is closed or open."""

    way: int
    switch: int
    closed: bool = True
    speed: AxisParameter = AxisParameter.SEARCH_SPEED


TO_RIGHT, TO_LEFT = SearchStep(1, RIGHT), SearchStep(-1, LEFT)
OFF_LEFT, INTO_LEFT = (
    SearchStep(1, LEFT, False, AxisParameter.SWITCH_SPEED),
    SearchStep(-1, LEFT, True, AxisParameter.SWITCH_SPEED),
)


def _home(way: int) -> tuple[SearchStep, ...]:
    return SearchStep(way, HOME), SearchStep(-way, HOME, False, AxisParameter.SWITCH_SPEED)


ROUTES: dict[int, tuple[SearchStep, ...]] = {
    1: (TO_LEFT, OFF_LEFT),
    2: (TO_RIGHT, TO_LEFT, OFF_LEFT),
    3: (TO_RIGHT, TO_LEFT, OFF_LEFT, INTO_LEFT),
    4: (TO_LEFT, OFF_LEFT, INTO_LEFT),
    5: _home(-1),
    6: _home(1),
    7: _home(1),
    8: _home(-1),
}
"""The steps of each mode."""
TURNS = {5: LEFT, 6: RIGHT}
"""The end switch at which a search for the home switch turns back: past it, and to it again from its own side."""
PASSING = (7, 8)
"""The modes in which no end switch counts."""


class ReferenceSearch:
    """One search of a motor. `number` is that of its step, from 1: what RFS STATUS replies with."""

    def __init__(self, motor: TmclMotor, mode: int, t: float) -> None:
        self._motor = motor
        self._inverted = bool(mode & INVERTED)
        base = mode % MIRRORED
        self._turn = TURNS.get(base)
        self._steps = list(ROUTES[base])
        if mode & MIRRORED:
            self._steps = [step._replace(way=-step.way, switch=RIGHT + LEFT - step.switch) for step in self._steps]
        self._ends: list[int] = []
        """Where the end switches were closed."""
        self.number = 0
        motor.passes_limits = base in PASSING
        self._enter(t)

    @property
    def awaited(self) -> str:
        """The switch that ends its step by closing; empty: none."""
        step = self._steps[0]
        return ("home", "limit_plus", "limit_minus")[step.switch] if step.closed else ""

    def over(self, t: float) -> bool:
        """Take the steps that are due; whether none is left."""
        while self._steps:
            step = self._steps[0]
            if self._turn is not None and self._motor.shaft.switches(t)[self._turn] and self._at(step, t) is False:
                back = [step._replace(way=-step.way), step._replace(way=-step.way, closed=False)]
                self._steps, self._turn = [*back, *self._steps], None
                self._motor.freeze(t)
            elif self._at(step, t):
                self._leave(t)
            else:
                return False
            if self._steps:
                self._enter(t)
        return True

    def _at(self, step: SearchStep, t: float) -> bool:
        closed = self._motor.shaft.switches(t)[step.switch]
        return (closed is not self._inverted if step.switch == HOME else closed) is step.closed

    def _leave(self, t: float) -> None:
        """End a step; after the last one the motor stands at position 0."""
        motor, step = self._motor, self._steps.pop(0)
        motor.freeze(t)
        if step.switch != HOME and step.speed == AxisParameter.SEARCH_SPEED:
            self._ends.append(motor.position(t))
        if len(self._ends) > 1:
            motor.parameters[AxisParameter.SWITCH_DISTANCE] = abs(wrapped(self._ends[0] - self._ends[1]))
        if not self._steps:
            motor.parameters[AxisParameter.SEARCH_POSITION] = motor.position(t)
            motor.stand_at(0, t)

    def _enter(self, t: float) -> None:
        step = self._steps[0]
        self.number += 1
        self._motor.rotate(step.way * self._motor.parameters[step.speed], t)
