"""One motor of a simulated TMCL module: its ramp generator, axis parameters and limit switches.

Rulings where the manuals are silent: a limit switch stops the motor at once and lets it run away from it; MVP REL
counts from the last target, with parameter 127 at 1 or 2 from the actual position; a position beyond 32 bits wraps
around, and a move takes the shorter way.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from math import inf

from multidrop.dialects.tmcl.manual.commands import AXIS, Axis
from multidrop.simulator.kinematics.profile import halt, move, slew
from multidrop.simulator.shaft import Shaft
from multidrop.simulator.world import World

FULL = 256
"""Microsteps of a full step, which is one motor step of the world."""
STORED = tuple(number for number, row in AXIS.items() if row.writable and number > Axis.TARGET_VELOCITY)
"""Parameters that EEPROM holds."""
FROM_TARGET = 0
"""The value of parameter 127 with which MVP REL counts from the last target."""


class Mode(Enum):
    """What the ramp generator aims at."""

    POSITION = "a target position"
    VELOCITY = "a target velocity"


class Motor:
    """One motor. Times are seconds, positions microsteps."""

    def __init__(self, world: World) -> None:
        self.shaft = Shaft(world)
        self.parameters = {number: row.fresh for number, row in AXIS.items()}
        self._profile = halt(0.0, 0.0)
        self._mode = Mode.POSITION
        self._target = 0

    # -- what a host reads ------------------------------------------------------------------------------------------

    def read(self, number: int, t: float) -> int:
        """The value of an axis parameter."""
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
        """Whether it makes steps."""
        return self._profile.moving(t)

    def reached(self, t: float) -> bool:
        """Whether the actual position is the target."""
        return self.position(t) == self._target and not self.moving(t)

    @property
    def positioning(self) -> bool:
        """Whether it aims at a position."""
        return self._mode is Mode.POSITION

    # -- what moves it ----------------------------------------------------------------------------------------------

    def write(self, number: int, value: int, t: float) -> None:
        """Set an axis parameter; the value is in range."""
        if number == Axis.TARGET_POSITION:
            self.go(value, t)
        elif number == Axis.TARGET_VELOCITY:
            self.rotate(value, t)
        elif number == Axis.ACTUAL_POSITION:
            self.declare(value, t)
        else:
            self.parameters[number] = value
            self._refresh(number, t)

    def go(self, target: int, t: float) -> None:
        """Move to a position."""
        self._mode, self._target = Mode.POSITION, wrapped(target)
        self._plan(t)

    def go_by(self, distance: int, t: float) -> None:
        """Move by a distance from the last target, or from here, as parameter 127 says."""
        here = self.parameters[Axis.RELATIVE_FROM] != FROM_TARGET
        self.go((self.position(t) if here else self._target) + distance, t)

    def rotate(self, velocity: int, t: float) -> None:
        """Turn at a velocity, and on; 0 slows down to rest."""
        self._mode = Mode.VELOCITY
        self.parameters[Axis.TARGET_VELOCITY] = velocity
        self._plan(t)

    def declare(self, position: int, t: float) -> None:
        """Give its present position another number; while it aims at a position it moves there from it."""
        velocity = self._profile.velocity(t)
        self._follow_from(float(position), velocity, t)

    def set_zero(self, t: float) -> None:
        """Stand here, at position 0, which is the target too."""
        self.stand_at(0, t)

    def stand_at(self, position: int, t: float) -> None:
        """Give its present place this position, which is the target too."""
        self._mode, self._target = Mode.POSITION, position
        self._profile = halt(t, float(position))
        self._hand_on(t)

    def freeze(self, t: float) -> None:
        """Stand at once, without a ramp."""
        self._mode = Mode.VELOCITY
        self.parameters[Axis.TARGET_VELOCITY] = 0
        self._profile = halt(t, float(round(self._profile.position(t))))
        self._hand_on(t)

    def power(self, on: bool, t: float) -> None:
        """Switch the driver; it wakes up standing at position 0."""
        self.shaft.powered = on
        self.set_zero(t)
        self.parameters[Axis.TARGET_VELOCITY] = 0

    # -- time -------------------------------------------------------------------------------------------------------

    def events(self, after: float) -> Iterator[float]:
        """When something happens by itself."""
        yield from self.shaft.events(after)
        if self.moving(after) and self._profile.end < inf:
            yield self._profile.end

    def live(self, t: float) -> None:
        """Take in what has happened by now."""
        self.shaft.settle(t)
        if self.moving(t) and self._blocked(self._profile.direction(t), t):
            self.freeze(t)

    # -- planning ---------------------------------------------------------------------------------------------------

    def _blocked(self, way: float, t: float) -> bool:
        """Whether a limit switch forbids this direction."""
        _, right, left = self.shaft.switches(t)
        if way > 0:
            return right and not self.parameters[Axis.RIGHT_LIMIT_OFF]
        return left and not self.parameters[Axis.LEFT_LIMIT_OFF]

    def _refresh(self, number: int, t: float) -> None:
        """Plan again where a parameter of the ramp has changed on the fly; rescale where the microsteps have."""
        if number == Axis.MICROSTEPS:
            self._hand_on(t)
        elif number in (Axis.MAXIMUM_VELOCITY, Axis.MAXIMUM_ACCELERATION) and self._under_way(t):
            self._plan(t)

    def _under_way(self, t: float) -> bool:
        """Whether it moves, or waits at velocity 0 on its way to a position."""
        return self.moving(t) or (self.positioning and not self.reached(t))

    def _plan(self, t: float) -> None:
        self._follow_from(self._profile.position(t), self._profile.velocity(t), t)

    def _follow_from(self, position: float, velocity: float, t: float) -> None:
        """Aim on from a position and a velocity."""
        rate, speed = float(self.parameters[Axis.MAXIMUM_ACCELERATION]), float(self.parameters[Axis.MAXIMUM_VELOCITY])
        if self._mode is Mode.VELOCITY or not speed:
            wanted = self.parameters[Axis.TARGET_VELOCITY] if self._mode is Mode.VELOCITY else 0
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
