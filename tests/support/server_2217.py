"""A server of RFC 2217 in memory."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from multidrop.base.errors import TransportLost
from multidrop.transports import Lost, Received, Transport, telnet
from multidrop.transports.telnet import OPTION, REPLY, message, parsed


class Server(Transport):
    """A server at the other end of a pipe in memory. `late`: replies wait until there are so many, last one first."""

    name = "rfc2217://gateway:2217"

    def __init__(
        self,
        ignores: tuple[tuple[int, int] | int, ...] = (),
        keeps: dict[int, int] | None = None,
        late: int = 0,
        option: bytes = telnet.option(telnet.DO, OPTION),
    ) -> None:
        self.ignores, self.keeps, self.late, self.option = ignores, keeps or {}, late, option
        self.data = bytearray()
        self.pieces: list[bytes] = []
        self.asked: list[tuple[int, int]] = []
        self.options: list[telnet.Option] = []
        self.unsent = 0
        self.closed = self.full = False
        self.followed: list[tuple[bool, bytes | None]] = []
        self._decoder = telnet.Decoder()
        self._replies: list[bytes] = []

    def start(self, received: Received, lost: Lost) -> None:
        self.received, self.lost = received, lost

    def send(self, data: bytes) -> None:
        """Send to the client byte by byte, in turns of their own."""
        for each in data:
            asyncio.get_running_loop().call_soon(self.received, bytes([each]))

    def hang_up(self) -> None:
        asyncio.get_running_loop().call_soon(self.lost, TransportLost(f"{self.name} was lost: closed"))

    def write(self, data: bytes) -> bool:
        self.pieces.append(data)
        if self.full:
            return False
        for event in self._decoder.receive(data):
            if isinstance(event, telnet.Data):
                self.data += event.data
            elif isinstance(event, telnet.Option):
                self.options.append(event)
                if (event.verb, event.option) == (telnet.WILL, OPTION):
                    self.send(self.option)
            elif isinstance(event, telnet.Subnegotiation) and (found := parsed(event.body)):
                self._ask(found[0], int.from_bytes(found[1]))
        return True

    def _ask(self, setting: int, value: int) -> None:
        self.asked.append((setting, value))
        if setting in self.ignores or (setting, value) in self.ignores:
            return
        self._replies.append(message(setting + REPLY, self.keeps.get(setting, value)))
        if len(self._replies) >= self.late:
            self.send(b"".join(reversed(self._replies)))
            self._replies.clear()

    @property
    def pending(self) -> int:
        return self.unsent

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        return not self.full and self.write(make(self.discard(whole)))

    def follow(self, make: Callable[[int], bytes | None], key: bool = False) -> bool:
        self.followed.append((key, data := make(self.unsent)))
        return data is not None

    def yielded(self, note: Callable[[bool], None] = lambda last: None) -> bool:
        note(False)
        return False

    def discard(self, whole: bool = False) -> int:
        assert whole, "a cut could be within a message of telnet"
        dropped, self.unsent = self.unsent, 0
        return dropped

    async def close(self) -> None:
        self.closed = True
