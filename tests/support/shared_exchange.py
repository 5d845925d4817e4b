"""The rules of a shared port with three clients: what is written, sent and said."""

from __future__ import annotations

from multidrop.features.sharing.stop_bytes import stop_bytes
from multidrop.features.sharing.writer_turns import Action, ClientWrite, Close, PortClients, Purge, Say, Send, Set, Stop
from multidrop.transports import telnet
from multidrop.transports.telnet import OPTION

ADA, BOB, EVE, DAN = 1, 2, 3, 4
HELLO = telnet.option(telnet.WILL, OPTION)
"""The first bytes of a client that speaks RFC 2217."""
MST = bytes([1, 3, 0, 0, 0, 0, 0, 0, 4])
ROR = bytes([1, 1, 0, 0, 0, 0, 0, 100, 102])


class Port:
    """An exchange whose port takes all bytes at once, unless it is `slow`: then they wait until they are dropped."""

    def __init__(self, family: str = "", slow: bool = False, party: bool | None = None) -> None:
        self.exchange = PortClients(stop_bytes(family, (), party), 9600)
        self.slow = slow
        self.settles = True
        """Time passes until what follows a line that was made harmless is written."""
        self.written = b""
        self.waiting = b""
        self.sent: dict[int, bytes] = {ADA: b"", BOB: b"", EVE: b""}
        self.said: list[str] = []
        self.set: list[Set] = []
        self.closed: list[int] = []
        for client, name in ((ADA, "ada"), (BOB, "bob"), (EVE, "eve")):
            self.do(self.exchange.connect(client, name))
        self.said.clear()

    def join(self, client: int) -> None:
        """Connect one more client."""
        self.sent[client] = b""
        self.do(self.exchange.connect(client, f"client {client}"))

    def send(self, client: int, data: bytes, now: float = 0.0) -> None:
        self.do(self.exchange.receive(client, data, now))
        while self.settles and (until := self.exchange.settling.until):
            self.do(self.exchange.advance(until))

    def reply(self, data: bytes = b"0\r\n", now: float = 0.0) -> None:
        """Have the drives send something."""
        self.do(self.exchange.printed(data, now))

    def do(self, actions: list[Action]) -> None:
        for each in actions:
            match each:
                case ClientWrite(_, data):
                    self._take(data)
                case Stop(data, mended):
                    self.written += mended if self._drop() else data
                case Purge():
                    self._drop()
                case Send(client, data):
                    self.sent[client] += data
                case Close(client, farewell):
                    self.sent[client] += farewell
                    self.closed.append(client)
                case Set():
                    self.set.append(each)
                case Say(client, event, detail):
                    self.said.append(" ".join(filter(None, (client, event, detail))))

    def _take(self, data: bytes) -> None:
        if self.slow:
            self.waiting += data
        else:
            self.written += data

    def _drop(self) -> int:
        dropped, self.waiting = len(self.waiting), b""
        self.do(self.exchange.dropped(dropped))
        return dropped
