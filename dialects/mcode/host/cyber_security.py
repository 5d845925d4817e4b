"""Cyber security of newer Lexium Ethernet units, which carry a CSE mark, as far as users report it.

Until a person disables it with the unit's access code, the unit does not reply; or it prints and moves, and refuses
every value. Nothing of its bytes is public.
"""

from __future__ import annotations

from multidrop.dialects.family import Protection
from multidrop.dialects.mcode.manual.grammar import parsed
from multidrop.dialects.mcode.manual.mnemonic import ETHERNET
from multidrop.dialects.mcode.manual.table import lookup

TEXT = (
    "cyber security may be on: a newer Lexium Ethernet unit (CSE mark) does not reply, or refuses every value, until "
    "it is disabled in the maker's software"
)


def _text(product: str) -> str:
    return TEXT if not product or ETHERNET.match(product) else ""


def _word(text: str) -> str:
    """The variable or flag to which a line gives a value; empty: it gives none."""
    statement = parsed(text)
    row = lookup(statement.word) if statement is not None and statement.arguments else None
    return row.name if row is not None and row.kind in ("variable", "flag") else ""


CYBER_SECURITY = Protection(_text, _word)
