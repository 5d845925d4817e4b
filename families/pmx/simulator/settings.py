"""The settings of a simulated PMX-2ED-SA: registers, flash, and the speed windows of appendix A.

`registers.csv` has the registers: a register has the name of its ASCII command (`HSPDX`), `each` is one of each axis,
`lost` one that STORE does not keep. Values are whole numbers; StepNLoop ratios are kept in thousandths. An individual
speed, acceleration or correction amount of 0 means the global one (manual 7.1). Of an acceleration time no more is used
than appendix A allows. Factory values are our choice where the manual prints none (7.15 to 7.20 name none at all).
"""

from __future__ import annotations

from typing import NamedTuple

from multidrop.base.files import rows
from multidrop.families.pmx.manual.script_parser import KEPT_VARIABLES

AXES = ("X", "Y")
INT32 = 2**31
FASTEST_SPEED = 6_000_000
"""Pulses/s, the upper end of the last window."""
VARIABLES = 64
SCALE = 1000
"""StepNLoop ratios are kept in thousandths."""


class PmxRegister(NamedTuple):
    """A value that can be read and set: its range, its factory value, and whether STORE keeps it (7.20)."""

    low: int
    high: int
    factory: int = 0
    kept: bool = True
    idle: bool = False
    """Whether it can be set only while its axis is at rest."""


REGISTERS = {
    row["name"] + axis: PmxRegister(
        int(row["low"]), int(row["high"]), int(row["factory"]), not row["lost"], bool(row["idle"])
    )
    for row in rows(__file__, "registers.csv")
    for axis in (AXES if row["each"] else ("",))
}


class SpeedWindow(NamedTuple):
    """A row of table A.0: the speeds from above `low` to `high` pulses/s, its lowest low speed, and its delta."""

    low: int
    high: int
    slowest: int
    delta: int


WINDOWS = (
    SpeedWindow(0, 16_000, 1, 300),
    SpeedWindow(16_000, 32_000, 1, 775),
    SpeedWindow(32_000, 80_000, 5, 1900),
    SpeedWindow(80_000, 160_000, 10, 3700),
    SpeedWindow(160_000, 325_000, 20, 7300),
    SpeedWindow(325_000, 815_000, 50, 18_000),
    SpeedWindow(815_000, 1_600_000, 100, 38_400),
    SpeedWindow(1_600_000, 3_200_000, 200, 68_000),
    SpeedWindow(3_200_000, FASTEST_SPEED, 400, 135_000),
)
"""By SSPDM from 1 on."""


def window(speed: float) -> SpeedWindow:
    """Find the window of a high speed, pulses/s; the boundary belongs to the lower window."""
    return next((window for window in WINDOWS if speed <= window.high), WINDOWS[-1])


def rate(low: float, high: float, milliseconds: float) -> float:
    """Pulses/s2 between two speeds in a time, limited to what appendix A allows (A.1)."""
    longest = max((high - low) / window(high).delta * 1000, 1.0)
    return max(high - low, 1.0) / (min(max(milliseconds, 1.0), longest) / 1000)


class PmxSettings:
    """The registers of one controller, its name and variables, and the flash that keeps them."""

    def __init__(self, number: str) -> None:
        self.values = {name: register.factory for name, register in REGISTERS.items()}
        self.number = number
        self.wanted = number
        self.variables = [0] * VARIABLES
        self._flash: tuple[dict[str, int], str, list[int]]
        self.store()

    def __getitem__(self, name: str) -> int:
        return self.values[name]

    def __setitem__(self, name: str, value: int) -> None:
        self.values[name] = value

    def of(self, name: str, axis: str) -> int:
        """The value for an axis: its own, or the global one if that is 0."""
        return self.values[name + axis] or self.values[name]

    def store(self) -> None:
        """Write to flash what it keeps (7.20)."""
        kept = {name: self.values[name] for name, register in REGISTERS.items() if register.kept}
        self._flash = kept, self.wanted, [self.variables[n] for n in KEPT_VARIABLES]

    def power_up(self) -> None:
        """Begin with what flash holds; everything else has its factory value."""
        kept, self.number, variables = self._flash
        self.wanted = self.number
        self.values = {name: kept.get(name, register.factory) for name, register in REGISTERS.items()}
        self.variables[:] = [0] * KEPT_VARIABLES.start + list(variables)


def wrapped(value: float) -> int:
    """Wrap a value around in 32 bits, as the counters do."""
    return (round(value) + INT32) % (2 * INT32) - INT32


class PmxRefusal(Exception):
    """A refused command. The text is the reply (table 9.1); empty: `?` and the command."""
