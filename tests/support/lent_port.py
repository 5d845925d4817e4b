"""A port that `multidrop relay` lends, without ssh and without a process of its own."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator

from multidrop.base.errors import TransportLost
from multidrop.transports.relay import GREETING, SILENCE, serve
from multidrop.transports.relay_pipe import SocketStream
from multidrop.transports.serial_port import SerialEndpoint
from tests.support.until import PATIENCE


@contextlib.contextmanager
def lent(port: str, baud: int = 9600, silence: float = SILENCE) -> Iterator[SocketStream]:
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
        yield SocketStream("ssh://pc/dev/ttyS0", ours)
    finally:
        ours.close()
        far.join(PATIENCE)
