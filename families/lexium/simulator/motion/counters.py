"""The position counters: C1 (motor steps), C2 (encoder counts), P, which is one of them; the limits and trips on it.

Positions inside are motor steps since power-up; a counter is these plus an offset, so setting P moves nothing. C1
follows the command, C2 the rotor. A counter rolls over at the ends of 32 bits. Limits are switches on inputs (IS types
2 and 3) and positions in software (LS). Manual 5.1.16, 5.1.17, 5.1.76, 5.1.78, 5.1.95.

Trips are subroutines that run when something happens. TE arms them and loses a trip's bit when it happens. When a trip
on position or time will happen is solved from the motion, not looked for. Manual 5.1.122 to 5.1.132.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, inf, nextafter

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.groups import TRIPS
from multidrop.families.lexium.simulator.motion.inputs import MINUS, PLUS, Inputs
from multidrop.families.lexium.simulator.motion.rotor import LexiumRotor
from multidrop.families.lexium.simulator.state.errors import DriveFault
from multidrop.families.lexium.simulator.state.expressions import wrap
from multidrop.families.lexium.simulator.state.interpreter import Core
from multidrop.families.lexium.simulator.state.memory import Memory, Trip
from multidrop.simulator.world import TOUCH

TURNOVER = 2**32
"""From one end of a counter to the same again."""


class Counters:
    """The counters of one drive, and where P is for trips and limits."""

    def __init__(self, memory: Memory, rotor: LexiumRotor) -> None:
        self._memory, self._rotor = memory, rotor
        self._offsets = {"C1": 0, "C2": 0}
        self._base = (0.0, 0.0)

    @property
    def source(self) -> str:
        """The counter that P is: C1, or C2 with EE=1 and no hMT."""
        return "C2" if self._memory.counting else "C1"

    def value(self, name: str, t: float) -> int:
        return wrap(self.raw(name, t) + self._offsets[name])

    def shown(self, name: str, t: float) -> int:
        """A counter as the drive reports it: C2 sees how far the rotor lags its field."""
        lag = self._rotor.field_lag(t) / self._memory.steps_per_count if name == "C2" else 0.0
        return self.value(name, t) if not lag else wrap(floor(self._counts(t) - lag + 0.5) + self._offsets[name])

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
        return profile.crossing(place - shift, t, direction) if profile.end > t else inf

    def reaching_steps(self, steps: int, t: float) -> float:
        """The first time from t on at which C1 reads so many steps, on either side of here; infinite: never."""
        command, raw = self._rotor.command, steps - self._offsets["C1"]
        raw += TURNOVER * floor((self.raw("C1", t) - raw) / TURNOVER)
        return min(command.crossing(place, t) for place in (raw, raw + TURNOVER)) if command.end > t else inf

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


class DriveLimits:
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


INPUT, POSITION, CAPTURE, TIME, RELATIVE, HMT, POWER = (
    TRIPS[word] for word in ["TI", "TP", "TC", "TT", "TR", "TA", "TM"]
)


class Trips:
    """The trips of one drive. `defined` holds their set-up by bit; `fired_at` is when one last happened."""

    def __init__(self, core: Core, counters: Counters, inputs: Inputs) -> None:
        self._memory, self._values, self._timeline = core.memory, core.values, core.timeline
        self._counters, self._inputs, self._interpreter = counters, inputs, core.interpreter
        self.defined: dict[int, Trip] = {}
        self.fired_at = -inf
        self._armed_at = 0.0
        self._base = 0.0
        self._left = 0

    @property
    def armed(self) -> int:
        return int(self._values["TE"])

    def clear(self) -> None:
        self.defined.clear()
        self._values["TE"] = 0

    def restore(self, defined: Mapping[int, Trip]) -> None:
        """Take back what NVM keeps; what is not defined any more is not armed any more."""
        self.defined = dict(defined)
        self._arm(self.armed & sum(self.defined))

    def define(self, bit: int, trip: Trip) -> None:
        """Set a trip up. An armed one goes on with the new setting, one that repeats with all of its repeats."""
        self.defined[bit] = trip
        if bit == RELATIVE:
            self._left = trip.repeats
        self._timeline.replan()

    def forget(self, bit: int) -> None:
        """Switch a trip off: not set up any more, nor armed."""
        self.defined.pop(bit, None)
        self._arm(self.armed & ~bit)

    def arm(self, bits: int, t: float) -> None:
        """Set TE. Raises DriveFault (12, 27, 39)."""
        if any(bits & bit and bit not in self.defined for bit in TRIPS.values()):
            raise DriveFault(E.TRIP_NOT_SET_UP)
        if bits & POSITION and bits & RELATIVE:
            raise DriveFault(E.TRIPS_EXCLUSIVE)
        if bits & CAPTURE and not self._inputs.has(self._inputs.points.capture):
            raise DriveFault(E.NOT_CAPTURE_INPUT)
        fresh = bits & ~self.armed
        if fresh & TIME:
            self._armed_at = t
        if fresh & RELATIVE:
            self._base = self._counters.place(t)
            self._left = self.defined[RELATIVE].repeats
        self._arm(bits)

    def _arm(self, bits: int) -> None:
        self._values["TE"] = bits
        self._timeline.replan()

    def next(self, t: float) -> tuple[float, int]:
        """When the next trip happens by itself, and which; infinite if none does."""
        soonest = (inf, 0)
        armed, counters = self.armed, self._counters
        if not armed:
            return soonest
        if armed & POSITION and self._on_steps:
            soonest = min(soonest, (counters.reaching_steps(self.defined[POSITION].value, t), POSITION))
        for bit, place in self._places(t):
            soonest = min(soonest, (counters.passing(place, t), bit))
        if armed & TIME:
            soonest = min(soonest, (max(self._armed_at + self.defined[TIME].value / 1000, t), TIME))
        return soonest

    def displaced(self, was: float, here: float, t: float) -> None:
        """Let the trips happen, each once, between two places from one of which P has come to the other at once."""
        for bit, place in self._places(t):
            passed = was != here and was != place and (was - place) * (here - place) <= 0
            if self.armed & bit and passed:
                self.fire(bit, t)

    def _places(self, t: float) -> list[tuple[int, float]]:
        """Where P meets the armed trips on position."""
        places = []
        if self.armed & POSITION and not self._on_steps:
            places += [(POSITION, place) for place in self._counters.places_of(self.defined[POSITION].value, t)]
        if self.armed & RELATIVE:
            distance = abs(self.defined[RELATIVE].value) * self._memory.scale
            places += [(RELATIVE, self._base - distance), (RELATIVE, self._base + distance)]
        return places

    @property
    def _on_steps(self) -> bool:
        """Return whether TP is in motor steps while P is not."""
        return self._memory.model.trips_on_steps and self._memory.counting

    def input(self, n: int, t: float) -> None:
        armed, inputs = self.armed, self._inputs
        if armed & INPUT and self.defined[INPUT].value == n:
            self.fire(INPUT, t)
        if armed & CAPTURE and inputs.types[n][0] == inputs.points.capture:
            self.fire(CAPTURE, t)

    def hmt(self, bits: int, t: float) -> bool:
        """Act on something in hMT (bits of TA). Return whether a trip waited for it."""
        if not self.armed & HMT or not self.defined[HMT].value & bits:
            return False
        self.fire(HMT, t)
        return True

    def power_lost(self, t: float) -> None:
        if self.armed & POWER:
            self.fire(POWER, t)

    def fire(self, bit: int, t: float) -> None:
        """Let a trip happen: disarm it, capture the position, call its subroutine."""
        trip, values, model = self.defined[bit], self._values, self._memory.model
        if bit == RELATIVE:
            self._base = self._counters.place(t)
            self._left -= 1
        if bit != RELATIVE or (trip.repeats and self._left <= 0):
            values["TE"] = self.armed & ~bit
        captures = bit != POSITION and (bit != RELATIVE or model.captures_relative)
        if captures and "PC" in values:
            values["PC"] = self._counters.position(t)
        self._timeline.replan()
        self.fired_at = t
        self._interpreter.interrupt(trip.target, t)
