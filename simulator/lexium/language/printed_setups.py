"""The set-ups of inputs, outputs, limits and trips, as PR prints them (manual 5.1.64, 5.1.78, 5.1.93, 5.1.122)."""

from __future__ import annotations

from multidrop.dialects.mcode.manual.grammar import Name, Number
from multidrop.simulator.lexium.motion.inputs import Inputs
from multidrop.simulator.lexium.motion.limits import Limits
from multidrop.simulator.lexium.motion.outputs import Outputs
from multidrop.simulator.lexium.motion.trips import BITS, Trips

PRINTED_INPUTS = (1, 2, 3, 4, 6)


def fields(values: tuple[int, ...]) -> str:
    """Numbers as set-ups print them."""
    return ", ".join(str(each) for each in values)


class PrintedSetups:
    """The set-ups of one drive."""

    def __init__(self, inputs: Inputs, outputs: Outputs, limits: Limits, trips: Trips) -> None:
        self._inputs, self._outputs, self._limits, self._trips = inputs, outputs, limits, trips

    def lines(self, word: str) -> list[str]:
        """The lines of PR IS, PR OS or PR LS."""
        if word == "IS":
            return [f"IS = {n}, {self.point(n)}" for n in PRINTED_INPUTS]
        rows = self._outputs.types if word == "OS" else self._limits.software
        return [f"{word} = {n}, {fields(each)}" for n, each in rows.items()]

    def point(self, n: int) -> str:
        """PR S<n>."""
        return fields(self._inputs.types[n])

    def trip(self, word: str) -> str:
        """PR of a trip; 0 for one that is not set up."""
        trip = self._trips.defined.get(BITS[word])
        if trip is None:
            return "0"
        target = trip.target
        name = target.word if isinstance(target, Name) else str(target.value if isinstance(target, Number) else 0)
        if word in ("TC", "TM"):
            return name
        return f"{trip.value}, {name}" + (f", {trip.repeats}" if word == "TR" else "")
