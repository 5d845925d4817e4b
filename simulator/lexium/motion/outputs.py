"""Outputs of a simulated MCode drive: their set-up, and what makes each of them active.

An output of type 16 does as it is told; any other one follows the drive's own state, worked out when somebody looks.
Active is a matter of the program, the level one of the wiring: the third number of OS says which level is active.
The trip output (28, output 3 only) gives a pulse as long as CW says. Manual 3.4.3, 5.1.5, 5.1.24, 5.1.90 to 5.1.94.

Of the events of AO the manual's text has lost the table. Known are 1 (error), 4 and 8 (lead and lag limit), 512 (hold
current), 16384 (moving) and 32768 (stall); the others in `ATTENTION` are a choice, and bits above 32768 do nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from typing import TYPE_CHECKING

from simulator.lexium.state.errors import Fault
from simulator.lexium.state.variables import READERS

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice

GENERAL, TRIP, POINT_TRIP = 16, 28, 61
HMT_TYPES = frozenset({21, 24, 25})
"""They need hMT."""
CLOCK_TYPES = (49, 50, 51)
"""They put out the clock of an MDrivePlus, which nothing here hears."""
NOT_ONE = -1
"""The type of an MDrivePlus's point that is an input."""
PULSE_UNIT = 50e-9
"""What CW counts, s."""
LEAD_LIMIT, LAG_LIMIT, MOST_LAG, HYBRID = 1, 2, 4, 16
"""Bits of AF."""

SAME_TYPE, WRONG_TYPE, TYPED, BAD_NUMBER, WRONG = 6, 8, 9, 10, 21

State = Callable[["MCodeDevice", float], bool]


class Outputs:
    """All outputs of a drive. `types` holds type and active level by number, `driven` what O<n> said."""

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device
        self.points = device.memory.model.points
        self.types: dict[int, tuple[int, ...]] = {}
        self.driven: dict[int, int] = {}
        self.tripped = -inf
        self.defaults()

    def defaults(self) -> None:
        """Every one general purpose, active low, inactive; the points of an MDrivePlus begin as inputs."""
        kind = NOT_ONE if self.points.shared else GENERAL
        self.types = dict.fromkeys(self.points.outputs, (kind, 0))
        self.driven = dict.fromkeys(self.points.outputs, 0)

    def restore(self, types: Mapping[int, tuple[int, ...]]) -> None:
        """Take back what NVM keeps; those that a program drives are left as they are."""
        driven = self.driven
        self.defaults()
        self.types.update(types)
        self.driven = driven

    def set_up(self, values: list[int]) -> None:
        """OS. Raises Fault (6, 8, 10, 21)."""
        n, *rest = values
        if n not in self.types:
            raise Fault(BAD_NUMBER)
        kind, active = (*rest, 0)[:2] if rest else (-1, 0)
        if len(rest) > 2 or active not in (0, 1):
            raise Fault(WRONG)
        if kind not in self.points.output_types[n] or (kind in HMT_TYPES and "AS" not in self.device.memory.values):
            raise Fault(WRONG_TYPE)
        if kind not in (GENERAL, *CLOCK_TYPES) and any(kind == self.types[k][0] for k in self.types if k != n):
            raise Fault(SAME_TYPE)
        self.types[n] = (kind, 0 if kind == TRIP else active)

    def release(self, n: int) -> None:
        """A point of an MDrivePlus becomes an input."""
        if n in self.types:
            self.types[n] = (NOT_ONE, 0)

    def write(self, n: int, value: int) -> None:
        """O<n>: make a general purpose output active or not. Raises Fault (9)."""
        if self.types[n][0] != GENERAL:
            raise Fault(TYPED)
        self.driven[n] = value

    def write_all(self, value: int, group: Sequence[int]) -> None:
        """OT, OL, OH: several at once, but those that follow the drive. Raises Fault (9) if all of them do."""
        free = [(place, n) for place, n in enumerate(group) if self.types[n][0] == GENERAL]
        if not free:
            raise Fault(TYPED)
        for place, n in free:
            self.driven[n] = value >> place & 1

    def trip(self, t: float) -> None:
        """A trip has happened: the trip output's pulse begins."""
        self.tripped = t

    def active(self, n: int, t: float) -> bool:
        """Whether an output is active at a time not before the last one."""
        kind = self.types[n][0]
        if kind == GENERAL:
            return bool(self.driven[n])
        return kind in STATES and STATES[kind](self.device, t)

    def put_out(self, n: int) -> int | None:
        """The level of a point that is an output, now; None for an input."""
        if not self.points.shared or self.types.get(n, (NOT_ONE,))[0] == NOT_ONE:
            return None
        return self.level(n, self.device.now)

    def level(self, n: int, t: float) -> int:
        """1 (high) or 0 (low)."""
        return self.types[n][1] if self.active(n, t) else 1 - self.types[n][1]


