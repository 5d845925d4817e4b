"""Every mnemonic and operator of MCode, in one table for each firmware, and the lookup.

`lexium.csv` has the words of the MCode reference 3.4, section 5. `mdrive_plus.csv` has those of an MDrivePlus with
Motion Control, firmware 3.010: base, with encoder, and the Plus2 with expanded I/O. Its sections are the pages of the
MCode reference of 2012 (R062812); words of the Hybrid's firmware are absent. The base unit knows the words of expanded
I/O and refuses them (37). So does a unit without an encoder with the nine encoder words, of which it prints three as 0.

A row has the fields of a `Mnemonic`. Marks: `starts` and `lines`; `stored` is a word of programs only, `typed` one of
typed lines only; `six` needs firmware 6, `large` a unit larger than NEMA 17 (of a Lexium only). Empty: all products of
the table, and for a step error 25; `-` is none. A row of an MDrivePlus gives what differs from the Lexium's row of that
word, and always its own section, products and note; one that is marked `own` takes nothing from it.
"""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.base.files import rows
from multidrop.families.lexium.manual.mnemonic import EVERY, LEXIUM, MDRIVE_PLUS, READ_ONLY, Mnemonic, Number


def _number(text: str) -> Number | None:
    if not text:
        return None
    return int(text) if text.lstrip("-").isdigit() else float(text)


def _products(text: str, everywhere: frozenset[str]) -> frozenset[str]:
    return frozenset(text.split()) - {"-"} if text else everywhere


def _mnemonic(row: Mapping[str, str], products: frozenset[str]) -> Mnemonic:
    marks, default = row["marks"].split(), row["default"]
    values, gap = ([int(n) if n.isdigit() else float(n) for n in row[field].split()] for field in ("values", "gap"))
    return Mnemonic(
        name=row["name"],
        title=row["title"],
        meaning=row["meaning"],
        section=row["section"],
        syntax=row["syntax"],
        access=row["access"],
        kind=row["kind"],
        immediate="stored" not in marks,
        program="typed" not in marks,
        low=_number(row["low"]),
        high=_number(row["high"]),
        unit=row["unit"],
        default=default if default == "!" or "," in default else _number(default),
        low_encoder=_number(row["low_encoder"]),
        high_encoder=_number(row["high_encoder"]),
        unit_encoder=row["unit_encoder"],
        default_encoder=_number(row["default_encoder"]),
        values=tuple(values),
        gap=tuple(gap),
        step=int(row["step"] or READ_ONLY),
        starts="starts" in marks,
        lines="lines" in marks,
        products=_products(row["products"], products),
        reserved_on=_products(row["reserved_on"], products),
        zero_on=_products(row["zero_on"], frozenset()),
        note=row["note"],
        firmware=6 if "six" in marks and products is LEXIUM else 0,
        large="large" in marks and products is LEXIUM,
    )


def _like(row: Mapping[str, str]) -> Mapping[str, str]:
    """A row of an MDrivePlus, with what it does not give taken from the Lexium's row of the word."""
    base = {} if "own" in row["marks"].split() else _ROWS.get(row["name"], {})
    return {field: text or (base.get(field, "") if field in _SHARED else "") for field, text in row.items()}


_ROWS = {row["name"]: row for row in rows(__file__, "lexium.csv")}
_SHARED = frozenset(next(iter(_ROWS.values()))) - {"section", "note", "products", "reserved_on", "zero_on"}
MNEMONICS: Mapping[str, Mnemonic] = {name: _mnemonic(row, LEXIUM) for name, row in _ROWS.items()}
"""The Lexium's words by name, in capitals; each indexed word has its own row (`D1`, `O3`, `F8`)."""
MDRIVE: Mapping[str, Mnemonic] = {
    row["name"]: _mnemonic(_like(row), MDRIVE_PLUS) for row in rows(__file__, "mdrive_plus.csv")
}
"""The MDrivePlus's words by name."""

PRINTS_LINES = frozenset(name for name, row in MNEMONICS.items() if row.lines)
"""The words whose PR prints several lines without an end of their own."""

NO_STEP: Mapping[str, int] = {name: row.step for name, row in MNEMONICS.items() if row.step}
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
