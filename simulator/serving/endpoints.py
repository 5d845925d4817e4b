"""The ways in to a running floor from outside, as the cell file's `serve` says: pseudo-terminals, TCP, UDP.

Every endpoint of a bus hears the whole wire, and so does every client of an endpoint. Not so at a drive's own port
(`Simulated.own_port`): there each client hears the answers to its own requests.
"""

from __future__ import annotations

import asyncio
import socket
import sys
from collections import deque
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import cast

from multidrop.base.errors import Diagnostic
from multidrop.simulator.cell.endpoint_kinds import kind_of
from multidrop.simulator.cell.spec import BusSpec, Endpoint
from multidrop.simulator.declared import own_ports
from multidrop.simulator.serving.running import PIECE, InputQueue, Listener, RunningFloor, ServedClient

BACKLOG = 1 << 20
"""Bytes that a TCP client may leave unread before it is disconnected."""
RETRY = 0.5
"""Seconds between two tries to listen when an Ethernet drive has booted, and its port is taken."""
UDP_CLIENTS = 4
"""The last senders, to which the wire is sent."""
UDP_WAITING = 1024
"""Bytes of datagrams that wait to go out when a further one is dropped."""
MOST_LATE = 64
"""Delayed replies to a client of a drive's own port from which on no more requests are read."""
NO_TERMINALS = "Windows has no pseudo-terminals"
ESTABLISHED = 1
"""Linux's state of a connection that neither side has ended."""


@dataclass(frozen=True)
class Served:
    """A bus and one of its endpoints, as a client names it."""

    bus: str
    endpoint: str


async def serve_bus(floor: RunningFloor, bus: BusSpec, stack: AsyncExitStack) -> list[Served]:
    """Open all endpoints of a bus; the stack closes them. Raises Diagnostic for one that cannot be served."""
    served = []
    for endpoint in bus.serve:
        try:
            urls = await _open(floor, bus.name, endpoint, stack)
        except OSError as error:
            reason = error.strerror or str(error)
            raise Diagnostic(f"cannot serve {endpoint.text} ({reason})", f'bus "{bus.name}"') from None
        served += [Served(bus.name, url) for url in urls]
    if sys.platform == "win32" and bus.serve and not served:
        raise Diagnostic(NO_TERMINALS, f'bus "{bus.name}"', 'serve = ["tcp://127.0.0.1:0"]')
    return served


async def _open(floor: RunningFloor, bus: str, endpoint: Endpoint, stack: AsyncExitStack) -> list[str]:
    """Open one endpoint; return what clients open, nothing where the system has no such thing. Raises OSError."""
    place = f"{endpoint.scheme}://" + (f"[{endpoint.host}]" if ":" in endpoint.host else endpoint.host)
    match endpoint.scheme:
        case "pty":
            if sys.platform == "win32":
                floor.notify(f'bus "{bus}": {endpoint.text} is not served: {NO_TERMINALS}; its other endpoints are')
                return []
            else:
                from multidrop.simulator.serving.pty import PtyServer

                terminal = PtyServer(floor, bus, endpoint.path)
                stack.callback(terminal.close)
                return [terminal.endpoint]
        case "udp":
            transport, datagrams = await floor.loop.create_datagram_endpoint(
                lambda: UdpServer(floor, bus), local_addr=(endpoint.host, endpoint.port)
            )
            stack.callback(transport.close)
            stack.callback(datagrams.close)
            return [f"{place}:{transport.get_extra_info('sockname')[1]}"]
    if (kind := kind_of(endpoint.scheme)) is not None:
        return await kind.open(floor, bus, endpoint, stack)
    server = TcpServer(floor, bus, endpoint)
    stack.push_async_callback(server.close)
    await server.open()
    return [f"{place}:{server.port}"]


