"""Inputs and outputs of a simulated MCode drive: their set-up, levels, filters, and what becomes active when.

An input's level comes from whoever holds it by hand or by schedule; else from the switch that its type wires to it
(home, limits); else it idles, inactive. `refresh` looks at the levels and gives the inputs that have become active
since: edges are what limits and trips act on. I<n> is active and filtered, IN is the raw level. Manual 5.1.56 to
5.1.64, 5.1.90 to 5.1.94.
"""

from __future__ import annotations

from math import inf

from simulator.axis import Axis
from simulator.faults import Fault
from simulator.memory import Memory
from simulator.world import World

GENERAL, HOME, PLUS, MINUS, CAPTURE = 0, 1, 2, 3, 12
OUTPUT, TRIP_OUTPUT = 16, 28
CLOCKS = (13, 14, 15)
INPUT_TYPES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 13, 14, 15)
OUTPUT_TYPES = (16, 17, 18, 19, 20, 21, 23, 24, 25, 26, 27, 28, 29)
ONLY_ON = {26: 1, 27: 2, 28: 3}
"""Output types that one output only has."""

WRONG_TYPE, TYPED, BAD_NUMBER, WRONG = 8, 9, 10, 21


class Inputs:
    """The four digital inputs, the set-up of the others, and the outputs."""

    def __init__(self, memory: Memory, world: World, axis: Axis) -> None:
        self.memory, self.world, self.axis = memory, world, axis
        self.types: dict[int, tuple[int, ...]] = {}
        self.outputs: dict[int, tuple[int, ...]] = {}
        self.driven: dict[int, int] = {}
        self._raw: dict[int, int] = {}
        self._since: dict[int, float] = {}
        self._active: dict[int, bool] = {}
        self.defaults()

    def defaults(self) -> None:
        """Every input and output general purpose, active low."""
        self.types = {1: (0, 0), 2: (0, 0), 3: (0, 0), 4: (0, 0), 5: (9, 0), 6: (0, 0)}
        self.outputs = {n: (OUTPUT, 0) for n in (1, 2, 3)}
        self.driven = dict.fromkeys((1, 2, 3), 0)

    def set_up(self, values: list[int]) -> None:
        """IS. Raises Fault (8, 10, 21)."""
        n, *rest = values
        if n not in self.types:
            raise Fault(BAD_NUMBER)
        if n == 6 and len(rest) == 1:
            rest = [0, *rest]
        kind, active = (*rest, 0)[:2] if rest else (-1, 0)
        legal = {5: (9, 10), 6: (0,)}.get(n, INPUT_TYPES)
        if kind not in legal or len(rest) > 2 or active not in (0, 1):
            raise Fault(WRONG)
        if (kind == CAPTURE and n != 1) or (kind in CLOCKS and n not in (3, 4)):
            raise Fault(WRONG_TYPE)
        self.types[n] = (kind, active)
        if kind in CLOCKS:
            self.types[7 - n] = (kind, self.types[7 - n][1])
        elif n in (3, 4) and self.types[7 - n][0] in CLOCKS:
            self.types[7 - n] = (GENERAL, self.types[7 - n][1])

    def set_up_output(self, values: list[int]) -> None:
        """OS. Raises Fault (8, 10, 21)."""
        n, *rest = values
        if n not in self.outputs:
            raise Fault(BAD_NUMBER)
        kind, active = (*rest, 0)[:2] if rest else (-1, 0)
        if kind not in OUTPUT_TYPES or len(rest) > 2 or active not in (0, 1):
            raise Fault(WRONG)
        if ONLY_ON.get(kind, n) != n:
            raise Fault(WRONG_TYPE)
        self.outputs[n] = (kind, 0 if kind == TRIP_OUTPUT else active)

    def set_output(self, n: int, value: int) -> None:
        """Make a general purpose output active or not. Raises Fault (9)."""
        if self.outputs[n][0] != OUTPUT:
            raise Fault(TYPED)
        self.driven[n] = value

    def active(self, n: int) -> bool:
        """I<n>: active, filtered."""
        return self._active.get(n, False)

    def levels(self) -> int:
        """IN: the raw levels, input 1 the lowest bit."""
        return sum(self._raw.get(n, 1) << (n - 1) for n in (1, 2, 3, 4))

    def begin(self, t: float) -> None:
        """Take what is there at power-up as given, without edges."""
        self._since.clear()
        for n in (1, 2, 3, 4):
            self._raw[n] = self._level(n, t)
            self._active[n] = self._raw[n] == self.types[n][1]

    def refresh(self, t: float) -> tuple[list[int], list[int]]:
        """Look at the levels: the inputs that have become active since the last look, and those that ceased to be."""
        risen: list[int] = []
        fallen: list[int] = []
        for n in (1, 2, 3, 4):
            level = self._level(n, t)
            if level != self._raw.get(n):
                self._raw[n], self._since[n] = level, t
            wanted = level == self.types[n][1]
            if wanted == self._active.get(n, False):
                continue
            if t >= self._due(n):
                self._active[n] = wanted
                (risen if wanted else fallen).append(n)
        return risen, fallen

    def next_change(self, t: float) -> float:
        """The next time after `t` at which a level or a filtered state changes by itself; infinite if none does."""
        times = [inf]
        scheduled = self.world.next_change(t)
        if scheduled is not None:
            times.append(scheduled)
        if self.axis.moving(t) and any(self.types[n][0] in (HOME, PLUS, MINUS) for n in (1, 2, 3, 4)):
            switched = self.world.next_switch(self.axis.profile, t, self.world.pushed)
            if switched is not None:
                times.append(switched)
        for n, since in self._since.items():
            pending = (self._raw[n] == self.types[n][1]) != self._active[n]
            if pending and since <= t < self._due(n):
                times.append(self._due(n))
        return min(times)

    def _due(self, n: int) -> float:
        """When the level that an input has now has stood long enough."""
        return self._since.get(n, 0.0) + self.memory.values[f"D{n}"] / 1000

    def _level(self, n: int, t: float) -> int:
        held = self.world.level(n, t)
        if held is not None:
            return held
        kind, active = self.types[n]
        if kind not in (HOME, PLUS, MINUS):
            return 1 - active
        closed = self.world.switches(self.axis.position(t) + self.world.pushed)[kind - 1]
        return active if closed else 1 - active
