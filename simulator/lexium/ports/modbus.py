"""One client's connection to a simulated drive over Modbus/TCP: bytes and times in, bytes out.

Theory of operation. A message is seven bytes of header (transaction, protocol, length, unit) and a PDU. A whole
message is carried out, in order, when its last byte arrives, however the bytes were cut up. Each gets one reply, with
its own transaction and unit, whatever the unit is. A message of another protocol is skipped. After an impossible length
(less than a unit and a function, or more than a PDU of 253 bytes) the begin of the next message is unknown: the port is
`closed`, and the client should be disconnected once the replies so far are sent. A drive without power takes and sends
nothing.

Function codes 1, 2, 3, 5, 16, 43/14, 65 and 66; any other is exception 1. A structure that the standard calls wrong (a
length, a byte count or a count that does not fit) is exception 3. Nothing here shares code with the host's framing.
(Modbus/TCP manual 3.2 and 4; MODBUS application protocol V1.1b3, 6; docs/rulings.md.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from struct import pack, unpack

from multidrop.simulator.lexium.device import MCodeDevice
from multidrop.simulator.lexium.ports.registers import (
    ILLEGAL_ADDRESS,
    ILLEGAL_VALUE,
    MOST_REGISTERS,
    Refusal,
    Registers,
)

HEADER = 6
"""Bytes before those that the length counts."""
SHORTEST, LONGEST = 2, 254
"""The range of the length."""
ILLEGAL_FUNCTION = 1
EXCEPTION = 0x80
ON, OFF = 0xFF00, 0x0000
DEVICE_ID = 0x0E
CONFORMITY = 0x83
"""All objects at once, and each alone."""
OBJECTS = 7
BASIC, INDIVIDUAL = 3, 4

Function = Callable[["ModbusPort", bytes, float], bytes]


class ModbusPort:
    """A connection. `closed`: the bytes made no sense, and no more are taken."""

    def __init__(self, device: MCodeDevice) -> None:
        self.closed = False
        self._drive, self._registers = device, Registers(device)
        self._begun = bytearray()

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes; return the replies to the messages that they complete."""
        if not self._drive.powered:
            self._drive.advance(now)
        if not self._drive.powered:
            self._begun.clear()
            return b""
        if self.closed:
            return b""
        begun = self._begun
        begun += data
        out, at = bytearray(), 0
        while len(begun) - at >= HEADER:
            protocol, length = unpack(">HH", begun[at + 2 : at + HEADER])
            if not SHORTEST <= length <= LONGEST:
                self.closed = True
                begun.clear()
                return bytes(out)
            end = at + HEADER + length
            if len(begun) < end:
                break
            if not protocol:
                answer = self._answer(bytes(begun[at + HEADER + 1 : end]), now)
                out += begun[at : at + 4] + pack(">HB", len(answer) + 1, begun[at + HEADER]) + answer
            at = end
        del begun[:at]
        return bytes(out)

    def _answer(self, pdu: bytes, now: float) -> bytes:
        function = FUNCTIONS.get(pdu[0])
        try:
            if function is None:
                raise Refusal(ILLEGAL_FUNCTION)
            return pdu[:1] + function(self, pdu[1:], now)
        except Refusal as refusal:
            return bytes((pdu[0] | EXCEPTION, refusal.code))

    # The functions: what follows the function code, both ways.

    def read_coils(self, body: bytes, now: float) -> bytes:
        """Function 1."""
        return _bits(self._registers.coils(*_pair(body), now))

    def read_inputs(self, body: bytes, now: float) -> bytes:
        """Function 2."""
        return _bits(self._registers.inputs(*_pair(body), now))

    def read_registers(self, body: bytes, now: float) -> bytes:
        """Function 3."""
        words = self._registers.read(*_pair(body), now)
        return pack(f">B{len(words)}H", 2 * len(words), *words)

    def write_coil(self, body: bytes, now: float) -> bytes:
        """Function 5."""
        address, value = _pair(body)
        if value not in (ON, OFF):
            raise Refusal(ILLEGAL_VALUE)
        self._registers.write_coil(address, value == ON, now)
        return body

    def write_registers(self, body: bytes, now: float) -> bytes:
        """Function 16."""
        if len(body) < 5:
            raise Refusal(ILLEGAL_VALUE)
        start, count, size = unpack(">HHB", body[:5])
        if not 1 <= count <= MOST_REGISTERS or size != 2 * count or len(body) != 5 + size:
            raise Refusal(ILLEGAL_VALUE)
        self._registers.write(start, unpack(f">{count}H", body[5:]), now)
        return body[:4]

    def identify(self, body: bytes, now: float) -> bytes:
        """Function 43/14."""
        if body[:1] != bytes((DEVICE_ID,)):
            raise Refusal(ILLEGAL_FUNCTION if body else ILLEGAL_VALUE)
        if len(body) != 3 or not 1 <= body[1] <= INDIVIDUAL:
            raise Refusal(ILLEGAL_VALUE)
        code, first = body[1:]
        if code == INDIVIDUAL:
            if first >= OBJECTS:
                raise Refusal(ILLEGAL_ADDRESS)
            wanted = range(first, first + 1)
        else:
            last = BASIC if code == 1 else OBJECTS
            wanted = range(first if first < last else 0, last)
        values = [(number, self._object(number, now)) for number in wanted]
        listed = b"".join(bytes((number, len(value))) + value for number, value in values)
        return bytes((DEVICE_ID, code, CONFORMITY, 0, 0, len(values))) + listed

    def _object(self, number: int, now: float) -> bytes:
        words = {1: "PN", 5: "SN", 6: "VR"}
        text = self._registers.text(words[number], now) if number in words else IDENTITY[number]
        return text.encode("ascii")

    def read_named(self, body: bytes, now: float) -> bytes:
        """Function 65."""
        if len(body) != 4:
            raise Refusal(ILLEGAL_VALUE)
        text = self._registers.read_named(_mnemonic(body), now).encode("latin-1")
        return bytes((len(text),)) + text

    def write_named(self, body: bytes, now: float) -> bytes:
        """Function 66."""
        if len(body) < 5 or len(body) != 5 + body[4]:
            raise Refusal(ILLEGAL_VALUE)
        self._registers.write_named(_mnemonic(body[:4]), body[5:], now)
        return body[4:5] + body[:4]


def _pair(body: bytes) -> tuple[int, int]:
    """Read two words and nothing else. Raises Refusal (3)."""
    if len(body) != 4:
        raise Refusal(ILLEGAL_VALUE)
    first, second = unpack(">HH", body)
    return first, second


def _bits(states: list[bool]) -> bytes:
    """Pack up to eight states, the first one lowest, after the number of bytes."""
    return bytes((1, sum(state << place for place, state in enumerate(states))))


def _mnemonic(raw: bytes) -> str:
    """Read a name that is written backwards, with spaces before it."""
    return raw.decode("latin-1").lstrip(" ")[::-1]


FUNCTIONS: Mapping[int, Function] = {
    1: ModbusPort.read_coils,
    2: ModbusPort.read_inputs,
    3: ModbusPort.read_registers,
    5: ModbusPort.write_coil,
    16: ModbusPort.write_registers,
    43: ModbusPort.identify,
    65: ModbusPort.read_named,
    66: ModbusPort.write_named,
}
"""By function code."""

IDENTITY: Mapping[int, str] = {
    0: "SEM USA",
    2: "4.0.0.0",
    3: "www.motion.schneider-electric.com",
    4: "Lexium MDrive Ethernet",
}
"""The objects that are the same in every drive; 1, 5 and 6 are its part number, serial number and firmware."""
