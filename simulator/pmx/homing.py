"""The five homing routines of the PMX-2ED-SA (manual 7.10), as conversations with an axis.

A routine is a generator: it starts a motion and yields what it waits for; it is resumed with the time at which that has
come. A limit that it does not want ends it, as a stop does. `way` is 1 or -1.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from enum import Enum
from math import inf
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simulator.kinematics.profile import Profile
    from simulator.pmx.axis import Axis, Pace


class Until(Enum):
    """What a routine waits for."""

    HOME = "home"
    AWAY = "away"
    LIMIT = "limit"
    SLOW = "slow"
    INDEX = "index"
    END = "end"


Steps = Generator[Until, float, None]


class Homing:
    """A routine at work on one axis."""

    def __init__(self, axis: Axis, routine: Routine, way: float, pace: Pace) -> None:
        self.axis, self.way, self.pace = axis, way, pace
        self.routine = routine
        self.awaited: Until | None = None
        self._index_at = inf
        self._index_path: object = None
        self._steps = self._run()

    def begin(self, t: float) -> None:
        """Start the first motion."""
        self._now = t
        self.awaited = next(self._steps)

    def wants_limit(self, way: float) -> bool:
        """Whether this limit is what is looked for."""
        return self.awaited is Until.LIMIT and way == self.way

    def due(self, after: float) -> float:
        """When what is awaited comes, where that is no switch and no end of a motion."""
        if self.awaited is Until.SLOW:
            return self.axis.profile.segments[-1].start if self.axis.profile.segments else inf
        if self.awaited is Until.INDEX:
            self._find_index(after)
            return self._index_at
        return inf

    def live(self, t: float) -> None:
        """Go on as long as what is awaited is there."""
        while self.axis.homing is self and self.awaited is not None and self._met(self.awaited, t):
            self._now, self._index_path = t, None
            try:
                self.awaited = self._steps.send(t)
            except StopIteration:
                self.awaited = None
                self.axis.homing = None

    # -- the routines' words --------------------------------------------------------------------------------------

    def run(self, way: float, speed: float) -> None:
        """On and on, from low speed up to this one."""
        self._start(self.axis.slewing(way * speed, self._now, self.pace))

    def slow(self, on: bool = False) -> None:
        """Slow down to low speed, and stop there or go on."""
        self._start(self.axis.slewing(self.way * self.pace.low if on else 0.0, self._now, self.pace))

    def go(self, place: float) -> None:
        """To a place in pulses from power-up, at high speed."""
        self._start(self.axis.trapezoid(place, self._now, self.pace))

    def stand(self) -> None:
        """Stop at once."""
        self.axis.rest(self._now)

    def zero(self) -> None:
        """Here is 0."""
        self.axis.zero(self._now)

    def correction(self, register: str) -> float:
        """LCA or HCA, in pulses against the direction of the search."""
        return -self.way * self.axis.settings.of(register, self.axis.name)

    @property
    def here(self) -> float:
        """Pulses from power-up."""
        return self.axis.profile.position(self._now)

    # -- its inside -----------------------------------------------------------------------------------------------

    def _run(self) -> Steps:
        yield from self.routine(self)
        if self.axis.settings["RZ"] and self.axis.pulses(self._now):
            self.go(self.here - self.axis.pulses(self._now))
            yield Until.END
            self.stand()

    def _start(self, profile: Profile) -> None:
        from simulator.pmx.axis import Doing

        self.axis.begin(Doing.HOMING, profile, self._now, self.pace)

    def _find_index(self, t: float) -> None:
        path = (self.axis.profile, self.axis.rotor.factor)
        if self._index_path != path:
            self._index_path, self._index_at = path, self.axis.rotor.next_index(t)

    def _met(self, awaited: Until, t: float) -> bool:
        axis = self.axis
        home, plus, minus = axis.switches(t)
        if awaited is Until.HOME:
            return home
        if awaited is Until.AWAY:
            return not home
        if awaited is Until.LIMIT:
            return plus if self.way > 0 else minus
        if awaited is Until.SLOW:
            return not axis.profile.segments or t >= axis.profile.segments[-1].start
        if awaited is Until.INDEX:
            self._find_index(t)
            return t >= self._index_at
        return axis.profile.end <= t + 1e-9


Routine = Callable[[Homing], Steps]


def home_input(homing: Homing) -> Steps:
    """`H`: at high speed to the home input; 0 is there, the motor stands a ramp behind it (7.10.1)."""
    homing.run(homing.way, homing.pace.high)
    yield Until.HOME
    homing.zero()
    homing.slow()
    yield Until.END
    homing.stand()


def limit(homing: Homing) -> Steps:
    """`L`: at high speed to the limit, back by LCA; 0 is there (7.10.2)."""
    homing.run(homing.way, homing.pace.high)
    yield Until.LIMIT
    homing.stand()
    homing.go(homing.here + homing.correction("LCA"))
    yield Until.END
    homing.stand()
    homing.zero()


def home_and_index(homing: Homing) -> Steps:
    """`ZH`: to the home input, slow down, and on at low speed to the next index mark, which is 0 (7.10.3)."""
    homing.run(homing.way, homing.pace.high)
    yield Until.HOME
    homing.slow(on=True)
    yield Until.SLOW
    yield Until.INDEX
    homing.stand()
    homing.zero()


def index(homing: Homing) -> Steps:
    """`Z`: at low speed to the next index mark, which is 0 (7.10.4)."""
    homing.run(homing.way, homing.pace.low)
    yield Until.INDEX
    homing.stand()
    homing.zero()


def home_twice(homing: Homing) -> Steps:
    """`HL`: to the home input, back past it by HCA, and at low speed to it again, which is 0 (7.10.5)."""
    homing.run(homing.way, homing.pace.high)
    yield Until.HOME
    homing.zero()
    homing.slow()
    yield Until.END
    homing.stand()
    homing.run(-homing.way, homing.pace.high)
    yield Until.AWAY
    homing.go(homing.here + homing.correction("HCA"))
    yield Until.END
    homing.stand()
    homing.run(homing.way, homing.pace.low)
    yield Until.HOME
    homing.zero()
    homing.stand()


ROUTINES: dict[str, Routine] = {
    "H": home_input,
    "L": limit,
    "ZH": home_and_index,
    "Z": index,
    "HL": home_twice,
}
"""By the ASCII word."""
