"""The codec of Modbus/TCP: messages out, replies in by their number, and the stop; the host's knowledge of one drive.

Source: Modbus/TCP manual 3.2, 4; MODBUS Messaging on TCP/IP 1.0b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, ClassVar

from multidrop.dialects.codec import Codec, Decoded, End, Reply, Request, Started, StopPiece
from multidrop.dialects.state import DriveState
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.modbus import framing
from multidrop.families.lexium.manual.grammar import LineError, parse
from multidrop.families.lexium.manual.groups import CALM_AT_0
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from multidrop.families.lexium.manual.table import lookup

if TYPE_CHECKING:
    from multidrop.families.lexium.host.modbus.pdu import PduCodec

NUMBERS = 0xFFF0
"""Requests have numbers below this; the messages of a stop have numbers above it."""
END_NUMBER, SLEW_NUMBER = 0xFFFE, 0xFFFF
WRITES = (framing.WRITE_COIL, framing.WRITE_REGISTERS, framing.WRITE_SPECIFIC)
"""Their replies do not confirm the execution: the drive's error flag shows that it refused one."""

UNKNOWN = "this device did not identify itself as a Lexium drive"
"""What is said of a device whose identification (43/14) does not name a Lexium drive, or was not read."""
USER = frozenset(f"V{n}" for n in range(1, 9))
"""The user variables that have a register."""


@cache
def pdu_codec() -> PduCodec:
    """Return the codec of PDUs. The first call imports pymodbus (50 to 100 ms)."""
    from multidrop.families.lexium.host.modbus.pdu import PduCodec

    return PduCodec()


HEAD_BYTES = 7
"""Bytes of the head of a message: number, protocol, length, unit."""


@dataclass(frozen=True)
class Modbus(Codec):
    """One Ethernet drive. It replies to any unit identifier."""

    unit: int = 1
    family: ClassVar[str] = "modbus"
    framed: ClassVar[bool] = True
    numbered: ClassVar[bool] = True
    error_routine: ClassVar[bool] = True

    def encode(self, request: Request) -> bytes:
        return pdu_codec().message(request.tag % NUMBERS, request.body, self.unit)

    def replied(self, sent: bytes, received: bytes) -> bool | None:
        """By the number of the message, where it is one: a head with the number, zeros and the length of the rest."""
        if len(sent) <= HEAD_BYTES or sent[2:4] != b"\0\0" or int.from_bytes(sent[4:6]) != len(sent) - HEAD_BYTES + 1:
            return None
        return sent[:4] in received

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """Find the reply with the request's number and function; skip late replies.

        A server that cannot parse a request may omit its function in the exception.
        """
        asked, number, at = request.body, request.tag % NUMBERS, 0
        try:
            while (message := framing.first(buffer, at)) is not None:
                at = message.end
                if message.transaction == number and message.pdu[0] in (
                    asked[0],
                    asked[0] | framing.EXCEPTION,
                    framing.EXCEPTION,
                ):
                    return Decoded(_reply(asked, message.pdu), at)
        except framing.NotModbus:
            return Decoded(Reply(end=End.DAMAGED, detail=_foreign(buffer[at:])), len(buffer))
        return None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """Return TIMEOUT, or DAMAGED where the rest of a reply is missing; that rest may still arrive.

        Whole messages in the buffer are no reply to it. TIMEOUT says in what: a gateway may number them wrongly.
        """
        at, foreign = _whole(buffer)
        if foreign:
            return Decoded(Reply(end=End.DAMAGED, detail=_foreign(buffer[at:])), len(buffer))
        if at == len(buffer):
            wrong = _unlike(buffer, request.tag % NUMBERS, request.body[0])
            return Decoded(Reply(end=End.TIMEOUT, detail=wrong), at)
        return Decoded(Reply(end=End.DAMAGED, detail=f"it ends after {len(buffer) - at} bytes"), at)

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        """Drop whole messages, which are late or reply to a stop; return bytes that are not Modbus."""
        at, foreign = _whole(buffer)
        return ((_foreign(buffer),), len(buffer)) if foreign else ((), at)

    def printed(self, line: str) -> bool:
        """Never: a Modbus server only replies."""
        return False

    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        """Return the end of the program, then SL 0: the axis decelerates at D, the hardest stop over Modbus."""
        return b"".join(piece.data for piece in self.stop_again(addresses))

    def stop_again(self, addresses: Sequence[str], sure: bool = True) -> Sequence[StopPiece]:
        """Return the same messages one by one, for a server that takes only the first of two."""
        slew = pdu_codec().write_registers(REGISTERS["SL"].address, (0, 0))
        return (
            StopPiece(pdu_codec().message(END_NUMBER, pdu_codec().read_specific("E"), self.unit)),
            StopPiece(pdu_codec().message(SLEW_NUMBER, slew, self.unit)),
        )

    def repeated(self, sent: bytes, rest: bytes, over: bool) -> bool:
        """Tell an adapter's repetition from the reply to a write of one register, which has the same bytes."""
        message = framing.first(sent, 0)
        return message is not None and message.pdu[0] not in WRITES

    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        return True

    def starts_motion(self, text: str) -> bool:
        """Whether the register of the word can start motion or a program, and the value does not end it."""
        try:
            statement = parse(text, USER)
        except LineError:
            return True
        if statement is None or statement.word in USER:
            return False
        row, values = lookup(statement.word), [getattr(argument, "value", None) for argument in statement.arguments]
        return row is None or (row.starts and not (row.name in CALM_AT_0 and values == [0]))

    def started(self, text: str) -> Started:
        return classify.started(text)


def _reply(asked: bytes, answer: bytes) -> Reply:
    if not framing.fits(asked, answer):
        return Reply(end=End.DAMAGED, detail=f"{answer[:16].hex(' ')} is not a reply to it")
    if answer[0] & framing.EXCEPTION:
        return Reply(end=End.REFUSED, detail=framing.EXCEPTIONS.get(answer[1], ""), body=answer)
    return Reply(acknowledged=asked[0] not in WRITES, body=answer)


def _whole(buffer: bytes) -> tuple[int, bool]:
    at = 0
    try:
        while (message := framing.first(buffer, at)) is not None:
            at = message.end
    except framing.NotModbus:
        return at, True
    return at, False


def _unlike(buffer: bytes, number: int, function: int) -> str:
    """Say what is wrong with whole messages that are no reply to a request; empty: none came, but to a stop."""
    at, wrong = 0, ""
    while (message := framing.first(buffer, at)) is not None:
        at = message.end
        if message.transaction == number:
            wrong = f"a reply with function {message.pdu[0]} came, and the request has function {function}"
        elif message.transaction < NUMBERS:
            wrong = f"a reply with transaction number {message.transaction} came, and the request has {number}"
    return wrong


def _foreign(buffer: bytes) -> str:
    more = "..." if len(buffer) > 16 else ""
    return f"heard {buffer[:16].hex(' ')}{more}, which is not Modbus/TCP"


@dataclass(eq=False)
class ModbusState(DriveState):
    """One Ethernet drive over Modbus, or another device: a stranger until its identification is read."""

    codec: Modbus
    stranger: str = UNKNOWN
