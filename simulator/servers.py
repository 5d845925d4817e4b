"""The ways in to a running floor from outside, as the cell file's `serve` says: pseudo-terminals, TCP, UDP, Modbus/TCP.

Every endpoint of a bus hears the whole wire, and so does every client of an endpoint. Not so over Modbus/TCP: there
each client has a connection of its own to the drive, and hears the answers to its own requests.
"""

from __future__ import annotations

import asyncio
from collections import deque
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import cast

from dialects import Diagnostic
from simulator.cell import BusSpec, Endpoint
from simulator.running import RunningFloor

BACKLOG = 1 << 20
"""Bytes that a TCP client may leave unread before it is let go."""
RETRY = 0.5
"""Seconds between two tries to listen where an Ethernet drive has booted, and its port is taken."""
UDP_CLIENTS = 4
"""Senders that are remembered: the last ones hear the wire."""


@dataclass(frozen=True)
class Served:
    """A bus and one way in to it, as a client names it."""

    bus: str
    endpoint: str


async def serve_bus(floor: RunningFloor, bus: BusSpec, stack: AsyncExitStack) -> list[Served]:
    """Open all that `serve` asks for; the stack closes it. Raises Diagnostic for what cannot be served."""
    served = []
    for endpoint in bus.serve:
        where = f'bus "{bus.name}"'
        try:
            url = await _OPENERS[endpoint.scheme](floor, bus.name, endpoint, stack)
        except OSError as error:
            reason = error.strerror or str(error)
            raise Diagnostic(f"cannot serve {endpoint.text} ({reason})", where) from None
        served.append(Served(bus.name, url))
    return served


async def _serve_pty(floor: RunningFloor, bus: str, endpoint: Endpoint, stack: AsyncExitStack) -> str:
    try:
        from simulator.pty_server import PtyServer
    except ImportError:
        raise Diagnostic("there are no pseudo-terminals on this system", f'bus "{bus}"', "serve tcp://") from None
    server = PtyServer(floor, bus, endpoint.path)
    stack.callback(server.close)
    return server.endpoint


async def _serve_tcp(floor: RunningFloor, bus: str, endpoint: Endpoint, stack: AsyncExitStack) -> str:
    server = TcpServer(floor, bus, endpoint)
    stack.push_async_callback(server.close)
    await server.open()
    return f"{endpoint.scheme}://{_bracketed(endpoint.host)}:{server.port}"


async def _serve_udp(floor: RunningFloor, bus: str, endpoint: Endpoint, stack: AsyncExitStack) -> str:
    transport, server = await floor.loop.create_datagram_endpoint(
        lambda: UdpServer(floor, bus), local_addr=(endpoint.host, endpoint.port)
    )
    stack.callback(transport.close)
    stack.callback(server.close)
    return f"udp://{_bracketed(endpoint.host)}:{transport.get_extra_info('sockname')[1]}"


_OPENERS = {"pty": _serve_pty, "tcp": _serve_tcp, "udp": _serve_udp, "modbus": _serve_tcp}


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


