"""Finding out what an Ethernet drive is, over Modbus. Only reads: nothing moves, no error is cleared."""

from __future__ import annotations

import re

from dialects.base import DriveState, Hints, Procedure
from dialects.errors import Refused
from dialects.mcode.host.exchange import who
from dialects.modbus.host.codec import Modbus
from dialects.modbus.host.exchange import flagged
from dialects.modbus.host.operations import identification

BASIC = 1
"""The identification's first three objects, which every device that has one must have."""
PRODUCT = re.compile(r"LMD[A-Z]E")
PART, VERSION = 1, 6


def identify(hints: Hints) -> Procedure[list[DriveState]]:
    """The one drive at the other end. Raises NoAnswer where nobody answers."""
    state = DriveState(Modbus())
    found = yield from _objects(state)
    text = " ".join(found.get(number, "") for number in (VERSION, PART))
    product = PRODUCT.search(text)
    state.product = product.group() if product else found.get(PART, "")
    state.version = found.get(VERSION, "")
    state.part = found.get(PART, "")
    if not product:
        state.notes.append(
            f"{who(state)} does not say that it is an LMDOE or LMDCE: its registers may mean other things"
        )
    if (yield from flagged(state)):
        state.notes.append(f"{who(state)}: its error flag is set (EF=1); PR ER tells the error and clears it")
    return [state]


def _objects(state: DriveState) -> Procedure[dict[int, str]]:
    """The identification as far as there is one."""
    try:
        return (yield from identification(state))
    except Refused:
        pass
    try:
        return (yield from identification(state, BASIC))
    except Refused:
        return {}
