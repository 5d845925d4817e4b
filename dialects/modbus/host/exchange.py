"""One request to an Ethernet drive over Modbus, and proof of its outcome.

Theory of operation. A reply has its request's number, so a late reply is never taken for another's. A refusal is an
exception. The drive's own error number says more, so the host then reads EF and, if it is 1, ER. A drive may accept a
write and fail to execute it, so the host reads EF after a typed command too. Reading ER clears it: an earlier error is
read and reported first. The host never repeats a request.
"""

from __future__ import annotations

from multidrop.dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from multidrop.dialects.errors import NoAnswer, Refused
from multidrop.dialects.exchange import unanswered
from multidrop.dialects.mcode.host.state import described, who
from multidrop.dialects.modbus.host import framing, mapping
from multidrop.dialects.modbus.host.codec import ModbusState, pdu_codec
from multidrop.dialects.modbus.manual.registers import AT, REGISTERS

ILLEGAL_VALUE, FAILURE = 3, 4
READS = frozenset(
    {framing.READ_COILS, framing.READ_INPUTS, framing.READ_REGISTERS, framing.IDENTIFY, framing.READ_SPECIFIC}
)


def request(state: ModbusState, text: str, pdu: bytes, priority: Priority = Priority.OPERATOR) -> Request:
    """Build the request around a PDU; `text` describes it to a person."""
    kind = Kind.PRINT if pdu[0] in READS else Kind.COMMAND
    return Request(state.address, text, kind, state.codec, priority, body=pdu)


def answered(state: ModbusState, asked: Request) -> Procedure[bytes]:
    """Send a request once; return the reply. Raises Refused (exception and drive's own error) or NoAnswer."""
    reply = yield asked
    if reply.end is End.REFUSED:
        code = None
        if reply.body[1] in (ILLEGAL_VALUE, FAILURE):
            code = yield from error_number(state)
        raise refusal(state, asked, reply, code)
    return sure(state, asked, reply)


def sure(state: ModbusState, asked: Request, reply: Reply) -> bytes:
    """Return the content of a reply. Raises NoAnswer where there is none, Refused for an exception."""
    if reply.end is End.REFUSED:
        raise refusal(state, asked, reply, None)
    if reply.end is not End.DONE:
        raise unanswered(who(state), asked, reply)
    return reply.body


def value(state: ModbusState, name: str, priority: Priority = Priority.OPERATOR) -> Procedure[int]:
    """Read a register without a look at the drive's error, which would clear it. Raises Refused or NoAnswer."""
    register = REGISTERS[name]
    asked = request(state, f"PR {name}", mapping.read(register), priority)
    return mapping.value_of(register, pdu_codec().registers(sure(state, asked, (yield asked))))


def printed(state: ModbusState, word: str, priority: Priority = Priority.OPERATOR) -> Procedure[str]:
    """Read what PR prints of a word, as `value` does."""
    reading = mapping.reading(word)
    asked = request(state, f"PR {word}", reading.pdu, priority)
    return shown(state, word, reading, sure(state, asked, (yield asked)))


def shown(state: ModbusState, word: str, reading: mapping.Reading, answer: bytes) -> str:
    try:
        return reading.shown(answer)
    except framing.NotModbus:
        raise NoAnswer(f"{who(state)}: the reply to 'PR {word}' is damaged") from None


def refusal(state: ModbusState, asked: Request, reply: Reply, code: int | None) -> Refused:
    """Describe an exception: its number and name, its place, and the drive's own error."""
    number = reply.body[1]
    text = f"{who(state)} refused '{asked.text}': exception {number:02} {framing.EXCEPTIONS.get(number, 'unknown')}"
    text += f" at {mapping.place(asked.body)}"
    row = AT.get(int.from_bytes(asked.body[1:3])) if asked.body[0] == framing.WRITE_REGISTERS else None
    if row is not None and row.limits and number == ILLEGAL_VALUE:
        text += f", which takes {row.limits.replace('int32', '32 bits')}"
    return Refused(f"{text}; {described(code, state)}" if code else text, code)


def error_number(state: ModbusState) -> Procedure[int | None]:
    """Read the drive's own error, which clears it; None for no error, or where it cannot be read."""
    flag = yield from _quietly(state, "EF")
    if not flag:
        if flag == 0:
            state.error_flag_read(False)
        return None
    number = yield from _quietly(state, "ER")
    state.error_flag_read(number is None)
    return number


def _quietly(state: ModbusState, name: str) -> Procedure[int | None]:
    register = REGISTERS[name]
    reply = yield request(state, f"PR {name}", mapping.read(register))
    return mapping.value_of(register, pdu_codec().registers(reply.body)) if reply.end is End.DONE else None


def carried_out(state: ModbusState, text: str, pdu: bytes) -> Procedure[bytes]:
    """Send a command and verify that the drive executed it. Raises Refused or NoAnswer.

    An earlier error is read and reported first, so that the command is not blamed for it.
    """
    if state.error and (code := (yield from error_number(state))):
        state.note(f"{who(state)}: an old error, now cleared: {described(code, state)}")
    answer = yield from answered(state, request(state, text, pdu))
    if code := (yield from error_number(state)):
        raise Refused(f"{who(state)} refused '{text}': {described(code, state)}", code)
    return answer


def flagged(state: ModbusState) -> Procedure[bool]:
    """Whether the error flag is set, as far as it can be read."""
    state.error_flag_read(bool((yield from _quietly(state, "EF"))))
    return state.error
