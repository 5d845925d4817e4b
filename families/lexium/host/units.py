"""Quantities in lines of MCode, and what positions and velocities of a Lexium or MDrivePlus count.

With EE=1, and without hMT, positions, velocities and accelerations are encoder counts, else microsteps. A turn has MS
times 200 microsteps, or MS times 360/SA on the Motion Module; 4000 counts on a Lexium MDrive, 4 times EL where the
product has EL, 2048 on an MDrivePlus with its own encoder. RD reverses them all. (MCode reference 5.1.36, 5.1.38,
5.1.85, 5.1.110, 5.1.114, 7.3.)
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction

from multidrop.dialects.codec import Request
from multidrop.dialects.units import FULL_STEPS, VALUE, Basis, Field, Takes, Units
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.manual.groups import MOVES, RECOUNTING, RESTORING, ROWS, SCALES
from multidrop.families.lexium.manual.mnemonic import EVERY, MDRIVE_PLUS, WordQuantity
from multidrop.families.lexium.manual.table import lookup

_MEASURES = [(row, Takes[row.quantity.name]) for row in ROWS if row.quantity is not WordQuantity.NONE]
TAKES: Mapping[str, Takes] = {row.name: takes for row, takes in _MEASURES if row.access in ("RW", "WO", "-")}
"""What the number that a line gives to a word measures."""
READS: Mapping[str, Takes] = {row.name: takes for row, takes in _MEASURES if row.access in ("RW", "RO", "RC")}
"""What the number that PR prints for a word measures."""
LINES_LMD, COUNTS_MDI = 1000, 2048
_LINE = re.compile(rf"\s*({'|'.join(TAKES)})\s*=?\s*{VALUE}\s*(?:,[^'`]*)?(?:['`].*)?", re.I)
_READ = re.compile(r"\s*PR\s*([A-Z]+)\s*", re.I)


def rests_on(product: str) -> list[str]:
    """The settings that a product has of those; of an unknown one the one that every product has."""
    return [word for word in SCALES if (row := lookup(word, product)) is not None and product in row.products] or ["MS"]


def counted(product: str, values: Mapping[str, str], full_steps: int | None) -> Basis:
    """Count the turn of a motor from the settings that were read."""
    settings = tuple(values.items())
    if product not in EVERY:
        return Basis(settings, missing=f"the product {product!r} is not known")
    if int(values.get("EE", 0)) and not int(values.get("AS", 0)):
        if "EL" in values:
            return Basis(settings, Fraction(4 * int(values["EL"])))
        if product in MDRIVE_PLUS:
            return Basis(settings, Fraction(COUNTS_MDI))
        return Basis(settings, Fraction(4 * LINES_LMD))
    steps = Fraction(full_steps or FULL_STEPS)
    if full_steps is None and "SA" in values:
        steps = 360 / Fraction(values["SA"])
    return Basis(settings, int(values["MS"]) * steps)


class LexiumUnits(Units):
    """The quantities in lines of MCode, over any protocol."""

    words = ", ".join(TAKES)

    def fields(self, text: str) -> Sequence[Field]:
        match = _LINE.fullmatch(text)
        if match is None:
            return ()
        word = match[1].upper()
        return (Field("", TAKES[word], *match.span(2), word in MOVES),)

    def disturbs(self, text: str) -> Collection[str]:
        counts = classify.written_word(text) in RECOUNTING
        return ("",) if counts or classify.word_of(text)[0] in RESTORING else ()

    def recounts(self, request: Request) -> bool:
        return classify.written_word(request.text) in SCALES or classify.word_of(request.text)[0] in RESTORING

    def reads(self, text: str) -> tuple[str, Takes] | None:
        match = _READ.fullmatch(text)
        takes = READS.get(match[1].upper()) if match is not None else None
        return ("", takes) if takes is not None else None
