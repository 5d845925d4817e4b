"""The settings of a simulated PMX-2ED-SA: registers, flash, and the speed windows of appendix A.

A register has the name of its ASCII command (`HSPDX`). Values are whole numbers; StepNLoop ratios are kept in
thousandths. An individual speed, acceleration or correction amount of 0 means the global one (manual 7.1). Factory
values are our choice where the manual prints none (7.15 to 7.20 name none at all).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from multidrop.dialects.pmx.manual.script_parser import KEPT_VARIABLES

AXES = ("X", "Y")
INT32 = 2**31
FASTEST = 6_000_000
"""Pulses/s, the upper end of the last window."""
LONGEST = 10_000_000
"""The longest acceleration time that is accepted, ms; no more is used than appendix A allows."""
VARIABLES = 64
SCALE = 1000
"""StepNLoop ratios are kept in thousandths."""


class Register(NamedTuple):
    """A value that can be read and set: its range, its factory value, and whether STORE keeps it (7.20)."""

    low: int
    high: int
    factory: int = 0
    kept: bool = True
    idle: bool = False
    """Whether it can be set only while its axis is at rest."""


FLAG = Register(0, 1)
COUNT = Register(-INT32, INT32 - 1)

GLOBAL = {
    "HSPD": Register(1, FASTEST, 1000, kept=False),
    "LSPD": Register(1, FASTEST, 100, kept=False),
    "ACC": Register(1, LONGEST, 300, kept=False),
    "DEC": Register(1, LONGEST, 300, kept=False),
    "EDEC": FLAG,
    "IERR": FLAG,
    "RZ": FLAG,
    "DB": Register(1, 5, 1),
    "DOBOOT": Register(0, 255),
    "EOBOOT": Register(0, 3, 3),
    "HCA": Register(0, INT32 - 1, 1000),
    "LCA": Register(0, INT32 - 1, 1000),
    "SLOAD": Register(0, 3),
    "TOC": Register(0, INT32 - 1),
}
BY_AXIS = {
    "HSPD": Register(0, FASTEST, kept=False),
    "LSPD": Register(0, FASTEST, kept=False),
    "ACC": Register(0, LONGEST, kept=False),
    "DEC": Register(0, LONGEST, kept=False),
    "HCA": Register(0, INT32 - 1),
    "LCA": Register(0, INT32 - 1),
    "POL": Register(0, 0x3FFF),
    "SCV": FLAG,
    "SL": Register(0, 1, idle=True),
    "SLR": Register(1, 999_999, SCALE, idle=True),
    "SLT": Register(0, INT32 - 1, 10),
    "SLE": Register(0, INT32 - 1, 1000),
    "SLA": Register(0, INT32 - 1, 10),
    "SSPDM": Register(0, 9, kept=False, idle=True),
}
JOYSTICK = {
    "JV1": Register(0, FASTEST, 10_000),
    "JV2": Register(0, FASTEST, 10_000),
    "JV3": Register(0, FASTEST, 1000),
    "JV4": Register(0, FASTEST, 1000),
    "JV5": Register(0, 5000, 100),
    "JV6": Register(0, 5000, 100),
    **{f"JL{n}": COUNT._replace(factory=place) for n, place in enumerate((-10_000, -9000, 9000, 10_000) * 2, 1)},
}


def _registers() -> Iterator[tuple[str, Register]]:
    yield from GLOBAL.items()
    yield from JOYSTICK.items()
    yield "JO", Register(0, 3)
    for name, register in BY_AXIS.items():
        for axis in AXES:
            yield name + axis, register


REGISTERS = dict(_registers())


class Window(NamedTuple):
    """A row of table A.0: the speeds from above `low` to `high` pulses/s, its lowest low speed, and its delta."""

    low: int
    high: int
    slowest: int
    delta: int


WINDOWS = (
    Window(0, 16_000, 1, 300),
    Window(16_000, 32_000, 1, 775),
    Window(32_000, 80_000, 5, 1900),
    Window(80_000, 160_000, 10, 3700),
    Window(160_000, 325_000, 20, 7300),
    Window(325_000, 815_000, 50, 18_000),
    Window(815_000, 1_600_000, 100, 38_400),
    Window(1_600_000, 3_200_000, 200, 68_000),
    Window(3_200_000, FASTEST, 400, 135_000),
)
"""By SSPDM from 1 on."""


def window(speed: float) -> Window:
    """Find the window of a high speed, pulses/s; the boundary belongs to the lower window."""
    return next((each for each in WINDOWS if speed <= each.high), WINDOWS[-1])


def rate(low: float, high: float, milliseconds: float) -> float:
    """Pulses/s2 between two speeds in a time, limited to what appendix A allows (A.1)."""
    longest = max((high - low) / window(high).delta * 1000, 1.0)
    return max(high - low, 1.0) / (min(max(milliseconds, 1.0), longest) / 1000)


class Settings:
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


class Refusal(Exception):
    """A refused command. The text is the reply (table 9.1); empty: `?` and the command."""
