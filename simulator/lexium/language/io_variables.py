"""The variables and flags of inputs, outputs and trips: what is more than a number in memory with a range."""

from __future__ import annotations

from functools import partial

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.language.variable_access import Readers, Writers
from multidrop.simulator.lexium.motion.inputs import Inputs
from multidrop.simulator.lexium.motion.jog import Jog
from multidrop.simulator.lexium.motion.outputs import Outputs
from multidrop.simulator.lexium.motion.trips import BITS, Trips
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import Value
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.ranges import Ranges
from multidrop.simulator.lexium.state.timeline import Timeline

POINTS = (1, 2, 3, 4, 9, 10, 11, 12)
"""Inputs and outputs that bear a word each."""
WITH_VALUE = ("TI", "TP", "TT", "TR", "TA")
"""Trips that read as the first number of their set-up."""


def readers(timeline: Timeline, inputs: Inputs, trips: Trips) -> Readers:
    """The readers of inputs and trips."""
    low, high = inputs.points.low, inputs.points.high

    def trip(bit: int) -> Value:
        defined = trips.defined.get(bit)
        return defined.value if defined else 0

    return {
        **{word: partial(trip, BITS[word]) for word in WITH_VALUE},
        "IN": lambda: inputs.levels((*low, *high)),
        "IL": lambda: inputs.levels(low),
        "IH": lambda: inputs.levels(high),
        "I5": lambda: inputs.analog(timeline.now),
        **{f"I{n}": partial(lambda n: int(inputs.active(n)), n) for n in POINTS},
    }


class IoWriters:
    """The writers of inputs, outputs and trips of one drive."""

    def __init__(
        self, memory: Memory, timeline: Timeline, inputs: Inputs, outputs: Outputs, trips: Trips, jog: Jog
    ) -> None:
        self._values, self._points, self._timeline = memory.values, memory.model.points, timeline
        self._inputs, self._outputs, self._trips, self._jog = inputs, outputs, trips, jog
        self._ranges = Ranges(memory)

    def table(self) -> Writers:
        """By word. A Lexium's outputs are one group."""
        points = self._points
        low = points.low if points.shared else points.outputs
        groups = {"OT": (*low, *points.high), "OL": low, "OH": points.high}
        return {
            "TE": lambda value: self._trips.arm(self._ranges.checked("TE", value), self._timeline.now),
            "JE": self._write_je,
            "FL": self._write_fl,
            **{word: partial(self._write_outputs, word, group) for word, group in groups.items()},
            **{f"O{n}": partial(self._write_output, n) for n in POINTS},
            **{f"D{n}": partial(self._write_filter, n) for n in POINTS},
        }

    def _write_output(self, n: int, value: Value) -> None:
        self._outputs.write(n, self._ranges.checked(f"O{n}", value))

    def _write_outputs(self, word: str, group: tuple[int, ...], value: Value) -> None:
        self._outputs.write_all(self._ranges.checked(word, value), group)

    def _write_filter(self, n: int, value: Value) -> None:
        self._values[f"D{n}"] = self._ranges.checked(f"D{n}", value)
        self._timeline.replan()

    def _write_fl(self, value: Value) -> None:
        """Following wants inputs 3 and 4 to be a clock; they are so together (manual 5.1.46)."""
        number, points = self._ranges.checked("FL", value), self._points
        if number and self._inputs.types[points.clocks[0]][0] not in points.clock_types:
            raise Fault(E.WRONG_CLOCK_TYPE)
        self._values["FL"] = number
        self._timeline.replan()

    def _write_je(self, value: Value) -> None:
        """Write JE, and let an active jog input turn. The line succeeds even if the motion may not begin."""
        self._values["JE"] = self._ranges.checked("JE", value)
        self._jog.update()
