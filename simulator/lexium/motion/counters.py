"""The position counters: C1 (motor steps), C2 (encoder counts), P, which is one of them; and the limits on it.

Positions inside are motor steps since power-up; a counter is these plus an offset, so setting P moves nothing. C1
follows the command, C2 the rotor. A counter rolls over at the ends of 32 bits. Limits are switches on inputs (IS types
2 and 3) and positions in software (LS). Manual 5.1.16, 5.1.17, 5.1.76, 5.1.78, 5.1.95.
"""

from __future__ import annotations

from math import floor, inf, nextafter

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.motion.inputs import MINUS, PLUS
from multidrop.simulator.lexium.motion.rotor import TOUCH, Rotor
from multidrop.simulator.lexium.state.expressions import wrap
from multidrop.simulator.lexium.state.memory import Memory

TURNOVER = 2**32
"""From one end of a counter to the same again."""


class Counters:
    """The counters of one drive, and where P is for trips and limits."""

    def __init__(self, memory: Memory, rotor: Rotor) -> None:
        self._memory, self._rotor = memory, rotor
        self._offsets = {"C1": 0, "C2": 0}
        self._base = (0.0, 0.0)

    @property
    def source(self) -> str:
        """The counter that P is: C1, or C2 with EE=1 and no hMT."""
        return "C2" if self._memory.counting else "C1"

    def value(self, name: str, t: float) -> int:
        return wrap(self.raw(name, t) + self._offsets[name])

    def position(self, t: float) -> int:
        """P."""
        return self.value(self.source, t)

    def set(self, name: str, value: int, t: float) -> None:
        self._offsets[name] += value - self.value(name, t)

    def raw(self, name: str, t: float) -> int:
        """A counter without its offset."""
        return floor((self._rotor.command.position(t) if name == "C1" else self._counts(t)) + 0.5)

    def hold_counts(self, t: float) -> None:
        """Let the encoder go on counting where it is, before MS, SA or EL change."""
        self._base = (self._rotor.position(t), self._counts(t))

    def restart(self, t: float) -> None:
        self._base = (self._rotor.position(t), 0.0)
        for name in self._offsets:
            self.set(name, 0, t)

    # Where P is, in motor steps since power-up.

    def place(self, t: float) -> float:
        return self._rotor.position(t) if self._memory.counting else self._rotor.command.position(t)

    def place_of(self, value: float) -> float:
        return self.place_of_raw(value - self._offsets[self.source])

    def place_of_raw(self, raw: float) -> float:
        """Where P reads `raw` without its offset."""
        if not self._memory.counting:
            return raw
        steps, counts = self._base
        return steps + (raw - counts) * self._memory.steps_per_count

    def places_of(self, value: float, t: float) -> tuple[float, float]:
        """Where P reads a value, on either side of here: it rolls over."""
        raw = value - self._offsets[self.source]
        raw += TURNOVER * floor((self.raw(self.source, t) - raw) / TURNOVER)
        return self.place_of_raw(raw), self.place_of_raw(raw + TURNOVER)

    def passing(self, place: float, t: float, direction: float = 0.0) -> float:
        """The first time from t on at which P passes a place, in a direction if one is given; infinite: never."""
        profile, shift = self._rotor.path if self._memory.counting else (self._rotor.command, 0.0)
        if profile.end <= t:
            return inf
        found = profile.crossing(place - shift, t, direction)
        return inf if found is None else found

    def reaching_steps(self, steps: int, t: float) -> float:
        """The first time from t on at which C1 reads so many steps, on either side of here; infinite: never."""
        command, raw = self._rotor.command, steps - self._offsets["C1"]
        raw += TURNOVER * floor((self.raw("C1", t) - raw) / TURNOVER)
        found = [command.crossing(place, t) for place in (raw, raw + TURNOVER)] if command.end > t else []
        return min((each for each in found if each is not None), default=inf)

    def stator_shift(self, t: float) -> float:
        """By how much the command is ahead of the counter that P is, steps."""
        return self._rotor.command.position(t) - self._rotor.position(t) if self._memory.counting else 0.0

    def _counts(self, t: float) -> float:
        steps, counts = self._base
        return counts + (self._rotor.position(t) - steps) / self._memory.steps_per_count


DIRECTIONS = {PLUS: 1, MINUS: -1}
"""Types of the limit switches, and their directions."""
ERRORS = {1: E.PLUS_LIMIT, -1: E.MINUS_LIMIT}
"""Codes by direction."""
SOFTWARE = {1: 1, -1: 0}
"""The first number of LS, by direction."""
FRESH = {0: (0, 0), 1: (0, 0)}
"""LS from the factory: position and whether it is enabled."""


class Limits:
    """The limits of one drive. A limit acts on motion in its own direction only, which it refuses while it is active.

    `homing.LimitStop` ends the motion that reaches one, as LM says. `switches` are the directions of limit switches
    that are active, `software` is LS.
    """

    def __init__(self, counters: Counters) -> None:
        self._counters = counters
        self.switches: set[int] = set()
        self.software: dict[int, tuple[int, ...]] = dict(FRESH)

    def refuse(self, t: float, direction: float) -> int:
        """What forbids a motion in a direction: 83, 84 or 0."""
        sign = 1 if direction > 0 else -1
        if not direction:
            return 0
        return ERRORS[sign] if sign in self.switches or self._beyond(t, sign) else 0

    def beyond(self, t: float) -> set[int]:
        """The directions of the software limits that P is beyond."""
        return {direction for direction in SOFTWARE if self._beyond(t, direction)}

    def next_passed(self, t: float) -> tuple[float, int]:
        """When P next passes a software limit on its way out, and in which direction."""
        first = inf, 0
        for direction, n in SOFTWARE.items():
            if self.software[n][1] != 0 and (at := self._passes(t, direction)) < first[0]:
                first = at, direction
        return first

    def _place(self, direction: int) -> float:
        return self._counters.place_of(self.software[SOFTWARE[direction]][0])

    def _beyond(self, t: float, direction: int) -> bool:
        if not self.software[SOFTWARE[direction]][1]:
            return False
        return (self._counters.place(t) - self._place(direction)) * direction >= -TOUCH

    def _passes(self, t: float, direction: int) -> float:
        counters, place = self._counters, self._place(direction)
        if self._beyond(t, direction):
            back = counters.passing(place, t, -direction)
            t = inf if back == inf else nextafter(back, inf)
        return inf if t == inf else counters.passing(place, t, direction)
