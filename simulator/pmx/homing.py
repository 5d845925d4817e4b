"""The five homing routines of the PMX-2ED-SA (manual 7.10), as conversations with an axis.

A routine is a generator: it starts a motion and yields what it waits for; it is resumed with the time of that. A limit
that it does not search ends it, as a stop does. A direction is 1 or -1.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from enum import Enum
from math import inf
from typing import Protocol

from multidrop.simulator.kinematics.profile import Profile
from multidrop.simulator.pmx.pulses import Pulses
from multidrop.simulator.pmx.settings import Settings
from multidrop.simulator.pmx.states import Doing, Pace


class Until(Enum):
    """What a routine waits for."""

    HOME = "home"
    AWAY = "away"
    LIMIT = "limit"
    SLOW = "slow"
    INDEX = "index"
    END = "end"


Steps = Generator[Until, float, None]


class HomedAxis(Protocol):
    """What a homing routine needs of its axis."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def settings(self) -> Settings: ...  # noqa: D102
    @property
    def pulses(self) -> Pulses: ...  # noqa: D102
    def switches(self, t: float) -> tuple[bool, bool, bool]: ...  # noqa: D102
    def zero(self, t: float) -> None: ...  # noqa: D102


class Homing:
    """A routine at work on one axis. `direction` is that of the search, 1 or -1; `word` is its ASCII word."""

    def __init__(self, axis: HomedAxis, word: str, direction: float, pace: Pace) -> None:
        self._axis, self.word, self.direction, self.pace = axis, word, direction, pace
        self._pulses = axis.pulses
        self.awaited: Until | None = None
        self.done = False
        self._index_at = inf
        self._index_path: object = None
        self._steps = self._run()

    def begin(self, t: float) -> None:
        """Start the first motion."""
        self._now = t
        self.awaited = next(self._steps)

    def wants_limit(self, direction: float) -> bool:
        """Whether the routine searches this limit."""
        return self.awaited is Until.LIMIT and direction == self.direction

    def due(self, after: float) -> float:
        """The time of what is awaited, if that is neither a switch nor the end of a motion."""
        if self.awaited is Until.SLOW:
            return self._pulses.profile.segments[-1].start if self._pulses.profile.segments else inf
        if self.awaited is Until.INDEX:
            self._find_index(after)
            return self._index_at
        return inf

    def live(self, t: float) -> None:
        """Continue while what is awaited has come."""
        while self.awaited is not None and self._met(self.awaited, t):
            self._now, self._index_path = t, None
            try:
                self.awaited = self._steps.send(t)
            except StopIteration:
                self.awaited, self.done = None, True

    # -- the routines' words --------------------------------------------------------------------------------------

    def run(self, direction: float, speed: float) -> None:
        """Turn without an end, from low speed up to this speed."""
        self._start(self._pulses.to_speed(direction * speed, self._now, self.pace))

    def slow(self, on: bool = False) -> None:
        """Decelerate to low speed, and stop there or go on."""
        self._start(self._pulses.to_speed(self.direction * self.pace.low if on else 0.0, self._now, self.pace))

    def go(self, place: float) -> None:
        """Move to a place at high speed."""
        self._start(self._pulses.to_place(place, self._now, self.pace))

    def stop(self) -> None:
        """Stop at once."""
        self._pulses.rest(self._now)

    def zero(self) -> None:
        """Set both counters to 0 here."""
        self._axis.zero(self._now)

    def correction(self, register: str) -> float:
        """LCA or HCA, in pulses against the direction of the search."""
        return -self.direction * self._axis.settings.of(register, self._axis.name)

    @property
    def here(self) -> float:
        """The place now, pulses from power-up."""
        return self._pulses.profile.position(self._now)

    # -- its inside -----------------------------------------------------------------------------------------------

    def _run(self) -> Steps:
        yield from ROUTINES[self.word](self)
        if self._axis.settings["RZ"] and self._pulses.counter(self._now):
            self.go(self.here - self._pulses.counter(self._now))
            yield Until.END
            self.stop()

    def _start(self, profile: Profile) -> None:
        self._pulses.begin(Doing.HOMING, profile, self._now, self.pace)

    def _find_index(self, t: float) -> None:
        path = (self._pulses.profile, self._pulses.rotor.factor)
        if self._index_path != path:
            self._index_path, self._index_at = path, self._pulses.rotor.next_index(t)

    def _met(self, awaited: Until, t: float) -> bool:
        home, plus, minus = self._axis.switches(t)
        profile = self._pulses.profile
        if awaited is Until.HOME:
            return home
        if awaited is Until.AWAY:
            return not home
        if awaited is Until.LIMIT:
            return plus if self.direction > 0 else minus
        if awaited is Until.SLOW:
            return not profile.segments or t >= profile.segments[-1].start
        if awaited is Until.INDEX:
            self._find_index(t)
            return t >= self._index_at
        return profile.end <= t + 1e-9


Routine = Callable[[Homing], Steps]


def home_input(homing: Homing) -> Steps:
    """`H`: move at high speed to the home input; 0 is there, the motor stops a ramp beyond it (7.10.1)."""
    homing.run(homing.direction, homing.pace.high)
    yield Until.HOME
    homing.zero()
    homing.slow()
    yield Until.END
    homing.stop()


def limit(homing: Homing) -> Steps:
    """`L`: move at high speed to the limit, and back by LCA; 0 is there (7.10.2)."""
    homing.run(homing.direction, homing.pace.high)
    yield Until.LIMIT
    homing.stop()
    homing.go(homing.here + homing.correction("LCA"))
    yield Until.END
    homing.stop()
    homing.zero()


def home_and_index(homing: Homing) -> Steps:
    """`ZH`: move to the home input, and on at low speed to the next index mark, which is 0 (7.10.3)."""
    homing.run(homing.direction, homing.pace.high)
    yield Until.HOME
    homing.slow(on=True)
    yield Until.SLOW
    yield Until.INDEX
    homing.stop()
    homing.zero()


def index(homing: Homing) -> Steps:
    """`Z`: move at low speed to the next index mark, which is 0 (7.10.4)."""
    homing.run(homing.direction, homing.pace.low)
    yield Until.INDEX
    homing.stop()
    homing.zero()


def home_twice(homing: Homing) -> Steps:
    """`HL`: move to the home input, back past it by HCA, and at low speed to it again, which is 0 (7.10.5)."""
    homing.run(homing.direction, homing.pace.high)
    yield Until.HOME
    homing.zero()
    homing.slow()
    yield Until.END
    homing.stop()
    homing.run(-homing.direction, homing.pace.high)
    yield Until.AWAY
    homing.go(homing.here + homing.correction("HCA"))
    yield Until.END
    homing.stop()
    homing.run(homing.direction, homing.pace.low)
    yield Until.HOME
    homing.zero()
    homing.stop()


ROUTINES: dict[str, Routine] = {
    "H": home_input,
    "L": limit,
    "ZH": home_and_index,
    "Z": index,
    "HL": home_twice,
}
"""By the ASCII word."""
