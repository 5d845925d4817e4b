"""One client of a shared port as bytes: raw, or telnet with the com port option (RFC 2217).

The first byte that a client sends decides: IAC begins telnet; any other one means that it negotiates
nothing. Such a client is sent no byte that is not a drive's: a program would take a reason for a reply.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from multidrop.drives.half_line import FrameDivider, Rest
from multidrop.transports import telnet
from multidrop.transports.telnet import OPTION, PURGE_BOTH, REPLY, Setting, message, parsed

MOST_HELD_BYTES = 1 << 16
"""Bytes that are kept for a client that has suspended the flow to it."""
INTERRUPTS = (b"\xff\xf4\xff\xfd\x06", b"\xff\xf4")
"""Ctrl+C of a telnet program that has negotiated nothing: IAC IP, mostly with a request to mark the time."""
_TAKEN = (telnet.BINARY, telnet.SGA)
_LENGTHS: dict[int, int] = {
    **dict.fromkeys((Setting.DATA_SIZE, Setting.PARITY, Setting.STOP_SIZE, Setting.CONTROL, Setting.PURGE), 1),
    **dict.fromkeys((Setting.LINE_MASK, Setting.MODEM_MASK), 1),
    **dict.fromkeys((Setting.SIGNATURE, Setting.SUSPEND, Setting.RESUME), 0),
    Setting.BAUD: 4,
}
"""The bytes of the value of each request that is answered."""


@dataclass(frozen=True)
class ClientRequest:
    """A client's request for a setting."""

    setting: int
    value: int


Input = bytes | ClientRequest
"""What a client sends: bytes for the line, or a request."""


class ClientStream:
    """Divides the bytes of one client into data and requests, and encodes the bytes for it."""

    def __init__(self, name: str, text: bool, size: int = 0) -> None:
        """`text`: the line's language is text; else `size` is that of its messages, bytes."""
        self.name = name
        self.com_port = False
        """It has agreed on RFC 2217."""
        self.refused = False
        """Only stops are taken from it."""
        self.replies = bytearray()
        """Replies to its negotiation that are to be sent to it."""
        self.waiting: deque[Input] = deque()
        """What has been received from it and is not worked off."""
        self.begun = b""
        """The beginning of a line or message that came while another client wrote."""
        self.rest = Rest()
        self.parts = FrameDivider(size)
        self.setting = False
        """A setting of its is being changed: what follows waits for that."""
        self._text = text
        self._telnet: telnet.Decoder | None = None
        self._begun = False
        self._offered: set[tuple[int, int]] = set()
        self._suspended = False
        self._held = bytearray()

    # From the client

    def receive(self, data: bytes) -> list[Input]:
        """Divide received bytes into data and requests; no request is answered here."""
        if not self._begun and data:
            self._begun = True
            self._telnet = telnet.Decoder() if data[0] == telnet.IAC else None
        if self._telnet is None:
            for interrupt in INTERRUPTS if self._text else ():
                data = data.replace(interrupt, b"\x03")
            return [data]
        inputs: list[Input] = []
        for event in self._telnet.receive(data):
            if isinstance(event, telnet.Data):
                # A telnet terminal sends a NUL after its CR.
                inputs.append(event.data if self.com_port or not self._text else event.data.translate(None, b"\0"))
            elif isinstance(event, telnet.Interrupt):
                inputs.append(b"\x03")
            elif isinstance(event, telnet.Option):
                self._option(event)
            elif request := self._request(event.body):
                inputs.append(request)
        return [item for item in inputs if item]

    def _option(self, event: telnet.Option) -> None:
        if event.verb not in telnet.OPPOSITE:
            return
        if event.option == OPTION:
            self.com_port = True
            for verb, option in ((telnet.DO, OPTION), (telnet.WILL, telnet.BINARY), (telnet.DO, telnet.BINARY)):
                self._offer(verb, option)
            self.reply(Setting.MODEM_STATE, 0)  # no modem lines are read
        elif event.option in _TAKEN:
            self._offer(telnet.OPPOSITE[event.verb], event.option)
        else:
            self._offer(telnet.REFUSAL[event.verb], event.option)

    def _offer(self, verb: int, option: int) -> None:
        """Send an option once: an answer to each answer would never end."""
        if (verb, option) not in self._offered:
            self._offered.add((verb, option))
            self.replies += telnet.option(verb, option)

    def _request(self, body: bytes) -> ClientRequest | None:
        """The request in a subnegotiation; None where it has no meaning."""
        parts = parsed(body)
        if parts is None or not self.com_port or parts[0] not in _LENGTHS:
            return None
        setting, value = parts[0], int.from_bytes(parts[1])
        valid = len(parts[1]) == _LENGTHS[setting] and (setting != Setting.PURGE or 0 < value <= PURGE_BOTH)
        return ClientRequest(setting, value) if valid else None

    def answers(self, request: ClientRequest) -> bool:
        """Answer a request that concerns this client alone; return whether it does."""
        if request.setting in (Setting.SUSPEND, Setting.RESUME):
            self._suspended = request.setting == Setting.SUSPEND
            if not self._suspended:
                self.replies += self._held
                self._held.clear()
        elif request.setting == Setting.SIGNATURE:
            self.replies += message(request.setting + REPLY, b"multidrop share")
        elif request.setting in (Setting.LINE_MASK, Setting.MODEM_MASK):
            self.reply(request.setting, request.value)
        else:
            return False
        return True

    def overtaken(self) -> bytes:
        """Take the bytes that wait for its turn, which a stop has overtaken; requests stay.

        A purge that waits is done: the stop drops what has not left. After the stop it would drop the stop itself.
        """
        waiting = tuple(self.waiting)
        self.waiting.clear()
        for item in waiting:
            if isinstance(item, ClientRequest) and item.setting == Setting.PURGE:
                self.reply(item.setting, item.value)
            elif isinstance(item, ClientRequest):
                self.waiting.append(item)
        return b"".join(item for item in waiting if isinstance(item, bytes))

    # To the client

    def reply(self, setting: int, value: int) -> None:
        self.replies += message(setting + REPLY, value)

    def taken(self) -> bytes:
        replies = bytes(self.replies)
        self.replies.clear()
        return replies

    def data(self, data: bytes) -> bytes:
        """Bytes of the line as this client is sent them; none while it has suspended them."""
        if self._telnet is not None:
            data = telnet.escaped(data)
        if not self._suspended:
            return data
        self._held += data
        return b""

    @property
    def overflowed(self) -> bool:
        """Whether more than `MOST_HELD_BYTES` bytes wait for a client that has suspended the flow."""
        return len(self._held) > MOST_HELD_BYTES

    def farewell(self, reason: str) -> bytes:
        """The reason as the connection is closed: a signature with RFC 2217, a line for a telnet terminal."""
        if self.com_port:
            return message(Setting.SIGNATURE + REPLY, reason.encode())
        return f"multidrop share: {reason}\r\n".encode() if self._telnet is not None else b""
