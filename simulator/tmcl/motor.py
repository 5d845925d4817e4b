"""One motor of a simulated TMCL module: its ramp generator, axis parameters, limit switches, reference search.

Rulings where the manuals are silent: a limit switch stops the motor at once and lets it run away from it; MVP REL
counts from the last target, with parameter 127 at 1 or 2 from the actual position; a position beyond 32 bits wraps
around, and a move takes the shorter way.

The reference search (RFS) is a machine of phases. Modes (axis parameter 193): 1 the left switch; 2 the right one, then
the left one; 3 the right one, then the home switch. Ruling: the motor turns to a switch at the search velocity, stops
at once where it closes, and leaves it at the switch velocity; where it opens is position 0. Mode 2 keeps the distance
between the two switches in parameter 196.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from itertools import pairwise
from math import inf

from multidrop.dialects.tmcl.manual.commands import AXIS, Axis
from multidrop.simulator.kinematics import halt, move, slew
from multidrop.simulator.world import Shaft, World

FULL = 256
"""Microsteps of a full step, which is one motor step of the world."""
STORED = tuple(number for number, row in AXIS.items() if row.writable and number > Axis.TARGET_VELOCITY)
"""Parameters that EEPROM holds."""
FROM_TARGET = 0
"""The value of parameter 127 with which MVP REL counts from the last target."""


class Motor:
    """One motor. Times are seconds, positions microsteps. `positioning`: it aims at a position, else at a velocity."""

    def __init__(self, world: World) -> None:
        self.shaft = Shaft(world)
        self.parameters = {number: row.fresh for number, row in AXIS.items()}
        self._profile = halt(0.0, 0.0)
        self.positioning = True
        self._target = 0

    def read(self, number: int, t: float) -> int:
        home, right, left = self.shaft.switches(t)
        measured = {
            Axis.TARGET_POSITION: self._target,
            Axis.ACTUAL_POSITION: self.position(t),
            Axis.ACTUAL_VELOCITY: round(self._profile.velocity(t)),
            Axis.POSITION_REACHED: int(self.reached(t)),
            Axis.HOME_SWITCH: int(home),
            Axis.RIGHT_SWITCH: int(right),
            Axis.LEFT_SWITCH: int(left),
        }
        return measured[Axis(number)] if number in measured else self.parameters[number]

    def position(self, t: float) -> int:
        """The actual position, within 32 bits."""
        return wrapped(round(self._profile.position(t)))

    def moving(self, t: float) -> bool:
        return self._profile.moving(t)

    def reached(self, t: float) -> bool:
        return self.position(t) == self._target and not self.moving(t)

    def write(self, number: int, value: int, t: float) -> None:
        """Set an axis parameter; the value is in range."""
        if number == Axis.TARGET_POSITION:
            self.go(value, t)
        elif number == Axis.TARGET_VELOCITY:
            self.rotate(value, t)
        elif number == Axis.ACTUAL_POSITION:
            self._follow_from(float(value), self._profile.velocity(t), t)  # here; on its way to a target it moves on
        else:
            self.parameters[number] = value
            if number == Axis.MICROSTEPS:
                self._hand_on(t)
            elif number in (Axis.MAXIMUM_VELOCITY, Axis.MAXIMUM_ACCELERATION) and (
                self.moving(t) or (self.positioning and not self.reached(t))
            ):
                self._plan(t)

    def go(self, target: int, t: float) -> None:
        self.positioning, self._target = True, wrapped(target)
        self._plan(t)

    def go_by(self, distance: int, t: float) -> None:
        """Move by a distance from the last target, or from here, as parameter 127 says."""
        here = self.parameters[Axis.RELATIVE_FROM] != FROM_TARGET
        self.go((self.position(t) if here else self._target) + distance, t)

    def rotate(self, velocity: int, t: float) -> None:
        """Turn at a velocity, and on; 0 slows down to rest."""
        self.positioning = False
        self.parameters[Axis.TARGET_VELOCITY] = velocity
        self._plan(t)

    def stand_at(self, position: int, t: float) -> None:
        """Give its present place this position, which is the target too."""
        self.positioning, self._target = True, position
        self._profile = halt(t, float(position))
        self._hand_on(t)

    def freeze(self, t: float) -> None:
        """Stand at once, without a ramp."""
        self.positioning = False
        self.parameters[Axis.TARGET_VELOCITY] = 0
        self._profile = halt(t, float(round(self._profile.position(t))))
        self._hand_on(t)

    def power(self, on: bool, t: float) -> None:
        """Switch the driver; it wakes up standing at position 0."""
        self.shaft.powered = on
        self.stand_at(0, t)
        self.parameters[Axis.TARGET_VELOCITY] = 0

    def events(self, after: float) -> Iterator[float]:
        yield from self.shaft.events(after)
        if self.moving(after) and self._profile.end < inf:
            yield self._profile.end

    def live(self, t: float) -> None:
        self.shaft.settle(t)
        if self.moving(t) and self._blocked(self._profile.direction(t), t):
            self.freeze(t)

    def _blocked(self, way: float, t: float) -> bool:
        _, right, left = self.shaft.switches(t)
        if way > 0:
            return right and not self.parameters[Axis.RIGHT_LIMIT_OFF]
        return left and not self.parameters[Axis.LEFT_LIMIT_OFF]

    def _plan(self, t: float) -> None:
        self._follow_from(self._profile.position(t), self._profile.velocity(t), t)

    def _follow_from(self, position: float, velocity: float, t: float) -> None:
        rate, speed = float(self.parameters[Axis.MAXIMUM_ACCELERATION]), float(self.parameters[Axis.MAXIMUM_VELOCITY])
        if not self.positioning or not speed:
            wanted = 0 if self.positioning else self.parameters[Axis.TARGET_VELOCITY]
            self._profile = slew(t, position, velocity, float(wanted), vi=0.0, a=rate, d=rate)
        else:
            here = round(position)
            place = float(here + wrapped(self._target - here))
            self._profile = move(t, position, velocity, place, vi=0.0, vm=speed, a=rate, d=rate)
        if self.moving(t) and self._blocked(self._profile.direction(t), t):
            self.freeze(t)
        else:
            self._hand_on(t)

    def _hand_on(self, t: float) -> None:
        self.shaft.scale = FULL / 2 ** self.parameters[Axis.MICROSTEPS]
        self.shaft.follow(self._profile, t)


def wrapped(position: int) -> int:
    """A number as a signed one of 32 bits."""
    return (position + 2**31) % 2**32 - 2**31


HOME, RIGHT, LEFT = 0, 1, 2
"""Places in what `Shaft.switches` gives."""


class Phase(Enum):
    """What a search does now."""

    TO_RIGHT = "turn right until the right switch closes"
    TO_LEFT = "turn left until the left switch closes"
    TO_HOME = "turn left until the home switch closes"
    OFF_LEFT = "turn right until the left switch opens"
    OFF_HOME = "turn right until the home switch opens"
    DONE = "stand at position 0"


ROUTES: dict[int, tuple[Phase, ...]] = {
    1: (Phase.TO_LEFT, Phase.OFF_LEFT, Phase.DONE),
    2: (Phase.TO_RIGHT, Phase.TO_LEFT, Phase.OFF_LEFT, Phase.DONE),
    3: (Phase.TO_RIGHT, Phase.TO_HOME, Phase.OFF_HOME, Phase.DONE),
}
"""The phases of each mode."""
STEPS: dict[Phase, tuple[int, int, bool, Axis]] = {
    Phase.TO_RIGHT: (1, RIGHT, True, Axis.SEARCH_SPEED),
    Phase.TO_LEFT: (-1, LEFT, True, Axis.SEARCH_SPEED),
    Phase.TO_HOME: (-1, HOME, True, Axis.SEARCH_SPEED),
    Phase.OFF_LEFT: (1, LEFT, False, Axis.SWITCH_SPEED),
    Phase.OFF_HOME: (1, HOME, False, Axis.SWITCH_SPEED),
}
"""Direction, switch, the state of it that ends the phase, and the parameter that holds the velocity."""


class ReferenceSearch:
    """One search of a motor."""

    def __init__(self, motor: Motor, mode: int, t: float) -> None:
        self._motor = motor
        self._follower = dict(pairwise(ROUTES[mode]))
        self._right_at = 0
        self.phase = Phase.DONE
        self._enter(ROUTES[mode][0], t)

    def live(self, t: float) -> None:
        while self.phase is not Phase.DONE:
            _, switch, closed, _ = STEPS[self.phase]
            if self._motor.shaft.switches(t)[switch] is not closed:
                return
            if self.phase is Phase.TO_RIGHT:
                self._right_at = self._motor.position(t)
            elif self.phase is Phase.TO_LEFT:
                distance = wrapped(self._right_at - self._motor.position(t))
                self._motor.parameters[Axis.SWITCH_DISTANCE] = distance if Phase.TO_RIGHT in self._follower else 0
            self._motor.freeze(t)
            self._enter(self._follower[self.phase], t)

    def _enter(self, phase: Phase, t: float) -> None:
        self.phase = phase
        if phase is Phase.DONE:
            self._motor.stand_at(0, t)
            return
        way, _, _, speed = STEPS[phase]
        self._motor.rotate(way * self._motor.parameters[speed], t)
