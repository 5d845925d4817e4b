"""The messages of the com port option of telnet (RFC 2217): numbers, bytes, and their names for a person."""

from __future__ import annotations

from enum import IntEnum

from multidrop.transports import telnet

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
    return telnet.subnegotiation(bytes((OPTION, setting)) + value)


def parsed(body: bytes) -> tuple[int, bytes] | None:
    """The number and the value in a subnegotiation; None: it is of another option, or cut short."""
    return (body[1], body[2:]) if len(body) > 1 and body[0] == OPTION else None
