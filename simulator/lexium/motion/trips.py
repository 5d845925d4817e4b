"""Trips: subroutines that run when something happens. TE arms them and loses a trip's bit when it happens.

When a trip on position or time will happen is solved from the motion, not looked for. Manual 5.1.122 to 5.1.132.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.motion.counters import Counters
from multidrop.simulator.lexium.motion.inputs import Inputs
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.interpreter import Core
from multidrop.simulator.lexium.state.memory import Trip

INPUT, POSITION, CAPTURE, TIME, RELATIVE, HMT, POWER = 1, 2, 4, 8, 16, 32, 64
BITS: Mapping[str, int] = {
    "TI": INPUT, "TP": POSITION, "TC": CAPTURE, "TT": TIME, "TR": RELATIVE, "TA": HMT, "TM": POWER,
}  # fmt: skip


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
        """Set TE. Raises Fault (12, 27, 39)."""
        if any(bits & bit and bit not in self.defined for bit in BITS.values()):
            raise Fault(E.TRIP_NOT_SET_UP)
        if bits & POSITION and bits & RELATIVE:
            raise Fault(E.TRIPS_EXCLUSIVE)
        if bits & CAPTURE and not self._inputs.has(self._inputs.points.capture):
            raise Fault(E.NOT_CAPTURE_INPUT)
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
        found = (inf, 0)
        armed, counters = self.armed, self._counters
        if not armed:
            return found
        if armed & POSITION and self._on_steps:
            found = min(found, (counters.reaching_steps(self.defined[POSITION].value, t), POSITION))
        for bit, place in self._places(t):
            found = min(found, (counters.passing(place, t), bit))
        if armed & TIME:
            found = min(found, (max(self._armed_at + self.defined[TIME].value / 1000, t), TIME))
        return found

    def displaced(self, was: float, here: float, t: float) -> None:
        """Let the trips happen, each once, between two places from one of which P has come to the other at once."""
        for bit, place in self._places(t):
            passed = was != here and was != place and (was - place) * (here - place) <= 0
            if self.armed & bit and passed:
                self.fire(bit, t)

    def _places(self, t: float) -> list[tuple[int, float]]:
        """Where P meets the armed trips on position."""
        found = []
        if self.armed & POSITION and not self._on_steps:
            found += [(POSITION, place) for place in self._counters.places_of(self.defined[POSITION].value, t)]
        if self.armed & RELATIVE:
            distance = abs(self.defined[RELATIVE].value) * self._memory.scale
            found += [(RELATIVE, self._base - distance), (RELATIVE, self._base + distance)]
        return found

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
