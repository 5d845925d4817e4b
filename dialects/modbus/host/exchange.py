"""Asking an Ethernet drive something over Modbus, and making sure what came of it.

Theory of operation. An answer bears its request's number, so a late one is never taken for another's, and nothing has
to be waited for or marked. A refusal is an exception; the drive's own error number says more, so EF and, where it is
1, ER are read then. That a drive accepts a write says nothing of what it does with it, so a command that a person
typed is followed by a look at EF too. Reading ER clears it: an error that stood from before is read and told first.
Nothing is ever sent again.
"""

from __future__ import annotations

from dialects.codec import End, Kind, Priority, Procedure, Reply, Request
from dialects.errors import NoAnswer, Refused
from dialects.mcode.host.wording import described, unknown, who
from dialects.modbus.host import framing, mapping
from dialects.modbus.host.messages import pdu_codec
from dialects.modbus.host.state import ModbusState
from dialects.modbus.manual.registers import AT, REGISTERS

ILLEGAL_VALUE, FAILURE = 3, 4
READS = frozenset(
    {framing.READ_COILS, framing.READ_INPUTS, framing.READ_REGISTERS, framing.IDENTIFY, framing.READ_SPECIFIC}
)


def request(state: ModbusState, text: str, pdu: bytes, priority: Priority = Priority.OPERATOR) -> Request:
    """The request around a PDU; `text` is what it means to a person."""
    kind = Kind.PRINT if pdu[0] in READS else Kind.COMMAND
    return Request(state.address, text, kind, state.codec, priority, body=pdu)


def answered(state: ModbusState, asked: Request) -> Procedure[bytes]:
    """Send it once; the answer. Raises Refused with the exception and the drive's own error, or NoAnswer."""
    reply = yield asked
    if reply.end is End.REFUSED:
        code = None
        if reply.body[1] in (ILLEGAL_VALUE, FAILURE):
            code = yield from error_number(state)
        raise refusal(state, asked, reply, code)
    return sure(state, asked, reply)


def sure(state: ModbusState, asked: Request, reply: Reply) -> bytes:
    """The answer in a reply. Raises NoAnswer where there is none, Refused where it is an exception."""
    if reply.end is End.REFUSED:
        raise refusal(state, asked, reply, None)
    if reply.end is End.DAMAGED:
        raise NoAnswer(
            f"{who(state)}: the answer to '{asked.text}' is damaged ({reply.detail}); it may have been executed "
            "and was not sent again"
        )
    if reply.end is not End.DONE:
        raise NoAnswer(unknown(state, asked))
    return reply.body


def refusal(state: ModbusState, asked: Request, reply: Reply, code: int | None) -> Refused:
    """What is said of an exception: its number and name, where it happened, and the drive's own error."""
    number = reply.body[1]
    text = f"{who(state)} refused '{asked.text}': exception {number:02} {framing.EXCEPTIONS.get(number, 'unknown')}"
    text += f" at {mapping.place(asked.body)}"
    row = AT.get(int.from_bytes(asked.body[1:3])) if asked.body[0] == framing.WRITE_REGISTERS else None
    if row is not None and row.limits and number == ILLEGAL_VALUE:
        text += f", which takes {row.limits.replace('int32', '32 bits')}"
    if code:
        text += f"; {described(code, state)}"
    return Refused(text, code)


def error_number(state: ModbusState) -> Procedure[int | None]:
    """The drive's own error, which reading clears; None where there is none, or it cannot be read."""
    flag = yield from _quietly(state, "EF")
    if not flag:
        if flag == 0:
            state.error_flag_read(False)
        return None
    number = yield from _quietly(state, "ER")
    state.error_flag_read(number is None)
    return number


def _quietly(state: ModbusState, name: str) -> Procedure[int | None]:
    """A register of which it does not matter whether it can be read."""
    register = REGISTERS[name]
    reply = yield request(state, f"PR {name}", mapping.read(register))
    return mapping.value_of(register, pdu_codec().registers(reply.body)) if reply.end is End.DONE else None


def settle(state: ModbusState) -> Procedure[None]:
    """Read and tell an error that stood from before, so that the next command is not blamed for it."""
    if state.error and (code := (yield from error_number(state))):
        state.note(f"{who(state)}: an error stood from before, now cleared: {described(code, state)}")


def carried_out(state: ModbusState, text: str, pdu: bytes) -> Procedure[bytes]:
    """Send a command and see that it was carried out. Raises Refused or NoAnswer."""
    yield from settle(state)
    asked = request(state, text, pdu)
    answer = yield from answered(state, asked)
    if code := (yield from error_number(state)):
        raise Refused(f"{who(state)} refused '{text}': {described(code, state)}", code)
    return answer


def flagged(state: ModbusState) -> Procedure[bool]:
    """Whether the error flag is set, as far as that can be read."""
    state.error_flag_read(bool((yield from _quietly(state, "EF"))))
    return state.error