class TcpServer(Listener):
    """A listening socket. An Ethernet drive's socket listens only while the drive has power."""

    def __init__(self, floor: RunningFloor, bus: str, endpoint: Endpoint) -> None:
        self._floor, self._bus = floor, bus
        self._host, self.port = endpoint.host, endpoint.port
        self._kind = MessageClient if endpoint.scheme in own_ports() else TcpClient
        self._clients: set[TcpClient] = set()
        self._server: asyncio.Server | None = None
        self._opening: asyncio.Task[None] | None = None
        self._closed = False
        self._detach = floor.attach(bus, self)

    async def open(self) -> None:
        """Listen, at the port of before. Raises OSError."""
        make = self._floor.loop.create_server
        self._server = await make(lambda: self._kind(self._floor, self._bus, self._clients), self._host, self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        self._closed = True
        self._detach()
        if self._opening is not None:
            await self._opening
        server = self._server
        self.disconnected()
        if server is not None:
            await server.wait_closed()

    def disconnected(self) -> None:
        if self._server is not None:
            self._server.close()
        self._server = None
        for client in tuple(self._clients):
            client.unplugged()

    def connectable(self) -> None:
        if self._opening is None or self._opening.done():
            self._opening = self._floor.loop.create_task(self._reopen())

    async def _reopen(self) -> None:
        """Try until it works, since another program may have taken the port, or until the drive is off again."""
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


class TcpClient(asyncio.BufferedProtocol, ServedClient):
    """One client's connection: it receives the whole wire, and is read as fast as the wire carries what it writes."""

    gathers = True

    def __init__(self, floor: RunningFloor, bus: str, clients: set[TcpClient]) -> None:
        self._floor, self._bus, self._clients = floor, bus, clients
        self._queue = InputQueue(floor, bus, self)
        self._buffer = bytearray(PIECE)
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin with a client. On an unplugged bus it is disconnected."""
        self._transport = cast(asyncio.Transport, transport)
        self._clients.add(self)
        self._detach = self._floor.attach(self._bus, self)
        if self._floor.floor.wires[self._bus].hung_up or not self._floor.floor.connectable(self._bus):
            self.unplugged()

    def get_buffer(self, sizehint: int) -> memoryview:
        return memoryview(self._buffer)[: max(1, self._queue.room)]

    def buffer_updated(self, nbytes: int) -> None:
        self.take(bytes(self._buffer[:nbytes]))

    def take(self, data: bytes) -> None:
        self._queue.write(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._transport = None
        self._clients.discard(self)
        self._queue.close()
        self._detach()

    def pause(self) -> None:
        """Stop reading: the wire is slower."""
        if self._transport is not None:
            self._transport.pause_reading()

    def resume(self) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.resume_reading()

    def has_left(self) -> bool:
        """Whether the client has left: its end comes after what is unread, but the connection's state shows it."""
        return self._transport is not None and _ended(self._transport)

    def discard(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def receive(self, data: bytes) -> None:
        self._send(data)

    def _send(self, data: bytes) -> None:
        """Pass on what the wire sends; a client that never reads is disconnected."""
        if self._transport is None or self._transport.is_closing():
            return
        if self._transport.get_write_buffer_size() > BACKLOG:
            self._transport.abort()
        else:
            self._transport.write(data)

    def unplugged(self) -> None:
        if self._transport is not None:
            self._transport.close()


class MessageClient(TcpClient):
    """One client's connection to a drive's own port: it receives the replies to its own requests."""

    def __init__(self, floor: RunningFloor, bus: str, clients: set[TcpClient]) -> None:
        super().__init__(floor, bus, clients)
        self._port = floor.floor.own_port(bus)
        self._delays = floor.floor.delays(bus)
        self._late: deque[bytes] = deque()

    def take(self, data: bytes) -> None:
        """Reply at once, or as late as the bus's faults say; disconnect a client that does not speak the language."""
        answer = self._floor.exchange(self._bus, self._port, data)
        delay = next(self._delays)
        if delay and answer:
            self._late.append(answer)
            self._floor.later(delay, self._send_late)
            if len(self._late) == MOST_LATE:
                self.pause()
        elif answer:
            self._send(answer)
        self._end()

    def _send_late(self) -> None:
        """Send the oldest delayed reply, so that none overtakes another."""
        self._send(self._late.popleft())
        if len(self._late) == MOST_LATE - 1:
            self.resume()
        self._end()

    def _end(self) -> None:
        if self._port.closed and not self._late:
            self.unplugged()

    def receive(self, data: bytes) -> None:
        """Nothing to do: what is on the line is not for this client."""


def _ended(transport: asyncio.Transport) -> bool:
    """Whether a client that is not read has ended its connection, as far as the system reports it."""
    connection = transport.get_extra_info("socket")
    if connection is None or sys.platform != "linux":
        return False
    return bool(connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0] != ESTABLISHED)


class UdpServer(asyncio.DatagramProtocol, Listener):
    """Datagrams in and out; the last senders receive the wire. What comes faster than it goes out is dropped."""

    def __init__(self, floor: RunningFloor, bus: str) -> None:
        self._floor, self._bus = floor, bus
        self._source = floor.source()
        self.dropped = 0
        self._senders: dict[tuple[str, int], None] = {}
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.DatagramTransport) -> None:  # type: ignore[override]
        """Begin: the socket is open."""
        self._transport = transport
        self._detach = self._floor.attach(self._bus, self)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Remember the sender, and put the datagram on the wire; without power it is lost."""
        if not self._floor.floor.connectable(self._bus):
            return
        self._senders.pop(addr, None)
        self._senders[addr] = None
        for old in tuple(self._senders)[:-UDP_CLIENTS]:
            del self._senders[old]
        if self._floor.floor.wires[self._bus].queued(self._source) < UDP_WAITING:
            self._floor.write(self._bus, data, self._source)
        else:
            if not self.dropped:
                self._floor.notify(f"{self._bus}: datagrams come faster than the wire carries them; some are dropped")
            self.dropped += 1

    def receive(self, data: bytes) -> None:
        if self._transport is None or cast(asyncio.Transport, self._transport).get_write_buffer_size() > BACKLOG:
            return
        for sender in self._senders:
            self._transport.sendto(data, sender)

    def unplugged(self) -> None:
        self._senders.clear()

    def disconnected(self) -> None:
        self._senders.clear()

    def close(self) -> None:
        if self.dropped:
            self._floor.notify(f"{self._bus}: {self.dropped} datagrams were dropped in all")
        self._detach()