def read(device: MCodeDevice, word: str) -> int:
    """A variable's value now; 0 where this product lacks it."""
    if word not in device.memory.values:
        return 0
    special = READERS.get(word)
    return int(special(device) if special else device.memory.values[word])


def _flag(word: str, mask: int = -1) -> State:
    """Active while a variable has one of these bits."""
    return lambda device, t: bool(read(device, word) & mask)


def _moving(device: MCodeDevice, t: float) -> bool:
    """With the settling and holding delays behind a motion of any kind (manual 5.1.93)."""
    axis, values = device.axis, device.memory.values
    if device.memory.model.settles:
        return axis.reported(t)
    return axis.moving(t) or (axis.kind != "" and t < axis.over_at() + (values["HT"] + values["MT"]) / 1000)


def _holding(device: MCodeDevice, t: float) -> bool:
    """Whether the current has fallen to HC, which it does not with HT and MT both 0, nor while there is none."""
    return device.motor.heat.holding(t)


def _tripped(device: MCodeDevice, t: float) -> bool:
    since = t - device.output_lines.tripped
    return 0 <= since <= device.memory.values["CW"] * PULSE_UNIT


def _quadrature(offset: int, device: MCodeDevice, t: float) -> bool:
    return bool((device.axis.counter("C2", t) + offset) >> 1 & 1)


def _making_up(device: MCodeDevice, t: float) -> bool:
    return bool(read(device, "AS") in (1, 2) and read(device, "LL"))


def _attention(device: MCodeDevice, t: float) -> bool:
    mask = int(device.memory.values["AO"])
    return any(mask & bit and holds(device, t) for bit, holds in ATTENTION.items())


STATES: Mapping[int, State] = {
    17: _moving,
    18: _flag("EF"),
    19: _flag("ST"),
    20: lambda device, t: device.axis.changing(t),
    21: _flag("LR"),
    23: lambda device, t: device.axis.positioning(t),
    24: _flag("AF", HYBRID),
    25: _making_up,
    26: partial(_quadrature, 0),
    27: partial(_quadrature, 1),
    TRIP: _tripped,
    POINT_TRIP: _tripped,
    29: _attention,
}
"""What each type of output follows."""

ATTENTION: Mapping[int, State] = {
    1: STATES[18],
    2: STATES[21],
    4: _flag("AF", LEAD_LIMIT),
    8: _flag("AF", LAG_LIMIT),
    16: _flag("AF", MOST_LAG),
    32: STATES[24],
    64: lambda device, t: read(device, "IT") > device.memory.values["WT"],
    128: STATES[25],
    256: lambda device, t: not device.axis.supply,
    512: _holding,
    1024: lambda device, t: 1 in device.axis.blocked,
    2048: lambda device, t: -1 in device.axis.blocked,
    4096: STATES[20],
    8192: STATES[23],
    16384: STATES[17],
    32768: STATES[19],
}
"""What each bit of AO looks at."""
