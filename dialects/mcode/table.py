"""Every mnemonic and operator of MCode, and how to find one (MCode reference, section 5)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from dialects.mcode.mnemonic import ENCODER, EVERY, LEXIUM, MDRIVE_PLUS, Mnemonic
from dialects.mcode.table_io import IO
from dialects.mcode.table_math import MATH
from dialects.mcode.table_motion import MOTION
from dialects.mcode.table_program import PROGRAM
from dialects.mcode.table_system import SYSTEM

__all__ = [
    "ENCODER", "EVERY", "LEXIUM", "MDRIVE_PLUS", "MNEMONICS", "NO_STEP", "PRINTS_LINES", "Mnemonic", "lookup",
]  # fmt: skip

MNEMONICS: Mapping[str, Mnemonic] = MappingProxyType(
    {row.name: row for row in sorted((*MOTION, *IO, *SYSTEM, *PROGRAM, *MATH), key=lambda row: row.name)}
)
"""By name, in capitals; indexed ones each for itself (`D1`, `O3`, `F8`)."""

PRINTS_LINES = frozenset(name for name, row in MNEMONICS.items() if row.lines)
"""The words whose PR prints several lines; nothing marks the last one."""

NO_STEP: Mapping[str, int] = MappingProxyType({name: row.step for name, row in MNEMONICS.items() if row.step})
"""The error of `IC` and `DC` on what may not be stepped: 25 or 26 (section 5.1.29)."""


def lookup(word: str, product: str = "") -> Mnemonic | None:
    """The row of a word in any case, or None; with a product, None too where that one leaves it free."""
    row = MNEMONICS.get(word.strip().upper())
    if row is not None and product and product not in row.reserved_on:
        return None
    return row
