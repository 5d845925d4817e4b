"""The registers of a Lexium Ethernet drive, and the functions that carry other words.

`registers.csv` has a row for each name that has a register, `functions.csv` one for each word that another function
carries. Each cell says something: `-` is none.

Source: section 5 of the Modbus/TCP manual. It contradicts itself and the MCode reference in places; the rulings are in
docs/rulings.md and docs/modbus.md. A value of 4 bytes takes two registers, its low word first.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

from multidrop.base.files import rows

INT32 = (-(2**31), 2**31 - 1)


class WrittenValue(StrEnum):
    """What a write gives to a register."""

    NOTHING = "-"
    VALUE = "value"
    VARIABLE = "variable"
    """The address of a variable's register."""
    COMMAND = "command"
    """Any value: it is a command without one."""


DIFFERENCES = frozenset({"values", "range", "note"})


@dataclass(frozen=True)
class ModbusRegister:
    """One name's place in the register map."""

    name: str
    """The MCode mnemonic."""
    address: int
    count: int
    """Number of registers: 1 or 2."""
    width: int
    """Number of significant bytes: 1, 2 or 4. Only values of 4 bytes are signed."""
    access: str
    """RW, RO, WO, or RC: reading clears it."""
    limits: str
    """The values it accepts or shows: `0..255`, `int32`, single values, or both; empty if unstated."""
    default: int | None
    only: str
    """`closed loop` or `hMT`, where other drives lack it."""
    takes: WrittenValue
    """What a write gives it."""
    differs: frozenset[str]
    """What is not as MCode has it.

    `values`: all of them. `range`: the one of MCode does not narrow it. `note`: its form contradicts that of MCode.
    """
    form: str
    """How its value differs from the one that MCode has for the name; empty: it is the same."""

    @property
    def readable(self) -> bool:
        return self.access != "WO"

    @property
    def writable(self) -> bool:
        return self.access != "RO"

    @property
    def addresses(self) -> range:
        return range(self.address, self.address + self.count)

    @cached_property
    def spans(self) -> tuple[tuple[int, int], ...]:
        """The range as pairs of lowest and highest; VI and VM without each other's bound; empty: any value."""
        text = self.limits.replace("int32", "{}..{}".format(*INT32)).replace("VM-1", "4999999").replace("VI+1", "2")
        matches = re.findall(r"(-?\d+)(?:\.\.(-?\d+))?", text)
        return tuple((int(low), int(high or low)) for low, high in matches)

    def allows(self, value: int) -> bool:
        return not self.spans or any(low <= value <= high for low, high in self.spans)


def record(row: Mapping[str, str]) -> ModbusRegister:
    """Make the record of a row. Raises ValueError for a wrong cell."""
    if empty := [column for column, text in row.items() if not text]:
        raise ValueError(f"the row of {row['name']} says nothing of: {', '.join(empty)}")
    said = {column: "" if text == "-" else text for column, text in row.items()}
    differs = frozenset(said["differs"].split())
    if differs - DIFFERENCES:
        raise ValueError(f"{row['name']}: {row['differs']} is no difference")
    return ModbusRegister(
        name=row["name"],
        address=int(row["address"], 16),
        count=int(row["count"]),
        width=int(row["width"]),
        access=row["access"],
        limits=said["limits"],
        default=int(said["default"]) if said["default"] else None,
        only=said["only"],
        takes=WrittenValue(row["takes"]),
        differs=differs,
        form=said["form"],
    )


ROWS: tuple[ModbusRegister, ...] = tuple(map(record, rows(__file__, "registers.csv")))
REGISTERS: Mapping[str, ModbusRegister] = {row.name: row for row in ROWS}
"""Registers by name."""
AT: Mapping[int, ModbusRegister] = {address: row for row in ROWS for address in row.addresses}
"""Registers by address; both registers of a value lead to it. A missing address is reserved."""

# What the drive has beside registers: functions by name (4.3) and the device identification (4.1).


class WordFunction(StrEnum):
    """A function that carries a word, beside those of registers."""

    SETUP = "set-up"
    """65 reads it and 66 writes it, as text."""
    POINT = "point"
    """The same: the set-up of one input, by the name that older drives have for it (4.3.3)."""
    CONTROL = "control"
    """66, as text: a command on programs."""
    END = "end"
    """65 and 66: the end of the program (4.3.1)."""
    IDENTITY = "identity"
    """43/14, an object of the device identification."""
    OUTPUT = "output"
    """1 and 5, at an address."""
    INPUT = "input"
    """2, at an address."""


_WAYS = [(row["word"], WordFunction(row["way"]), row["number"]) for row in rows(__file__, "functions.csv")]


def _numbered(way: WordFunction) -> Mapping[str, int]:
    return {word: int(number) for word, each, number in _WAYS if each is way}


def _carried(*ways: WordFunction) -> frozenset[str]:
    return frozenset(word for word, way, _ in _WAYS if way in ways)


SETUPS = _carried(WordFunction.SETUP)
"""Set-ups, which function 65 reads and function 66 writes as text."""
POINTS = _numbered(WordFunction.POINT)
"""The inputs by the name that the manual's example has for their set-up (4.3.3), the older drives' own."""
CONTROLS = _carried(WordFunction.CONTROL)
"""Commands on programs, which function 66 carries. E goes through function 65."""
BY_FUNCTION = _carried(WordFunction.SETUP, WordFunction.CONTROL, WordFunction.END, WordFunction.IDENTITY)
"""Words that a function with a name or an object carries."""
IDENTITY = _numbered(WordFunction.IDENTITY)
"""Words that the device identification answers, by object."""
OUTPUTS, INPUTS = _numbered(WordFunction.OUTPUT), _numbered(WordFunction.INPUT)
"""Outputs and inputs by name, with their addresses in functions 1, 5 and 2."""
ALTERNATIVE = "MCode/TCP (tcp://HOST:503)"
"""The other way to the same drive, which has every word."""
