"""The one codec of PDUs, made when the first message is: importing pymodbus takes long, and few need it."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dialects.modbus.host.pdu import PduCodec


@cache
def pdu_codec() -> PduCodec:
    """Requests as PDUs, and what stands in answers. The first call imports pymodbus (50 to 100 ms)."""
    from dialects.modbus.host.pdu import PduCodec

    return PduCodec()