class TcpServer:
    """A listening socket. That of an Ethernet drive is there only while the drive is."""

    def __init__(self, floor: RunningFloor, bus: str, endpoint: Endpoint) -> None:
        self._floor, self._bus = floor, bus
        self._host, self.port = endpoint.host, endpoint.port
        self._kind = ModbusClient if endpoint.scheme == "modbus" else TcpClient
        self._clients: set[TcpClient] = set()
        self._server: asyncio.Server | None = None
        self._opening: asyncio.Task[None] | None = None
        self._closed = False
        self._detach = floor.attach(bus, self)

    async def open(self) -> None:
        """Listen, at the same port as before. Raises OSError."""
        make = self._floor.loop.create_server
        self._server = await make(lambda: self._kind(self._floor, self._bus, self._clients), self._host, self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """End of service."""
        self._closed = True
        self._detach()
        if self._opening is not None:
            await self._opening
        server = self._server
        self.disconnected()
        if server is not None:
            await server.wait_closed()

    def hear(self, data: bytes) -> None:
        """The clients hear it."""

    def unplugged(self) -> None:
        """The clients go; others are sent away as they come."""

    def plugged(self) -> None:
        """They may come again."""

    def disconnected(self) -> None:
        """Nobody listens any more."""
        if self._server is not None:
            self._server.close()
        self._server = None
        for client in tuple(self._clients):
            client.unplugged()

    def connectable(self) -> None:
        """Listen again."""
        if self._opening is None or self._opening.done():
            self._opening = self._floor.loop.create_task(self._reopen())

    async def _reopen(self) -> None:
        """Try until it works, as somebody else may have taken the port, or until the drive is gone again."""
        while self._wanted and self._server is None:
            try:
                await self.open()
            except OSError:
                await asyncio.sleep(RETRY)
        if not self._wanted:
            self.disconnected()

    @property
    def _wanted(self) -> bool:
        return not self._closed and self._floor.floor.connectable(self._bus)


class TcpClient(asyncio.Protocol):
    """One client's connection: it hears the whole wire."""

    def __init__(self, floor: RunningFloor, bus: str, clients: set[TcpClient]) -> None:
        self._floor, self._bus, self._clients = floor, bus, clients
        self._source = floor.source()
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A client came. On an unplugged bus it is sent away."""
        self._transport = cast(asyncio.Transport, transport)
        self._clients.add(self)
        self._detach = self._floor.attach(self._bus, self)
        if self._floor.floor.wires[self._bus].hung_up or not self._floor.floor.connectable(self._bus):
            self.unplugged()

    def data_received(self, data: bytes) -> None:
        """Put it on the wire."""
        self._floor.write(self._bus, data, self._source)

    def connection_lost(self, exc: Exception | None) -> None:
        """The client went."""
        self._transport = None
        self._clients.discard(self)
        self._detach()

    def hear(self, data: bytes) -> None:
        """Pass on what the wire says; a client that never reads is let go."""
        self._send(data)

    def _send(self, data: bytes) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        if self._transport.get_write_buffer_size() > BACKLOG:
            self._transport.abort()
        else:
            self._transport.write(data)

    def unplugged(self) -> None:
        """Close the connection."""
        if self._transport is not None:
            self._transport.close()

    def plugged(self) -> None:
        """The client has to come again."""

    def disconnected(self) -> None:
        """Its server closes the connection."""

    def connectable(self) -> None:
        """The client has to come again."""


class ModbusClient(TcpClient):
    """One client's connection over Modbus/TCP: it hears the answers to its own requests."""

    def __init__(self, floor: RunningFloor, bus: str, clients: set[TcpClient]) -> None:
        super().__init__(floor, bus, clients)
        self._port = floor.floor.modbus(bus)
        self._delays = floor.floor.delays(bus)
        self._late: deque[bytes] = deque()

    def data_received(self, data: bytes) -> None:
        """Answer at once, or as late as the bus's faults have it; who does not speak Modbus is let go."""
        answer = self._floor.exchange(self._bus, self._port, data)
        delay = next(self._delays)
        if delay and answer:
            self._late.append(answer)
            self._floor.later(delay, self._send_late)
        elif answer:
            self._send(answer)
        self._end()

    def _send_late(self) -> None:
        """One answer's time has come: the oldest goes, so none overtakes another."""
        self._send(self._late.popleft())
        self._end()

    def _end(self) -> None:
        if self._port.closed and not self._late:
            self.unplugged()

    def hear(self, data: bytes) -> None:
        """What is said in MCode is not for this client."""


class UdpServer(asyncio.DatagramProtocol):
    """Datagrams in and out; the wire is heard by those who sent last."""

    def __init__(self, floor: RunningFloor, bus: str) -> None:
        self._floor, self._bus = floor, bus
        self._source = floor.source()
        self._senders: dict[tuple[str, int], None] = {}
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.DatagramTransport) -> None:  # type: ignore[override]
        """The socket is there."""
        self._transport = transport
        self._detach = self._floor.attach(self._bus, self)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Remember the sender, and put it on the wire; without power nobody hears it."""
        if not self._floor.floor.connectable(self._bus):
            return
        self._senders.pop(addr, None)
        self._senders[addr] = None
        for old in tuple(self._senders)[:-UDP_CLIENTS]:
            del self._senders[old]
        self._floor.write(self._bus, data, self._source)

    def error_received(self, exc: Exception) -> None:
        """A sender is gone: nothing that anybody here could do about it."""

    def hear(self, data: bytes) -> None:
        """Pass on what the wire says."""
        for sender in self._senders:
            if self._transport is not None:
                self._transport.sendto(data, sender)

    def unplugged(self) -> None:
        """Nobody is listening any more."""
        self._senders.clear()

    def plugged(self) -> None:
        """Senders come back by themselves."""

    def disconnected(self) -> None:
        """A drive that begins anew knows nobody."""
        self._senders.clear()

    def connectable(self) -> None:
        """Senders come back by themselves."""

    def close(self) -> None:
        """End of service."""
        self._detach()
