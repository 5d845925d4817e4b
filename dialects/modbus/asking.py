"""Asking an Ethernet drive something over Modbus, and making sure what came of it.

Theory of operation. An answer bears its request's number, so a late one is never taken for another's, and nothing has
to be waited for or marked. A refusal is an exception; the drive's own error number says more, so EF and, where it is
1, ER are read then. That a drive accepts a write says nothing of what it does with it, so a command that a person
typed is followed by a look at EF too. Reading ER clears it: an error that stood from before is read and told first.
Nothing is ever sent again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from dialects.base import End, Kind, Known, Priority, Reply, Request, Talk
from dialects.errors import NoAnswer, Refused
from dialects.mcode.asking import described, unknown, who
from dialects.modbus import frames, words
from dialects.modbus.codec import codec
from dialects.modbus.registers import AT, REGISTERS

if TYPE_CHECKING:
    from dialects.modbus.dialect import Modbus

ILLEGAL_VALUE, FAILURE = 3, 4
READS = frozenset({frames.READ_COILS, frames.READ_INPUTS, frames.READ_REGISTERS, frames.IDENTIFY, frames.READ_SPECIFIC})


def request(known: Known, text: str, pdu: bytes, priority: Priority = Priority.OPERATOR) -> Request:
    """The request around a PDU; `text` is what it means to a person."""
    kind = Kind.PRINT if pdu[0] in READS else Kind.COMMAND
    return Request(known.address, text, kind, cast("Modbus", known.dialect), priority, body=pdu)


def answered(known: Known, asked: Request) -> Talk[bytes]:
    """Send it once; the answer. Raises Refused with the exception and the drive's own error, or NoAnswer."""
    reply = yield asked
    if reply.end is End.REFUSED:
        code = None
        if reply.body[1] in (ILLEGAL_VALUE, FAILURE):
            code = yield from error_number(known)
        raise refusal(known, asked, reply, code)
    return sure(known, asked, reply)


def sure(known: Known, asked: Request, reply: Reply) -> bytes:
    """The answer in a reply. Raises NoAnswer where there is none, Refused where it is an exception."""
    if reply.end is End.REFUSED:
        raise refusal(known, asked, reply, None)
    if reply.end is End.DAMAGED:
        raise NoAnswer(
            f"{who(known)}: the answer to '{asked.text}' is damaged ({reply.detail}); it may have been executed "
            "and was not sent again"
        )
    if reply.end is not End.DONE:
        raise NoAnswer(unknown(known, asked))
    return reply.body


def refusal(known: Known, asked: Request, reply: Reply, code: int | None) -> Refused:
    """What is said of an exception: its number and name, where it happened, and the drive's own error."""
    number = reply.body[1]
    text = f"{who(known)} refused '{asked.text}': exception {number:02} {frames.EXCEPTIONS.get(number, 'unknown')}"
    text += f" at {words.place(asked.body)}"
    row = AT.get(int.from_bytes(asked.body[1:3])) if asked.body[0] == frames.WRITE_REGISTERS else None
    if row is not None and row.limits and number == ILLEGAL_VALUE:
        text += f", which takes {row.limits.replace('int32', '32 bits')}"
    if code:
        text += f"; {described(code, known)}"
    return Refused(text, code)


def error_number(known: Known) -> Talk[int | None]:
    """The drive's own error, which reading clears; None where there is none, or it cannot be read."""
    flag = yield from _quietly(known, "EF")
    if not flag:
        known.error = False if flag == 0 else known.error
        return None
    number = yield from _quietly(known, "ER")
    known.error = number is None
    return number


def _quietly(known: Known, name: str) -> Talk[int | None]:
    """A register of which it does not matter whether it can be read."""
    register = REGISTERS[name]
    reply = yield request(known, f"PR {name}", words.read(register))
    return words.value_of(register, codec().registers(reply.body)) if reply.end is End.DONE else None


def settle(known: Known) -> Talk[None]:
    """Read and tell an error that stood from before, so that the next command is not blamed for it."""
    if known.error and (code := (yield from error_number(known))):
        known.notes.append(f"{who(known)}: an error stood from before, now cleared: {described(code, known)}")


def carried_out(known: Known, text: str, pdu: bytes) -> Talk[bytes]:
    """Send a command and see that it was carried out. Raises Refused or NoAnswer."""
    yield from settle(known)
    asked = request(known, text, pdu)
    answer = yield from answered(known, asked)
    if code := (yield from error_number(known)):
        raise Refused(f"{who(known)} refused '{text}': {described(code, known)}", code)
    return answer


def flagged(known: Known) -> Talk[bool]:
    """Whether the error flag is set, as far as that can be read."""
    known.error = bool((yield from _quietly(known, "EF")))
    return known.error
