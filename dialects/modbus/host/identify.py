"""The identification of an Ethernet drive over Modbus. It only reads: nothing moves, no error is cleared."""

from __future__ import annotations

import re

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Refused
from multidrop.dialects.family import Hints
from multidrop.dialects.mcode.host.state import who
from multidrop.dialects.modbus.host.codec import Modbus
from multidrop.dialects.modbus.host.exchange import flagged
from multidrop.dialects.modbus.host.operations import identification
from multidrop.dialects.modbus.host.state import ModbusState

BASIC = 1
"""The first three objects of the identification, which are mandatory."""
PRODUCT = re.compile(r"LMD[A-Z]E")
PART, VERSION = 1, 6


def identify(hints: Hints) -> Procedure[list[ModbusState]]:
    """Identify the drive at the other end. Raises NoAnswer where none replies."""
    state = ModbusState(Modbus())
    found = yield from _objects(state)
    text = " ".join(found.get(number, "") for number in (VERSION, PART))
    product = PRODUCT.search(text)
    part = found.get(PART, "")
    state.identified(product.group() if product else part, found.get(VERSION, ""), part)
    if not product:
        state.note(f"{who(state)} does not say that it is an LMDOE or LMDCE: its registers may mean other things")
    if (yield from flagged(state)):
        state.note(f"{who(state)}: its error flag is set (EF=1); PR ER shows and clears the error")
    return [state]


def _objects(state: ModbusState) -> Procedure[dict[int, str]]:
    """Read the identification as far as the drive supports it."""
    try:
        return (yield from identification(state))
    except Refused:
        pass
    try:
        return (yield from identification(state, BASIC))
    except Refused:
        return {}
