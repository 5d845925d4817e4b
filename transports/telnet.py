"""Telnet as bytes (RFC 854), with the messages of its com port option (RFC 2217). It has no clock and no socket.

Both ends of RFC 2217 use it: `transports.rfc2217` and `features.sharing`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

IAC = 0xFF
SE, IP, SB = 0xF0, 0xF4, 0xFA
WILL, WONT, DO, DONT = 0xFB, 0xFC, 0xFD, 0xFE
BINARY, SGA = 0x00, 0x03
LONGEST_SUBNEGOTIATION = 256
"""The bytes of a subnegotiation that are kept: no known one is longer, and the other end must not fill the memory."""
OPPOSITE = {WILL: DO, DO: WILL}
REFUSAL = {WILL: DONT, DO: WONT}


@dataclass(frozen=True)
class Data:
    """Bytes of the line."""

    data: bytes


@dataclass(frozen=True)
class Option:
    """WILL, WONT, DO or DONT, and the option."""

    verb: int
    option: int


@dataclass(frozen=True)
class Subnegotiation:
    """The bytes between IAC SB and IAC SE; the first one is the option."""

    body: bytes


@dataclass(frozen=True)
class Interrupt:
    """IAC IP: a telnet client sends it for Ctrl+C."""


Event = Data | Option | Subnegotiation | Interrupt


def escaped(data: bytes) -> bytes:
    """Data as it is sent: each IAC twice."""
    return data.replace(b"\xff", b"\xff\xff")


def option(verb: int, number: int) -> bytes:
    return bytes((IAC, verb, number))


def subnegotiation(body: bytes) -> bytes:
    return bytes((IAC, SB)) + escaped(body) + bytes((IAC, SE))


class Decoder:
    """The receiving end, however the bytes are grouped in reads."""

    def __init__(self) -> None:
        self._plain = bytearray()
        self._body: bytearray | None = None
        """The subnegotiation that has begun; None: data."""
        self._iac = False
        self._verb = 0
        self._events: list[Event] = []

    def receive(self, data: bytes) -> list[Event]:
        """Decode bytes; what is incomplete waits for its rest. Data that came together stays together."""
        if not (self._iac or self._verb or self._body is not None or IAC in data):
            return [Data(data)] if data else []
        for byte in data:
            if self._verb:
                self._event(Option(self._verb, byte))
                self._verb = 0
            elif self._iac:
                self._iac = False
                # Take the byte after IAC. Commands without a meaning on a line of drives are passed over.
                if byte == IAC:
                    self._keep(byte)
                elif byte == SB:
                    self._body = bytearray()
                elif byte == SE and self._body is not None:
                    self._event(Subnegotiation(bytes(self._body)))
                    self._body = None
                elif WILL <= byte <= DONT:
                    self._verb = byte
                elif byte == IP:
                    self._event(Interrupt())
            elif byte == IAC:
                self._iac = True
            else:
                self._keep(byte)
        self._flush()
        events, self._events = self._events, []
        return events

    def _keep(self, byte: int) -> None:
        if self._body is None:
            self._plain.append(byte)
        elif len(self._body) < LONGEST_SUBNEGOTIATION:
            self._body.append(byte)

    def _event(self, event: Event) -> None:
        self._flush()
        self._events.append(event)

    def _flush(self) -> None:
        if self._plain:
            self._events.append(Data(bytes(self._plain)))
            self._plain.clear()


OPTION = 44
REPLY = 100
"""A server replies with the number of the request and this."""


class Setting(IntEnum):
    """The requests of a client."""

    SIGNATURE = 0
    BAUD = 1
    DATA_SIZE = 2
    PARITY = 3
    STOP_SIZE = 4
    CONTROL = 5
    LINE_STATE = 6
    MODEM_STATE = 7
    SUSPEND = 8
    RESUME = 9
    LINE_MASK = 10
    MODEM_MASK = 11
    PURGE = 12


class Control(IntEnum):
    """The values of CONTROL that are used here; those named ASK_ only ask."""

    ASK_FLOW = 0
    NO_FLOW = 1
    ASK_BREAK = 4
    BREAK_ON = 5
    BREAK_OFF = 6
    ASK_DTR = 7
    DTR_ON = 8
    DTR_OFF = 9
    ASK_RTS = 10
    RTS_ON = 11
    RTS_OFF = 12
    ASK_FLOW_IN = 13
    NO_FLOW_IN = 14


PURGE_RECEIVED, PURGE_UNSENT, PURGE_BOTH = 1, 2, 3
NAMES = {
    Setting.BAUD: "the baud rate",
    Setting.DATA_SIZE: "8 data bits",
    Setting.PARITY: "no parity",
    Setting.STOP_SIZE: "1 stop bit",
}
"""The settings that a client needs, for a person."""
NEEDED = {Setting.DATA_SIZE: 8, Setting.PARITY: 1, Setting.STOP_SIZE: 1}
"""The values of 8N1."""
FLOW, FLOW_IN, BREAK, DTR, RTS = "flow control", "inbound flow control", "break", "DTR", "RTS"
GROUPS = {
    FLOW: (Control.ASK_FLOW, Control.NO_FLOW, 2, 3, 17, 19),
    BREAK: (Control.ASK_BREAK, Control.BREAK_ON, Control.BREAK_OFF),
    DTR: (Control.ASK_DTR, Control.DTR_ON, Control.DTR_OFF),
    RTS: (Control.ASK_RTS, Control.RTS_ON, Control.RTS_OFF),
    FLOW_IN: (Control.ASK_FLOW_IN, Control.NO_FLOW_IN, 15, 16, 18),
}
"""The values of CONTROL by what they set."""


def group_of(value: int) -> str:
    """The setting that a value of CONTROL changes; empty if it is unknown."""
    return next((name for name, values in GROUPS.items() if value in values), "")


def message(setting: int, value: int | bytes) -> bytes:
    """The bytes of a request or a reply; a baud rate has four bytes, any other number one."""
    if isinstance(value, int):
        value = value.to_bytes(4 if setting in (Setting.BAUD, Setting.BAUD + REPLY) else 1)
    return subnegotiation(bytes((OPTION, setting)) + value)


def parsed(body: bytes) -> tuple[int, bytes] | None:
    """The number and the value in a subnegotiation; None: it is of another option, or cut short."""
    return (body[1], body[2:]) if len(body) > 1 and body[0] == OPTION else None
