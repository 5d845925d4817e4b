"""Inputs of a simulated MCode drive: their set-up, levels, filters, and what becomes active when.

An input's level comes from the hand or the schedule that holds it, else from the switch that its type wires to it, else
it idles, inactive. `refresh` reads the levels and returns the edges, on which `event_loop` and trips act. I<n> is
active and filtered, IN is the raw level. D1 to D4 do not filter a capture or clock input: FC and FM do, by less
than a program can see. A point of an MDrivePlus that is an output reads as what it puts out, and has no edges. Manual
5.1.25, 5.1.26, 5.1.44, 5.1.56 to 5.1.66.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.simulator.motion.rotor import LexiumRotor
from multidrop.families.lexium.simulator.state.errors import DriveFault
from multidrop.families.lexium.simulator.state.interpreter import Core
from multidrop.families.lexium.simulator.state.models import STEP_DIRECTION, UP_DOWN

GENERAL, HOME, PLUS, MINUS, GO, SOFT_STOP, PAUSE, JOG_PLUS, JOG_MINUS, RESET = 0, 1, 2, 3, 4, 5, 6, 7, 8, 11
"""Types of inputs; those of clocks and captures differ between products."""
SWITCHES = (HOME, PLUS, MINUS)
ANALOG, INDEX = 5, 6
CURRENT, LIVE_ZERO = 10, 1
"""The analog input for 4 to 20 mA (the manual's 7.2.6)."""
SAMPLE = 0.001
"""Time between two readings that D5 averages, s (not in the manual)."""

Filtered = tuple[list[int], list[int]]
"""The inputs that have become active since the last look, and those that ceased to be."""


class Inputs:
    """The digital inputs, the analog one, and the set-up of all. `watched`: something comes of what they do.

    `put_out` gives the level of a point that is an output, None for an input.
    """

    def __init__(self, core: Core, rotor: LexiumRotor) -> None:
        self._values, self._world, self._rotor = core.values, core.world, rotor
        self.points = core.model.points
        self.numbers = self.points.inputs
        self.types: dict[int, tuple[int, ...]] = {}
        self.watched = True
        self.put_out: Callable[[int], int | None] = lambda n: None
        self._unfiltered = frozenset({self.points.capture, *self.points.clock_types})
        outputs = self.points.output_types.values() if self.points.shared else ()
        self._outputs = frozenset().union(*outputs)
        self._raw: dict[int, int] = {}
        self._since: dict[int, float] = {}
        self._active: dict[int, bool] = {}
        self._analog = (0.0, 0, 0.0)
        self.defaults()

    def defaults(self) -> None:
        self.types = dict(self.points.fresh)

    def restore(self, types: Mapping[int, tuple[int, ...]]) -> None:
        self.defaults()
        self.types.update(types)

    def set_up(self, values: list[int]) -> None:
        """Carry out IS, or S<n> of an input. Raises DriveFault (6, 8, 10, 21, 24)."""
        n, *rest = values
        if n not in self.types:
            raise DriveFault(E.NO_SUCH_POINT)
        if n not in self.points.input_types:
            raise DriveFault(E.ILLEGAL_DATA)
        if n == INDEX and len(rest) == 1:
            rest = [0, *rest]
        kind, active = (*rest, 0)[:2] if rest else (-1, 0)
        if len(rest) > 2 or active not in (0, 1):
            raise DriveFault(E.OUT_OF_RANGE)
        if kind not in self.points.input_types[n]:
            raise DriveFault(E.WRONG_POINT_TYPE)
        clocks = self.points.clock_types
        several = kind in (GENERAL, *clocks)
        if not several and any(self.types[k][0] == kind for k in self.numbers if k != n):
            raise DriveFault(E.TYPE_IN_USE)
        self.types[n] = (kind, active)
        if n in self.points.clocks:  # both inputs of a clock have one type; the other of a former clock becomes free
            other = sum(self.points.clocks) - n
            was, level = self.types[other][:2]
            if kind in clocks or was in clocks:
                self.types[other] = (kind if kind in clocks else GENERAL, level)

    def active(self, n: int) -> bool:
        """I<n>: active, filtered."""
        level = self.put_out(n)
        return self._active.get(n, False) if level is None else level == self.types[n][1]

    def active_types(self) -> list[int]:
        return [self.types[n][0] for n in self.numbers if self._active.get(n)]

    def has(self, kind: int) -> bool:
        return any(self.types[n][0] == kind for n in self.numbers)

    def wants(self, kind: int) -> int:
        """1 while an input of this type is active, else 0."""
        return int(kind in self.active_types())

    def level(self, n: int) -> int:
        """The raw level of a point: 1 is +V."""
        level, held = self.put_out(n), self._raw.get(n, 1)
        return held if level is None else level

    def levels(self, group: Sequence[int]) -> int:
        """IN, IL, IH: the raw levels of several, the first one the lowest bit."""
        return sum(self.level(n) << place for place, n in enumerate(group))

    def begin(self, t: float) -> None:
        """Take the levels at power-up as given, without edges."""
        self._since.clear()
        counts = self._counts(t)
        self._analog = (float(counts), counts, t)
        for n, level in zip(self.numbers, self._levels(t), strict=True):
            self._raw[n] = level
            self._active[n] = level == self.types[n][1]

    def refresh(self, t: float) -> Filtered:
        self._settle_analog(t)
        risen: list[int] = []
        fallen: list[int] = []
        raw, active, types = self._raw, self._active, self.types
        for n, level in zip(self.numbers, self._levels(t), strict=True):
            if level != raw.get(n):
                raw[n], self._since[n] = level, t
            wanted = level == types[n][1]
            if wanted != active.get(n, False) and t >= self._due(n):
                self._active[n] = wanted
                (risen if wanted else fallen).append(n)
        return (risen, fallen) if self.watched else ([], [])

    def next_change(self, t: float) -> float:
        """The next time after `t` at which a level or a filtered state changes by itself; infinite if none does."""
        times, types = [self._world.next_change(t)], self.types
        if any([types[n][0] in SWITCHES for n in self.numbers]):
            times.append(self._rotor.next_switch(t))
        for n, since in self._since.items():
            pending = (self._raw[n] == types[n][1]) != self._active[n]
            if pending and since <= t < self._due(n):
                times.append(self._due(n))
        return min(times)

    def analog(self, t: float) -> int:
        """I5: the running average of the analog input's counts (manual 5.1.26)."""
        self._settle_analog(t)
        return int(self._analog[0] + 0.5)

    def _settle_analog(self, t: float) -> None:
        """Add the analog readings since the last look to the average."""
        average, counts, since = self._analog
        weight, fresh = self._values["D5"], self._counts(t)
        if weight < 2:
            self._analog = (float(fresh), fresh, t)
            return
        readings = int((t - since) / SAMPLE + 1e-6)
        average = counts + (average - counts) * ((weight - 1) / weight) ** readings
        self._analog = (average, fresh, since + readings * SAMPLE)

    def _counts(self, t: float) -> int:
        sense, scale = self.types[ANALOG][:2]
        counts = self._world.analog(t)
        return min(counts, self.points.live_zero) if (sense, scale) == (CURRENT, LIVE_ZERO) else counts

    def _due(self, n: int) -> float:
        """When the level that an input has now passes its filter."""
        filtered = 0.0 if self.types[n][0] in self._unfiltered else self._values.get(f"D{n}", 0) / 1000
        return self._since.get(n, 0.0) + filtered

    def _levels(self, t: float) -> list[int]:
        """The raw level of each input."""
        driven, closed = self._world.driven(t), None
        levels = []
        for n in self.numbers:
            input_kind = self.types[n]
            kind, idle = input_kind[0], 1 - input_kind[1]
            if kind in self._outputs:
                level = idle
            elif n in driven:
                level = driven[n]
            elif kind in SWITCHES:
                closed = closed or self._world.switches(self._rotor.physical(t))
                level = input_kind[1] if closed[kind - 1] else idle
            else:
                level = idle
            levels.append(level)
        return levels


# The clock inputs: with FL or CM one step for each pulse, or each edge of a quadrature, times CR.
#
# Manual 5.1.46; MDrivePlus 5-13, 5-14.


_TURNS = {(0, 0): 0, (0, 1): 1, (1, 1): 2, (1, 0): 3}
"""The four states of A and B in the order that counts up."""


class ClockInputs:
    """The clock of one drive, which is two of its inputs."""

    def __init__(self, core: Core, inputs: Inputs) -> None:
        self._values, self._inputs = core.values, inputs
        self._states = (1, 1)
        self._part = 0.0

    def steps(self) -> int:
        """Whole steps that the clock has asked for since the last look, with a sign."""
        values, inputs, points = self._values, self._inputs, self._inputs.points
        kind = points.clock_types.get(inputs.types[points.clocks[0]][0]) if points.clocks else None
        if kind is None:
            return 0
        was, now = self._states, tuple(int(inputs.level(n) == inputs.types[n][1]) for n in points.clocks)
        self._states = (now[0], now[1])
        if not values.get(points.follow) or was == now:
            return 0
        self._part += _pulses(kind, was, self._states) * values.get("CR", 1)
        steps = int(self._part)
        self._part -= steps
        return steps


def _pulses(kind: str, was: tuple[int, int], now: tuple[int, int]) -> int:
    """What a clock has counted between two states of its inputs, with a sign."""
    rises = [int(new and not old) for old, new in zip(was, now, strict=True)]
    if kind == STEP_DIRECTION:
        return rises[0] * (1 if now[1] else -1)
    if kind == UP_DOWN:
        return rises[0] - rises[1]
    steps = (_TURNS[now] - _TURNS[was] + 1) % 4 - 1
    return 0 if steps == 2 else steps
