"""Finding out what an Ethernet drive is, over Modbus. Only reads: nothing moves, no error is cleared."""

from __future__ import annotations

import re

from dialects.base import Hints, Known, Talk
from dialects.errors import Refused
from dialects.mcode.asking import who
from dialects.modbus.asking import flagged
from dialects.modbus.dialect import Modbus
from dialects.modbus.talk import identification

BASIC = 1
"""The identification's first three objects, which every device that has one must have."""
PRODUCT = re.compile(r"LMD[A-Z]E")
PART, VERSION = 1, 6


def identify(hints: Hints) -> Talk[list[Known]]:
    """The one drive at the other end. Raises NoAnswer where nobody answers."""
    known = Known(Modbus())
    found = yield from _objects(known)
    text = " ".join(found.get(number, "") for number in (VERSION, PART))
    product = PRODUCT.search(text)
    known.product = product.group() if product else found.get(PART, "")
    known.version = found.get(VERSION, "")
    known.part = found.get(PART, "")
    if not product:
        known.notes.append(
            f"{who(known)} does not say that it is an LMDOE or LMDCE: its registers may mean other things"
        )
    if (yield from flagged(known)):
        known.notes.append(f"{who(known)}: its error flag is set (EF=1); PR ER tells the error and clears it")
    return [known]


def _objects(known: Known) -> Talk[dict[int, str]]:
    """The identification as far as there is one."""
    try:
        return (yield from identification(known))
    except Refused:
        pass
    try:
        return (yield from identification(known, BASIC))
    except Refused:
        return {}
