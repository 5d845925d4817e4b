"""The registers of a Lexium Ethernet drive: one row for each name that has a register.

Source: section 5 of the Modbus/TCP manual. It contradicts itself and the MCode reference in places; the rulings are in
docs/rulings.md and docs/modbus.md. A value of 4 bytes takes two registers, its low word first.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

INT32 = (-(2**31), 2**31 - 1)
MICROSTEPS = "1 2 4 5 8 10 16 25 32 50 64 100 108 125 127 128 180 200 250 256"


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
        """Whether the manual's range includes the value."""
        return not self.spans or any(low <= value <= high for low, high in self.spans)


ROWS: tuple[Register, ...] = (
    Register("A", 0x0000, 2, 4, "RW", "91..1525878997", 1000000),
    Register("BY", 0x0004, 1, 1, "RO", "0..1", None),
    Register("C1", 0x0005, 2, 4, "RW", "int32", 0),
    Register("C2", 0x0007, 2, 4, "RW", "int32", 0, "closed loop"),
    Register("CE", 0x0009, 1, 1, "RW", "0..1", 1),
    Register("D1", 0x000F, 1, 1, "RW", "0..255", 0),
    Register("D2", 0x0010, 1, 1, "RW", "0..255", 0),
    Register("D3", 0x0011, 1, 1, "RW", "0..255", 0),
    Register("D4", 0x0012, 1, 1, "RW", "0..255", 0),
    Register("D5", 0x0013, 1, 1, "RW", "0..255", 0),
    Register("D", 0x0018, 2, 4, "RW", "91..1525878997", 1000000),
    Register("DB", 0x001A, 1, 2, "RW", "0..65000", 10, "closed loop"),
    Register("DC", 0x001B, 1, 1, "WO", "", None),
    Register("DE", 0x001C, 1, 1, "RW", "0..1", 1),
    Register("EE", 0x001E, 1, 1, "RW", "0..1", 0, "closed loop"),
    Register("EF", 0x001F, 1, 1, "RO", "0..1", 0),
    Register("ER", 0x0021, 1, 2, "RC", "", 0),
    Register("FC", 0x0024, 1, 1, "RW", "0..9", 0),
    Register("FM", 0x0026, 1, 1, "RW", "0..9", 0),
    Register("HC", 0x0029, 1, 1, "RW", "0..100", 5),
    Register("HI", 0x002A, 1, 1, "WO", "1..4", None),
    Register("HM", 0x002B, 1, 1, "WO", "1..4", None),
    Register("HT", 0x002C, 1, 2, "RW", "0, 2..65535", 500),
    Register("I1", 0x002D, 1, 1, "RO", "0..1", None),
    Register("I2", 0x002E, 1, 1, "RO", "0..1", None),
    Register("I3", 0x002F, 1, 1, "RO", "0..1", None),
    Register("I4", 0x0030, 1, 1, "RO", "0..1", None),
    Register("I5", 0x0031, 1, 2, "RO", "0..1023", None),
    Register("I6", 0x0032, 1, 1, "RO", "0..1", None, "closed loop"),
    Register("IC", 0x0037, 1, 1, "WO", "", None),
    Register("IN", 0x003B, 1, 1, "RO", "0..15", None),
    Register("IP", 0x003C, 1, 1, "WO", "", None),
    Register("IT", 0x003D, 1, 1, "RO", "", None),
    Register("JE", 0x003F, 1, 1, "RW", "0..1", 0),
    Register("LM", 0x0042, 1, 1, "RW", "1..6", 1),
    Register("MA", 0x0043, 2, 4, "WO", "int32", None),
    Register("MP", 0x0045, 1, 1, "RO", "0..1", 0),
    Register("MR", 0x0046, 2, 4, "WO", "int32", None),
    Register("MS", 0x0048, 1, 1, "RW", MICROSTEPS, 256),
    Register("MT", 0x0049, 1, 2, "RW", "0..65000", 0),
    Register("MV", 0x004A, 1, 1, "RO", "0..1", 0),
    Register("O1", 0x004B, 1, 1, "WO", "0..1", None),
    Register("O2", 0x004C, 1, 1, "WO", "0..1", None),
    Register("O3", 0x004D, 1, 1, "WO", "0..1", None),
    Register("OF", 0x004E, 1, 1, "RO", "0..1", 0),
    Register("OT", 0x0056, 1, 1, "WO", "0..15", None),
    Register("P", 0x0057, 2, 4, "RW", "int32", 0),
    Register("PC", 0x0059, 2, 4, "RO", "int32", None),
    Register("PM", 0x005C, 1, 1, "RW", "0..1", 0, "closed loop"),
    Register("R1", 0x005F, 2, 4, "RW", "int32", None),
    Register("R2", 0x0061, 2, 4, "RW", "int32", None),
    Register("R3", 0x0063, 2, 4, "RW", "int32", None),
    Register("R4", 0x0065, 2, 4, "RW", "int32", None),
    Register("RC", 0x0067, 1, 1, "RW", "1..100", 25),
    Register("S", 0x0076, 1, 1, "WO", "", None),
    Register("SF", 0x0077, 1, 2, "RW", "0..65000", 15, "closed loop"),
    Register("SL", 0x0078, 2, 4, "WO", "-5000000..5000000", None),
    Register("SM", 0x007A, 1, 1, "RW", "0..1", 0, "closed loop"),
    Register("ST", 0x007B, 1, 1, "RW", "0..1", 0, "closed loop"),
    Register("TE", 0x007D, 1, 1, "RW", "0..43", 0),
    Register("V", 0x0085, 2, 4, "RO", "int32", None),
    Register("VC", 0x0088, 1, 1, "RO", "0..1", 0),
    Register("VI", 0x0089, 2, 4, "RW", "1..VM-1", 1000),
    Register("VM", 0x008B, 2, 4, "RW", "VI+1..5000000", 768000),
    Register("WT", 0x008D, 1, 1, "RW", "0..84", 80),
    Register("AS", 0x008E, 1, 1, "RW", "0..3", 2, "hMT"),
    Register("AF", 0x008F, 1, 1, "RO", "1..255", None, "hMT"),
    Register("CB", 0x0091, 1, 1, "RW", "0..3", 1, "hMT"),
    Register("CF", 0x0093, 1, 1, "WO", "", None, "hMT"),
    Register("LD", 0x0095, 2, 4, "RW", "0..2147483647", 102400, "hMT"),
    Register("LG", 0x0097, 2, 4, "RW", "0..2147483647", 102400, "hMT"),
    Register("LL", 0x0099, 2, 4, "RO", "-2147483647..2147483647", None, "hMT"),
    Register("LR", 0x009B, 1, 1, "RO", "0..1", 0, "hMT"),
    Register("LT", 0x009C, 2, 2, "RW", "2..65535", 2000, "hMT"),
    Register("MF", 0x009E, 2, 4, "RW", "306..5000000", 768000, "hMT"),
    Register("MU", 0x00A0, 1, 1, "RW", "0..2", 0, "hMT"),
    Register("SC", 0x00A1, 1, 1, "WO", "", None, "hMT"),
    Register("TA", 0x00A3, 2, 4, "RW", "", 0, "hMT"),
    Register("TD", 0x00A5, 1, 1, "RW", "0..1", 1, "hMT"),
    Register("TQ", 0x00A6, 1, 1, "RW", "1..100", 25, "hMT"),
    Register("TS", 0x00A7, 1, 1, "RW", "0..255", 0, "hMT"),
    Register("V1", 0x00A8, 2, 4, "RW", "int32", None),
    Register("V2", 0x00AA, 2, 4, "RW", "int32", None),
    Register("V3", 0x00AC, 2, 4, "RW", "int32", None),
    Register("V4", 0x00AE, 2, 4, "RW", "int32", None),
    Register("V5", 0x00B0, 2, 4, "RW", "int32", None),
    Register("V6", 0x00B2, 2, 4, "RW", "int32", None),
    Register("V7", 0x00B4, 2, 4, "RW", "int32", None),
    Register("V8", 0x00B6, 2, 4, "RW", "int32", None),
)

REGISTERS: Mapping[str, Register] = MappingProxyType({row.name: row for row in ROWS})
"""Registers by name."""
AT: Mapping[int, Register] = MappingProxyType({address: row for row in ROWS for address in row.addresses})
"""Registers by address; both registers of a value lead to it. A missing address is reserved."""
