"""Every mnemonic and operator of MCode, in one table for each firmware, and the lookup.

`lexium.csv` has the words of the MCode reference 3.4, section 5. `mdrive_plus.csv` has those of an MDrivePlus with
Motion Control, firmware 3.010: base, with encoder, and the Plus2 with expanded I/O. Its sections are the pages of the
MCode reference of 2012 (R062812); words of the Hybrid's firmware are absent. The base unit knows the words of expanded
I/O and refuses them (37). So does a unit without an encoder with the nine encoder words, of which it prints three as 0.

A row has a cell for every fact of a `Mnemonic`, where the words of each column are explained. `-` is none, `all` all
products of the table, `any` any firmware or size. An empty cell is an error, so that a new word answers every question.
Only a row of an MDrivePlus may leave cells empty, for what the Lexium's row of the same word says. It always gives its
own section, products and note. One that is marked `own` takes nothing from the Lexium.
"""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.base.files import rows
from multidrop.families.lexium.manual.mnemonic import (
    EVERY,
    LEXIUM,
    MDRIVE_PLUS,
    AllowedUse,
    Alone,
    AtZero,
    Default,
    FormKind,
    Leads,
    MemoryEffect,
    Mnemonic,
    MotionEffect,
    MotionWait,
    NameEffect,
    Number,
    PositionEffect,
    PrintedValue,
    Retention,
    Setup,
    WireSetting,
    WordQuantity,
)

NONE = "-"
_FLAGS = {"yes": True, "no": False}
_OWN = frozenset({"section", "note", "products", "reserved_on", "zero_on"})
"""What a row of an MDrivePlus never takes from the Lexium's row."""


def _number(text: str) -> Number | None:
    if text == NONE:
        return None
    return int(text) if text.lstrip("-").isdigit() else float(text)


def _numbers(text: str) -> tuple[Number, ...]:
    return tuple(int(n) if n.isdigit() else float(n) for n in text.split()) if text != NONE else ()


def _whole(text: str) -> int | None:
    return None if text == NONE else int(text)


def _text(text: str) -> str:
    return "" if text == NONE else text


def _default(text: str) -> Default:
    return text if text == "!" or "," in text else _number(text)


def _products(text: str, everywhere: frozenset[str]) -> frozenset[str]:
    return everywhere if text == "all" else frozenset(text.split()) - {NONE}


def _setup(text: str) -> Setup:
    form, *more = text.split()
    numbers = tuple(int(digits) for digits in more if digits.isdigit())
    return Setup(FormKind(form), numbers, "removable" in more, "repeated" in more)


def record(row: Mapping[str, str], everywhere: frozenset[str]) -> Mnemonic:
    """Make the record of a row; `everywhere` are the products of its table. Raises ValueError for a wrong cell."""
    if empty := [column for column, text in row.items() if not text]:
        raise ValueError(f"the row of {row['name']} says nothing of: {', '.join(empty)}")
    lexium = everywhere is LEXIUM
    leads, _, place = row["leads"].partition(" ")
    position, _, turn = row["position"].partition(" ")
    return Mnemonic(
        name=row["name"],
        title=row["title"],
        meaning=row["meaning"],
        section=row["section"],
        syntax=_text(row["syntax"]),
        access=row["access"],
        kind=row["kind"],
        low=_number(row["low"]),
        high=_number(row["high"]),
        unit=_text(row["unit"]),
        default=_default(row["default"]),
        low_encoder=_number(row["low_encoder"]),
        high_encoder=_number(row["high_encoder"]),
        unit_encoder=_text(row["unit_encoder"]),
        default_encoder=_number(row["default_encoder"]),
        values=_numbers(row["values"]),
        gap=_numbers(row["gap"]),
        step=int(row["step"]),
        products=_products(row["products"], everywhere),
        reserved_on=_products(row["reserved_on"], everywhere),
        zero_on=_products(row["zero_on"], everywhere),
        firmware=0 if row["firmware"] == "any" or not lexium else int(row["firmware"]),
        large=row["size"] != "any" and lexium,
        use=AllowedUse(row["use"]),
        joined=_FLAGS[row["joined"]],
        leads=Leads(leads),
        place=int(place or 0) - 1,
        variable=NameEffect(row["variable"]),
        prints=PrintedValue(row["prints"]),
        setup=_setup(row["setup"]),
        kept=Retention(row["kept"]),
        restored=0 if row["restored"] == "any" else _whole(row["restored"]),
        wire=WireSetting(row["wire"]),
        read_back=0 if row["read_back"] == "exact" else _whole(row["read_back"]),
        quantity=WordQuantity(row["quantity"]),
        position=PositionEffect(position),
        turn=int(turn or 0),
        starts=_FLAGS[row["starts"]],
        motion=MotionEffect(row["motion"]),
        turns_at=_whole(row["turns_at"]),
        at_zero=AtZero(row["at_zero"]),
        alone=Alone(row["alone"]),
        rest=_FLAGS[row["rest"]],
        waiting=MotionWait(row["waiting"]),
        sign=_FLAGS[row["sign"]],
        memory=MemoryEffect(row["memory"]),
        guard=_text(row["guard"]),
        harmless=frozenset(map(int, row["harmless"].split())) if row["harmless"] != NONE else frozenset(),
        note=_text(row["note"]),
    )


def whole_row(row: Mapping[str, str], lexium: Mapping[str, Mapping[str, str]]) -> Mapping[str, str]:
    """Return a row of an MDrivePlus with what it takes from the Lexium's row of the word, given all of these."""
    base = {} if row["own"] == "yes" else lexium[row["name"]]
    cells = {column: text for column, text in row.items() if column != "own"}
    return {column: text or ("" if column in _OWN else base.get(column, "")) for column, text in cells.items()}


_ROWS = {row["name"]: row for row in rows(__file__, "lexium.csv")}
MNEMONICS: Mapping[str, Mnemonic] = {name: record(row, LEXIUM) for name, row in _ROWS.items()}
"""The Lexium's words by name, in capitals; each indexed word has its own row (`D1`, `O3`, `F8`)."""
MDRIVE: Mapping[str, Mnemonic] = {
    row["name"]: record(whole_row(row, _ROWS), MDRIVE_PLUS) for row in rows(__file__, "mdrive_plus.csv")
}
"""The MDrivePlus's words by name."""


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
