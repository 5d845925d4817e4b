"""Trips: subroutines that run when something happens. TE arms them and loses a trip's bit when it happens.

When a trip on position or time will happen is solved from the motion, not looked for. Manual 5.1.122 to 5.1.132.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

from dialects.mcode.manual.grammar import Argument
from simulator.lexium.state.errors import Fault

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

INPUT, POSITION, CAPTURE, TIME, RELATIVE, HMT, POWER = 1, 2, 4, 8, 16, 32, 64
BITS: Mapping[str, int] = {
    "TI": INPUT, "TP": POSITION, "TC": CAPTURE, "TT": TIME, "TR": RELATIVE, "TA": HMT, "TM": POWER,
}  # fmt: skip
NOT_CAPTURE, UNDEFINED, NOT_TOGETHER = 12, 27, 39


@dataclass(frozen=True)
class Trip:
    """What one trip waits for (input, position, ms, distance or mask), its target, and how often it repeats."""

    value: int
    target: Argument | None
    repeats: int = 0


class Trips:
    """The trips of one drive."""

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device
        self.defined: dict[int, Trip] = {}
        self._armed_at = 0.0
        self._base = 0.0
        self._left = 0

    @property
    def armed(self) -> int:
        """The bits of TE."""
        return int(self.device.memory.values["TE"])

    def clear(self) -> None:
        """Nothing defined, nothing armed."""
        self.defined.clear()
        self.device.memory.values["TE"] = 0

    def restore(self, defined: Mapping[int, Trip]) -> None:
        """Take back what NVM keeps; what is not defined any more is not armed any more."""
        self.defined = dict(defined)
        self.device.memory.values["TE"] = self.armed & sum(self.defined)
        self.device.stale = True

    def define(self, bit: int, trip: Trip) -> None:
        """Set a trip up. An armed one goes on with the new setting, one that repeats with all of its repeats."""
        self.defined[bit] = trip
        if bit == RELATIVE:
            self._left = trip.repeats
        self.device.stale = True

    def forget(self, bit: int) -> None:
        """A trip is off: not set up any more, nor armed."""
        self.defined.pop(bit, None)
        self.device.memory.values["TE"] = self.armed & ~bit
        self.device.stale = True

    def arm(self, bits: int, t: float) -> None:
        """TE. Raises Fault (12, 27, 39)."""
        if any(bits & bit and bit not in self.defined for bit in BITS.values()):
            raise Fault(UNDEFINED)
        if bits & POSITION and bits & RELATIVE:
            raise Fault(NOT_TOGETHER)
        inputs = self.device.inputs
        if bits & CAPTURE and all(inputs.types[n][0] != inputs.points.capture for n in inputs.numbers):
            raise Fault(NOT_CAPTURE)
        fresh = bits & ~self.armed
        if fresh & TIME:
            self._armed_at = t
        if fresh & RELATIVE:
            self._base = self.device.axis.place(t)
            self._left = self.defined[RELATIVE].repeats
        self.device.memory.values["TE"] = bits
        self.device.stale = True

    def next(self, t: float) -> tuple[float, int]:
        """When the next trip happens by itself, and which; infinite if none does."""
        found = (inf, 0)
        armed = self.armed
        if armed & POSITION and self._on_steps:
            found = min(found, (self.device.axis.stepping(self.defined[POSITION].value, t), POSITION))
        elif armed & POSITION:
            for place in self.device.axis.readings(self.defined[POSITION].value, t):
                found = min(found, (self.device.axis.passing(place, t), POSITION))
        if armed & TIME:
            found = min(found, (max(self._armed_at + self.defined[TIME].value / 1000, t), TIME))
        if armed & RELATIVE:
            distance = abs(self.defined[RELATIVE].value) * self.device.axis.scale
            for place in (self._base - distance, self._base + distance):
                found = min(found, (self.device.axis.passing(place, t), RELATIVE))
        return found

    def jumped(self, was: float, here: float, t: float) -> None:
        """P has been pushed from one place to another: trips in between happen, each once."""
        found = []
        if self.armed & POSITION and not self._on_steps:
            found += [(POSITION, place) for place in self.device.axis.readings(self.defined[POSITION].value, t)]
        if self.armed & RELATIVE:
            distance = abs(self.defined[RELATIVE].value) * self.device.axis.scale
            found += [(RELATIVE, self._base - distance), (RELATIVE, self._base + distance)]
        for bit, place in found:
            if self.armed & bit and was != here and (was - place) * (here - place) <= 0 and was != place:
                self.fire(bit, t)

    @property
    def _on_steps(self) -> bool:
        """Whether TP is in motor steps while P is not."""
        return self.device.model.trips_on_steps and self.device.memory.counting

    def input(self, n: int, t: float, capture: bool) -> None:
        """An input has become active."""
        armed = self.armed
        if armed & INPUT and self.defined[INPUT].value == n:
            self.fire(INPUT, t)
        if armed & CAPTURE and capture:
            self.fire(CAPTURE, t)

    def hmt(self, bits: int, t: float) -> bool:
        """Something has happened in hMT (bits of TA). Gives whether a trip waited for it."""
        if not self.armed & HMT or not self.defined[HMT].value & bits:
            return False
        self.fire(HMT, t)
        return True

    def fire(self, bit: int, t: float) -> None:
        """A trip happens: disarm it, capture the position, call its subroutine."""
        device, trip = self.device, self.defined[bit]
        if bit == RELATIVE:
            self._base = device.axis.place(t)
            self._left -= 1
        if bit != RELATIVE or (trip.repeats and self._left <= 0):
            device.memory.values["TE"] = self.armed & ~bit
        captures = bit != POSITION and (bit != RELATIVE or device.model.captures_relative)
        if captures and "PC" in device.memory.values:
            device.memory.values["PC"] = device.axis.counter(device.axis.source, t)
        device.stale = True
        device.output_lines.trip(t)
        device.interpreter.interrupt(trip.target, t)
