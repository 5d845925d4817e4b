"""Every mnemonic and operator of MCode, in one table for each firmware, and the lookup.

Lexium: MCode reference, section 5. MDrivePlus: `table_mdrive`. A word that a product's table lacks is a free name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from multidrop.dialects.mcode.manual.mnemonic import ENCODER, EVERY, LEXIUM, MDRIVE_PLUS, Mnemonic
from multidrop.dialects.mcode.manual.table_io import IO
from multidrop.dialects.mcode.manual.table_math import MATH
from multidrop.dialects.mcode.manual.table_mdrive import WORDS
from multidrop.dialects.mcode.manual.table_motion import MOTION
from multidrop.dialects.mcode.manual.table_program import PROGRAM
from multidrop.dialects.mcode.manual.table_system import SYSTEM

__all__ = [
    "ENCODER", "EVERY", "LEXIUM", "MDRIVE", "MDRIVE_PLUS", "MNEMONICS", "NO_STEP", "PRINTS_LINES",
    "Mnemonic", "lookup", "words",
]  # fmt: skip


def _table(rows: Iterable[Mnemonic]) -> Mapping[str, Mnemonic]:
    return MappingProxyType({row.name: row for row in sorted(rows, key=lambda row: row.name)})


MNEMONICS = _table((*MOTION, *IO, *SYSTEM, *PROGRAM, *MATH))
"""The Lexium's words by name, in capitals; each indexed word has its own row (`D1`, `O3`, `F8`)."""
MDRIVE = _table(WORDS)
"""The MDrivePlus's words by name."""

PRINTS_LINES = frozenset(name for name, row in MNEMONICS.items() if row.lines)
"""The words whose PR prints several lines without an end of their own."""

NO_STEP: Mapping[str, int] = MappingProxyType({name: row.step for name, row in MNEMONICS.items() if row.step})
"""The error of `IC` and `DC` on a word that cannot be stepped: 25 or 26 (section 5.1.29)."""


def words(product: str) -> Mapping[str, Mnemonic]:
    """The table of a product, by the beginning of its name; the Lexium's for an unknown product."""
    return MDRIVE if product.startswith("MDI") else MNEMONICS


def lookup(word: str, product: str = "") -> Mnemonic | None:
    """Find the row of a word in any case; None where the product leaves it free. Without a product: any table's row."""
    name = word.strip().upper()
    if not product:
        return MNEMONICS.get(name) or MDRIVE.get(name)
    row = words(product).get(name)
    state = product in EVERY
    return None if row is None or (state and product not in row.reserved_on) else row
