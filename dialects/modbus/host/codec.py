"""Modbus/TCP as a dialect: messages out, answers in by their number, and how to stop.

Source: Modbus/TCP manual 3.2, 4; MODBUS Messaging on TCP/IP 1.0b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from dialects.codec import Decoded, End, Reply, Request
from dialects.modbus.host import framing
from dialects.modbus.host.messages import pdu_codec
from dialects.modbus.manual.registers import REGISTERS

NUMBERS = 0xFFF0
"""Requests are numbered below this; the stop's messages bear numbers above it."""
END_NUMBER, SLEW_NUMBER = 0xFFFE, 0xFFFF


@dataclass(frozen=True)
class Modbus:
    """One Ethernet drive. It answers any unit identifier."""

    unit: int = 1
    family: ClassVar[str] = "modbus"
    framed: ClassVar[bool] = True
    numbered: ClassVar[bool] = True
    broadcasts: ClassVar[bool] = False
    stop_gap: ClassVar[float | None] = None
    stop_sign: ClassVar[str] = ""

    def encode(self, request: Request) -> bytes:
        """The whole message, numbered by the request's tag."""
        return pdu_codec().message(request.tag % NUMBERS, request.body, self.unit)

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """The answer that bears the request's number and function; others are late and are passed over."""
        asked, number, at = request.body, request.tag % NUMBERS, 0
        try:
            while (found := framing.first(buffer, at)) is not None:
                at = found.end
                if found.transaction == number and found.pdu[0] in (asked[0], *_exceptions(asked)):
                    return Decoded(_reply(asked, found.pdu), at)
        except framing.NotModbus:
            return Decoded(Reply(end=End.DAMAGED, detail=_foreign(buffer[at:])), len(buffer))
        return None

    def on_quiet(self, request: Request, buffer: bytes) -> Decoded | None:
        """Nothing: every answer has an end of its own."""
        return None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """TIMEOUT, or DAMAGED where the rest of an answer is missing; that rest may still come."""
        at = _whole(buffer)
        if at == len(buffer):
            return Decoded(Reply(end=End.TIMEOUT), at)
        return Decoded(Reply(end=End.DAMAGED, detail=f"it ends after {len(buffer) - at} bytes"), at)

    def quiet_time(self, request: Request, buffer: bytes) -> float:
        """No quiet time ends anything."""
        return 0.0

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        """Late answers and those to a stop: whole messages are dropped, what is no Modbus is shown."""
        try:
            return (), _whole(buffer)
        except framing.NotModbus:
            return (_foreign(buffer),), len(buffer)

    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        """End the program, then SL 0: the axis decelerates at D, there is no harder stop over Modbus."""
        return b"".join(self.stop_again(addresses))

    def stop_again(self, addresses: Sequence[str], sure: bool = True) -> Sequence[bytes]:
        """One message at a time, for a server that takes only the first of two that come together."""
        slew = pdu_codec().write_registers(REGISTERS["SL"].address, (0, 0))
        return (
            pdu_codec().message(END_NUMBER, pdu_codec().read_specific("E"), self.unit),
            pdu_codec().message(SLEW_NUMBER, slew, self.unit),
        )

    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        """A connection has one drive."""
        return True

    def starts_motion(self, text: str) -> bool:
        """Every write may; only what is printed is read."""
        return text.strip()[:2].upper() != "PR"

    def restarted(self, line: str) -> bool:
        """Never said: a drive that restarts closes the connection."""
        return False

    def invalidate(self) -> bytes:
        """Nothing: a message that has begun to leave is sent whole."""
        return b""


def _exceptions(asked: bytes) -> tuple[int, int]:
    """The function codes of a refusal; a server that cannot read a request at all may leave its function out."""
    return asked[0] | framing.EXCEPTION, framing.EXCEPTION


def _reply(asked: bytes, answer: bytes) -> Reply:
    if not framing.fits(asked, answer):
        return Reply(end=End.DAMAGED, detail=f"{answer[:16].hex(' ')} does not answer it")
    if answer[0] & framing.EXCEPTION:
        return Reply(end=End.REFUSED, detail=framing.EXCEPTIONS.get(answer[1], ""), body=answer)
    return Reply(acknowledged=True, body=answer)


def _whole(buffer: bytes) -> int:
    """Where the last whole message ends. Raises NotModbus."""
    at = 0
    while (found := framing.first(buffer, at)) is not None:
        at = found.end
    return at


def _foreign(buffer: bytes) -> str:
    more = "..." if len(buffer) > 16 else ""
    return f"heard {buffer[:16].hex(' ')}{more}, which is no Modbus/TCP"
