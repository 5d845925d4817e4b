"""The URL of a server of this program, `prometheus://[HOST]:PORT` or `opcua://[HOST]:PORT`, and its port."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import NamedTuple
from urllib.parse import urlsplit

from multidrop.base.errors import Diagnostic
from multidrop.base.text import visible
from multidrop.transports import Unreachable
from multidrop.transports.sockets import explain, exposed, host_port

HOST = "127.0.0.1"
EXPOSED = "everybody who reaches {} can read what the drives do; without a HOST only this machine can"


class Listening(NamedTuple):
    """A scheme, and the host and the port on which this program listens; port 0: a free one."""

    scheme: str
    host: str
    port: int

    @property
    def text(self) -> str:
        return f"{self.scheme}://{host_port(self.host, self.port)}"

    async def taken(self, notify: Callable[[str], None]) -> tuple[Listening, socket.socket]:
        """Return a socket that listens, and its place; warn of one for other machines. Raises Unreachable."""
        try:
            addresses = await asyncio.get_running_loop().getaddrinfo(
                self.host, self.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )
            family, _, _, _, address = addresses[0]
            listener = socket.create_server(address, family=family, backlog=16)
        except (OSError, UnicodeError) as error:
            why = explain(error) if isinstance(error, OSError) else "invalid host name"
            raise Unreachable(f"--to {self.text}: cannot listen there: {why}; give another one") from None
        place = self._replace(port=listener.getsockname()[1])
        if exposed(self.host):
            notify(EXPOSED.format(place.text))
        return place, listener


def parse_listening(text: str) -> Listening:
    """Parse the URL of a server. Raises Diagnostic."""
    scheme, _, address = text.partition("://")
    problem = Diagnostic(f"no address {visible(address)!r} of a server", "--to", f"valid: {scheme}://[HOST]:PORT")
    try:
        parts = urlsplit(f"//{address}")
        host, port = parts.hostname or HOST, parts.port
    except ValueError:
        raise problem from None
    if parts.netloc != address or "@" in address or port is None or visible(host) != host or " " in host:
        raise problem
    return Listening(scheme, host, port)
