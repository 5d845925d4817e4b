"""A port that `multidrop relay` lends, without ssh and without a process of its own."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator

from multidrop.transports import TransportLost
from multidrop.transports.relay import GREETING, SILENCE, serve
from multidrop.transports.serial_port import SerialEndpoint
from tests.support.until import PATIENCE


class SocketConnection:
    """What a relay's pipe needs of ssh."""

    name = "ssh://pc/dev/ttyS0"

    def __init__(self, ours: socket.socket) -> None:
        ours.setblocking(False)
        self.fileno, self.read, self.write, self._socket = ours.fileno, ours.recv, ours.send, ours

    def last_words(self) -> str:
        return ""

    def close(self, lost: bool) -> None:
        self._socket.close()


@contextlib.contextmanager
def lent(port: str, baud: int = 9600, silence: float = SILENCE) -> Iterator[SocketConnection]:
    """Lend a port in a thread, until the connection is closed."""
    endpoint = SerialEndpoint(port, baud)
    ours, theirs = socket.socketpair()

    def lend() -> None:
        with theirs, contextlib.suppress(TransportLost):
            serve(endpoint, theirs.fileno(), theirs.fileno(), silence)

    far = threading.Thread(target=lend)
    far.start()
    try:
        assert ours.recv(len(GREETING) + 1).decode() == f"{GREETING}\n"
        yield SocketConnection(ours)
    finally:
        ours.close()
        far.join(PATIENCE)
