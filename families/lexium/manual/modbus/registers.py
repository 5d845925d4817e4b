"""The registers of a Lexium Ethernet drive: `registers.csv` has a row for each name that has a register.

Source: section 5 of the Modbus/TCP manual. It contradicts itself and the MCode reference in places; the rulings are in
docs/rulings.md and docs/modbus.md. A value of 4 bytes takes two registers, its low word first.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from multidrop.base.files import rows

INT32 = (-(2**31), 2**31 - 1)


@dataclass(frozen=True)
class Register:
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
    default: int | None = None
    only: str = ""
    """`closed loop` or `hMT`, where other drives lack it."""
    form: str = ""
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
        found = re.findall(r"(-?\d+)(?:\.\.(-?\d+))?", text)
        return tuple((int(low), int(high or low)) for low, high in found)

    def allows(self, value: int) -> bool:
        return not self.spans or any(low <= value <= high for low, high in self.spans)


ROWS: tuple[Register, ...] = tuple(
    Register(
        row["name"],
        int(row["address"], 16),
        int(row["count"]),
        int(row["width"]),
        row["access"],
        row["limits"],
        int(row["default"]) if row["default"] else None,
        row["only"],
        row["form"],
    )
    for row in rows(__file__, "registers.csv")
)
REGISTERS: Mapping[str, Register] = {row.name: row for row in ROWS}
"""Registers by name."""
AT: Mapping[int, Register] = {address: row for row in ROWS for address in row.addresses}
"""Registers by address; both registers of a value lead to it. A missing address is reserved."""

# What the drive has beside registers: functions by name (4.3) and the device identification (4.1).

SETUPS = frozenset({"IS", "OS", "TR", "MU"})
"""Set-ups, which function 65 reads and function 66 writes as text."""
CONTROLS = frozenset({"EX", "PS", "RS"})
"""Commands on programs, which function 66 carries. E goes through function 65."""
IDENTITY: Mapping[str, int] = {"PN": 1, "SN": 5, "VR": 6}
"""Words that the device identification answers, by object."""
OUTPUTS: Mapping[str, int] = {f"O{n}": n - 1 for n in (1, 2, 3)}
INPUTS: Mapping[str, int] = {f"I{n}": n - 1 for n in (1, 2, 3, 4)}
"""Outputs and inputs by name, with their addresses in functions 1, 5 and 2."""
ALTERNATIVE = "MCode/TCP (tcp://HOST:503)"
"""The other way to the same drive, which has every word."""
