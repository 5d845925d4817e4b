"""What a device on Modbus says that it is; without the name of a Lexium drive it is a stranger (`DriveState`)."""

from __future__ import annotations

import re
from collections.abc import Mapping

from multidrop.base.errors import NoAnswer, Refused
from multidrop.dialects.codec import End, Procedure
from multidrop.dialects.state import who
from multidrop.families.lexium.host.modbus import framing, mapping
from multidrop.families.lexium.host.modbus.codec import UNKNOWN, ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.operations import refusal, request, sure
from multidrop.families.lexium.manual.modbus.registers import REGISTERS


def identification(state: ModbusState, code: int = mapping.EVERY_OBJECT) -> Procedure[dict[int, str]]:
    """Read all objects of the device identification.

    Raises Refused for a device that lacks it, NoAnswer where nothing shows what the device is.
    """
    objects: dict[int, str] = {}
    begin: int | None = 0
    while begin is not None:
        asked = request(state, "/device", pdu_codec().identify(code, begin))
        reply = yield asked
        if reply.end is End.REFUSED:
            failure = refusal(state, asked, reply, None)
            lacks = reply.body[1] not in framing.SAY_NOTHING
            raise Refused(str(failure)) if lacks else NoAnswer(str(failure))
        try:
            more, following = pdu_codec().objects(sure(state, asked, reply))
        except framing.NotModbus:
            raise NoAnswer(f"{who(state)}: the reply to '/device' is damaged") from None
        objects |= more
        begin = following if following is not None and following > begin else None
    return objects


BASIC = 1
"""The first three objects of the identification, which are mandatory."""
PRODUCT = re.compile(r"\bLMD[A-Z]E")
PART, VERSION = 1, 6
WARNING = (
    f"{UNKNOWN}, so its registers may mean other things. Only what you type is sent to it. Ctrl+X sends it the stop of "
    f"a Lexium drive: function 65 (E), then 0 to registers 0x{REGISTERS['SL'].address:04X} and "
    f"0x{REGISTERS['SL'].address + 1:04X}. /device asks it again what it is"
)
"""What a person must know of a stranger."""


def recognise(state: ModbusState, found: Mapping[int, str]) -> None:
    """Record what a device says of itself; without the name of a Lexium drive it is a stranger."""
    text = " ".join(found.get(number, "") for number in (VERSION, PART))
    product, part = PRODUCT.search(text), found.get(PART, "")
    name, stranger = (product.group(), "") if product else (part, UNKNOWN)
    state.identified(name, found.get(VERSION, ""), part, stranger)


def announced(state: ModbusState) -> Procedure[dict[int, str]]:
    """Read the identification, as far as the device supports it: empty where it does not.

    A reply that does not come is asked for once more: without it a drive would be a stranger, or not open.
    """
    for code in (mapping.EVERY_OBJECT, BASIC):
        try:
            try:
                return (yield from identification(state, code))
            except NoAnswer:
                return (yield from identification(state, code))
        except Refused:
            continue
    return {}
