"""The record of one word of MCode, with the products that have it.

The numbers follow section 5 of the MCode reference. Where its tables contradict each other, one reading was chosen, and
`note` has what would surprise a user. Limits that depend on another variable (VM's on MS, HT's on MT) have their widest
values here, with the rule in `note`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from multidrop.families.lexium.manual.errors import ErrorNumber

READ_ONLY = ErrorNumber.READ_ONLY

INT_LOW, INT_HIGH = -2147483648, 2147483647
FLOAT_HIGH = 1.7976931348623157e308

LEXIUM = frozenset({"LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM"})
"""Lexium MDrive, open and closed loop (M serial, E Ethernet), and the Lexium Motion Module."""
ETHERNET = re.compile(r"LMD.E")
"""Matches the products with an Ethernet port, unknown ones too."""
CLOSED_LOOP = frozenset({"LMDCM", "LMDCE"})
"""The products with hMT."""
ENCODER = CLOSED_LOOP | {"LMM"}
"""The products with an encoder, or an input for one."""

MDRIVE_PLUS = frozenset({"MDI", "MDIE", "MDIX"})
"""MDrivePlus with Motion Control: the base unit, with an encoder, and the Plus2 with expanded I/O."""
EXPANDED = frozenset({"MDIX"})
MDRIVE_ENCODER = frozenset({"MDIE", "MDIX"})

EVERY = LEXIUM | MDRIVE_PLUS

Number = int | float
Default = int | float | str | None


@dataclass(frozen=True)
class Mnemonic:
    """One word or operator of the language.

    `low` and `high` bound the values to write (to read, if read only; the first number of an instruction); None where a
    number makes no sense. The `_encoder` bounds hold while EE=1; None: equal to the others. `access` is RW, RO, WO, RC
    (read, and cleared) or `-`. `kind` is variable, flag, instruction, keyword, math or reserved. `immediate` and
    `program` show where it is allowed; `products` execute it.
    """

    name: str
    title: str
    meaning: str
    section: str
    syntax: str = ""
    access: str = "-"
    kind: str = "instruction"
    immediate: bool = True
    program: bool = True
    low: Number | None = None
    high: Number | None = None
    unit: str = ""
    default: Default = None
    low_encoder: Number | None = None
    high_encoder: Number | None = None
    unit_encoder: str = ""
    default_encoder: Number | None = None
    values: tuple[Number, ...] = ()
    """The only accepted numbers, where not all between low and high are."""
    gap: tuple[Number, ...] = ()
    """Numbers between low and high that are refused."""
    step: int = READ_ONLY
    """The error of IC and DC on it (section 5.1.29): 0 allowed, 25 read only, 26 a mode or a setting."""
    starts: bool = False
    """Whether it can start motion or a program when executed at once; for a value, when written."""
    lines: bool = False
    """Its PR prints several lines, without an end of their own."""
    products: frozenset[str] = LEXIUM
    reserved_on: frozenset[str] = LEXIUM
    """The products that know the word; on others it is a free name. Known but absent is error 37."""
    zero_on: frozenset[str] = frozenset()
    """The products that lack it and print it as 0."""
    note: str = ""
    firmware: int = 0
    """The first firmware of a Lexium that has it; 0: any has."""
    large: bool = False
    """A Lexium of NEMA size 17 lacks it."""

    @property
    def whole(self) -> bool:
        """Whether its numbers are whole ones."""
        return isinstance(self.low, int) and not isinstance(self.default, (float, str))

    def accepts(self, value: Number, encoder: bool = False) -> bool:
        """Whether the number is in range, whatever other variables are; with EE=1 where `encoder`."""
        if self.values:
            return value in self.values
        low, high = self.bounds(encoder)
        return value not in self.gap and (low is None or value >= low) and (high is None or value <= high)

    def bounds(self, encoder: bool = False) -> tuple[Number | None, Number | None]:
        """The lowest and the highest number, with EE=1 where `encoder`."""
        low = self.low_encoder if encoder and self.low_encoder is not None else self.low
        high = self.high_encoder if encoder and self.high_encoder is not None else self.high
        return low, high
