"""Outputs of a simulated MCode drive: their set-up, and what makes each of them active.

A program drives an output of type 16. Any other one follows the drive's own state, worked out when it is read.
Active is set by the program, the level by the wiring: the third number of OS says which level is active.
The trip output (28, output 3 only) gives a pulse as long as CW says. Manual 3.4.3, 5.1.5, 5.1.24, 5.1.90 to 5.1.94.

Of the events of AO the manual's text has lost the table. Known are 1 (error), 4 and 8 (lead and lag limit), 512 (hold
current), 16384 (moving) and 32768 (stall); the others in `_states` are a choice, and bits above 32768 do nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.simulator.motion.feedback import FIXED, HYBRID, LAG, LEAD, MOST, VARIABLE
from multidrop.families.lexium.simulator.motion.motor import LexiumMotor
from multidrop.families.lexium.simulator.state.errors import DriveFault
from multidrop.families.lexium.simulator.state.interpreter import Core

GENERAL, MOVING, ERROR, STALL, CHANGING, LOCKED_ROTOR, POSITIONING = 16, 17, 18, 19, 20, 21, 23
HMT_ACTIVE, MAKING_UP, COUNT_A, COUNT_B, TRIP, ATTENTION, POINT_TRIP = 24, 25, 26, 27, 28, 29, 61
"""Types of outputs."""
HMT_TYPES = frozenset({LOCKED_ROTOR, HMT_ACTIVE, MAKING_UP})
"""They need hMT."""
CLOCK_TYPES = (49, 50, 51)
"""They put out the clock of an MDrivePlus, which nothing here hears."""
NOT_ONE = -1
"""The type of an MDrivePlus's point that is an input."""
PULSE_UNIT = 50e-9
"""What CW counts, s."""

State = Callable[[float], bool]
"""True while an output is active; takes the time."""


class Outputs:
    """All outputs of a drive. `types` holds type and active level by number, `driven` what O<n> said."""

    def __init__(self, core: Core, motor: LexiumMotor) -> None:
        self._values, self._timeline, self._points = core.values, core.timeline, core.model.points
        self.types: dict[int, tuple[int, ...]] = {}
        self.driven: dict[int, int] = {}
        self._states = _states(core, motor)
        self.defaults()

    def defaults(self) -> None:
        """Make each one general purpose, active low, inactive; the points of an MDrivePlus begin as inputs."""
        kind = NOT_ONE if self._points.shared else GENERAL
        self.types = dict.fromkeys(self._points.outputs, (kind, 0))
        self.driven = dict.fromkeys(self._points.outputs, 0)

    def restore(self, types: Mapping[int, tuple[int, ...]]) -> None:
        """Take back what NVM keeps; those that a program drives are left as they are."""
        driven = self.driven
        self.defaults()
        self.types.update(types)
        self.driven = driven

    def set_up(self, values: list[int]) -> None:
        """Carry out OS. Raises DriveFault (6, 8, 10, 21)."""
        n, *rest = values
        if n not in self.types:
            raise DriveFault(E.NO_SUCH_POINT)
        kind, active = (*rest, 0)[:2] if rest else (-1, 0)
        if len(rest) > 2 or active not in (0, 1):
            raise DriveFault(E.OUT_OF_RANGE)
        if kind not in self._points.output_types[n] or (kind in HMT_TYPES and "AS" not in self._values):
            raise DriveFault(E.WRONG_POINT_TYPE)
        several = kind in (GENERAL, *CLOCK_TYPES)
        if not several and any(kind == self.types[k][0] for k in self.types if k != n):
            raise DriveFault(E.TYPE_IN_USE)
        self.types[n] = (kind, 0 if kind == TRIP else active)

    def release(self, n: int) -> None:
        if n in self.types:
            self.types[n] = (NOT_ONE, 0)

    def write(self, n: int, value: int) -> None:
        """Carry out O<n>: make a general purpose output active or not. Raises DriveFault (9)."""
        if self.types[n][0] != GENERAL:
            raise DriveFault(E.NOT_USER_OUTPUT)
        self.driven[n] = value

    def write_all(self, group: Sequence[int], value: int) -> None:
        """Carry out OT, OL, OH; only points of type 16 change. Raises DriveFault (9) if a Lexium has none of them."""
        free = [(place, n) for place, n in enumerate(group) if self.types[n][0] == GENERAL]
        if not (free or self._points.shared):
            raise DriveFault(E.NOT_USER_OUTPUT)
        for place, n in free:
            self.driven[n] = value >> place & 1

    def active(self, n: int, t: float) -> bool:
        """Return whether an output is active at a time not before the last one."""
        kind = self.types[n][0]
        if kind == GENERAL:
            return bool(self.driven[n])
        return kind in self._states and self._states[kind](t)

    def put_out(self, n: int) -> int | None:
        if not self._points.shared or self.types.get(n, (NOT_ONE,))[0] == NOT_ONE:
            return None
        return self.level(n, self._timeline.now)

    def level(self, n: int, t: float) -> int:
        """1 (high) or 0 (low)."""
        return self.types[n][1] if self.active(n, t) else 1 - self.types[n][1]


def _states(core: Core, motor: LexiumMotor) -> Mapping[int, State]:
    """Make the state that each type of output follows."""
    values, timeline = core.values, core.timeline
    status, hmt, trips, counters = motor.status, motor.hmt, motor.trips, motor.counters

    def flag(word: str) -> State:
        return lambda t: bool(values.get(word))

    def hmt_bit(mask: int) -> State:
        return lambda t: "AF" in values and bool(hmt.status(timeline.now) & mask)

    def quadrature(offset: int) -> State:
        return lambda t: bool((counters.value("C2", t) + offset) >> 1 & 1)

    def tripped(t: float) -> bool:
        return 0 <= t - trips.fired_at <= values["CW"] * PULSE_UNIT

    def making_up(t: float) -> bool:
        return values.get("AS") in (FIXED, VARIABLE) and hmt.lag(timeline.now) != 0

    states: dict[int, State] = {
        MOVING: status.moving_or_settling,
        ERROR: flag("EF"),
        STALL: flag("ST"),
        CHANGING: status.changing,
        LOCKED_ROTOR: flag("LR"),
        POSITIONING: status.positioning,
        HMT_ACTIVE: hmt_bit(HYBRID),
        MAKING_UP: making_up,
        COUNT_A: quadrature(0),
        COUNT_B: quadrature(1),
        TRIP: tripped,
        POINT_TRIP: tripped,
    }
    heat, switches, bridges = motor.heat, motor.limits.switches, motor.bridges
    events: dict[int, State] = {
        1: states[ERROR],
        2: states[LOCKED_ROTOR],
        4: hmt_bit(LEAD),
        8: hmt_bit(LAG),
        16: hmt_bit(MOST),
        32: states[HMT_ACTIVE],
        64: lambda t: "IT" in values and round(heat.bridge(timeline.now)) > values["WT"],
        128: states[MAKING_UP],
        256: lambda t: not bridges.supply,
        512: heat.holding,
        1024: lambda t: 1 in switches,
        2048: lambda t: -1 in switches,
        4096: states[CHANGING],
        8192: states[POSITIONING],
        16384: states[MOVING],
        32768: states[STALL],
    }

    def attention(t: float) -> bool:
        mask = int(values["AO"])
        return any(mask & bit and holds(t) for bit, holds in events.items())

    return {**states, ATTENTION: attention}
