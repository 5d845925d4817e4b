"""The one codec of PDUs, made for the first message: importing pymodbus is slow, and few need it."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multidrop.dialects.modbus.host.pdu import PduCodec


@cache
def pdu_codec() -> PduCodec:
    """Return the codec of PDUs. The first call imports pymodbus (50 to 100 ms)."""
    from multidrop.dialects.modbus.host.pdu import PduCodec

    return PduCodec()
