"""Values of Ethernet drives over Modbus for plots: registers and inputs, and never a word whose reading clears it."""

from __future__ import annotations

from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.errors import Diagnostic, Inexpressible, NoAnswer, Refused
from multidrop.dialects.mcode.host.state import who
from multidrop.dialects.modbus.host import framing, mapping
from multidrop.dialects.modbus.host.exchange import request, sure
from multidrop.dialects.modbus.host.state import ModbusState
from multidrop.dialects.readings import Readings, number

_NO_NUMBER = mapping.IDENTITY.keys() | mapping.SETUPS


def check(state: ModbusState, word: str) -> str:
    """Check that a word has a register or an input to read, and that its reading clears nothing."""
    name = word.upper()
    try:
        mapping.reading(name)
    except (Inexpressible, Refused) as reason:
        raise Diagnostic(f"{word} cannot be plotted: {reason}") from None
    if name == "ER" or name in _NO_NUMBER:
        why = "reading it clears it" if name == "ER" else "it is not a number"
        raise Diagnostic(f"{word} cannot be plotted: {why}")
    return name


def again(state: ModbusState, word: str, priority: Priority) -> Procedure[float]:
    """Read a value."""
    reading = mapping.reading(word)
    asked = request(state, f"PR {word}", reading.pdu, priority)
    reply = yield asked
    try:
        return number(who(state), word, reading.shown(sure(state, asked, reply)))
    except framing.NotModbus:
        raise NoAnswer(f"{who(state)}: the reply to 'PR {word}' is damaged") from None
    except ValueError as wrong:
        raise Refused(str(wrong)) from None


READINGS = Readings(check=check, first=lambda state, word: again(state, word, Priority.OPERATOR), again=again)
