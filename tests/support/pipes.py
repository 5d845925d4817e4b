"""Pipes of every kind, each opened through its public function against a real far end."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field

import serial
from serial import rfc2217

from multidrop.base.errors import TransportLost
from multidrop.transports import Transport
from multidrop.transports.relay_pipe import RelayPipe
from multidrop.transports.rfc2217 import open_rfc2217
from multidrop.transports.serial_port import SerialDevice, open_serial
from multidrop.transports.sockets import SocketDevice, open_tcp, open_udp, set_socket_options
from multidrop.transports.threaded import ThreadedPipe
from tests.support.lent_port import lent
from tests.support.posix import tty
from tests.support.until import PATIENCE


class FarEnd:
    """The far side of a pipe, as a descriptor."""

    purged: threading.Event | None = None

    def __init__(self, descriptor: int, hang_up: Callable[[], None]) -> None:
        self.descriptor, self.hang_up = descriptor, hang_up
        os.set_blocking(descriptor, False)

    async def _ready(self, add: Callable[..., None], remove: Callable[[int], bool]) -> None:
        ready = asyncio.Event()
        add(self.descriptor, ready.set)
        try:
            await asyncio.wait_for(ready.wait(), PATIENCE)
        finally:
            remove(self.descriptor)

    async def send(self, data: bytes) -> None:
        loop = asyncio.get_running_loop()
        while data:
            try:
                data = data[os.write(self.descriptor, data) :]
            except BlockingIOError:
                await self._ready(loop.add_writer, loop.remove_writer)

    async def receive(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            data += await self.receive_some()
        return data

    async def receive_some(self) -> bytes:
        loop = asyncio.get_running_loop()
        while True:
            try:
                return os.read(self.descriptor, 65536)
            except BlockingIOError:
                await self._ready(loop.add_reader, loop.remove_reader)


@dataclass
class Rig:
    """An open transport, the bytes that it delivered, its loss, and its far end."""

    transport: Transport
    far: FarEnd
    data: bytearray = field(default_factory=bytearray)
    losses: list[TransportLost] = field(default_factory=list)
    news: asyncio.Event = field(default_factory=asyncio.Event)

    def start(self) -> None:
        self.transport.start(self._received, self._lost)

    def _received(self, data: bytes) -> None:
        self.data += data
        self.news.set()

    def _lost(self, error: TransportLost) -> None:
        self.losses.append(error)
        self.news.set()

    async def until(self, condition: Callable[[], object]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not condition():
                self.news.clear()
                await self.news.wait()


class PtyPort(serial.Serial):
    """A pseudo-terminal without modem lines, which a device server wants to read and set."""

    cts = dsr = ri = cd = property(lambda self: False)
    dtr = rts = property(lambda self: True, lambda self, value: None)

    purged: threading.Event | None = None

    def reset_output_buffer(self) -> None:
        super().reset_output_buffer()
        if self.purged is not None:
            self.purged.set()


class Server2217(threading.Thread):
    """A device server with one port and one client: pyserial's own far side of RFC 2217."""

    def __init__(self, port: str) -> None:
        super().__init__(daemon=True)
        self.port = PtyPort(port, timeout=0.02)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.client: socket.socket | None = None
        self.lock = threading.Lock()
        self.purged = self.port.purged = threading.Event()
        self.over = False

    def write(self, data: bytes) -> None:
        """Send PortManager's replies to the client."""
        assert self.client is not None
        with self.lock, contextlib.suppress(OSError):
            self.client.sendall(data)

    def run(self) -> None:
        self.client, _ = self.listener.accept()
        manager = rfc2217.PortManager(self.port, self)  # type: ignore[arg-type]
        back = threading.Thread(target=self._back, args=(manager,), daemon=True)
        back.start()
        with contextlib.suppress(OSError):
            while data := self.client.recv(1024):
                self._forward(b"".join(manager.filter(data)))
        self.over = True
        back.join()

    def _forward(self, data: bytes) -> None:
        while data and not self.over:
            try:
                data = data[os.write(self.port.fileno(), data) :]
            except BlockingIOError:  # pyserial's own write spins here, and cannot be ended
                time.sleep(0.005)

    def _back(self, manager: rfc2217.PortManager) -> None:
        while not self.over:
            with contextlib.suppress(OSError):
                self.write(b"".join(manager.escape(self.port.read(1) + self.port.read(self.port.in_waiting))))

    def hang_up(self) -> None:
        if self.client is not None:
            with contextlib.suppress(OSError):
                self.client.shutdown(socket.SHUT_RDWR)

    def stop(self) -> None:
        self.over = True
        self.hang_up()
        self.join(PATIENCE)
        for each in (self.listener, self.client, self.port):
            if each is not None:
                each.close()


Opened = tuple[Transport, FarEnd]


@contextlib.asynccontextmanager
async def pty_pair(opener: Callable[[str], Awaitable[Transport]]) -> AsyncIterator[Opened]:
    master, slave = os.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    open_ends = {master}

    def hang_up() -> None:
        if open_ends:
            os.close(open_ends.pop())

    try:
        transport = await opener(path)
        os.close(slave)
        yield transport, FarEnd(master, hang_up)
    finally:
        hang_up()


async def threaded_serial(path: str) -> Transport:
    return ThreadedPipe(SerialDevice(path, 9600))


@contextlib.asynccontextmanager
async def tcp_pair(opener: Callable[[str, int], Awaitable[Transport]]) -> AsyncIterator[Opened]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        transport = await opener(*listener.getsockname())
        client, _ = listener.accept()
        with client:
            yield transport, FarEnd(client.fileno(), lambda: client.shutdown(socket.SHUT_WR))


async def threaded_tcp(host: str, port: int) -> Transport:
    plain = socket.create_connection((host, port))
    set_socket_options(plain)
    return ThreadedPipe(SocketDevice(f"tcp://{host}:{port}", plain))


@contextlib.asynccontextmanager
async def udp_pair(opener: Callable[[str, int], Awaitable[Transport]]) -> AsyncIterator[Opened]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
        far.bind(("127.0.0.1", 0))
        transport = await opener(*far.getsockname())
        transport.write(b"?")  # so that the far end gets to know where to send to
        await asyncio.get_running_loop().run_in_executor(None, lambda: far.connect(far.recvfrom(9)[1]))

        def hang_up() -> None:
            far.close()
            transport.write(b"anybody?")

        yield transport, FarEnd(far.fileno(), hang_up)


async def threaded_udp(host: str, port: int) -> Transport:
    plain = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    plain.connect((host, port))
    return ThreadedPipe(SocketDevice(f"udp://{host}:{port}", plain))


@contextlib.asynccontextmanager
async def rfc2217_pair() -> AsyncIterator[Opened]:
    master, slave = os.openpty()
    server = Server2217(os.ttyname(slave))
    server.start()
    try:
        transport = await open_rfc2217("127.0.0.1", server.listener.getsockname()[1], 19200)
        far = FarEnd(master, server.hang_up)
        far.purged = server.purged
        yield transport, far
    finally:
        await asyncio.to_thread(server.stop)
        os.close(slave)
        os.close(master)


@contextlib.asynccontextmanager
async def relay_pair() -> AsyncIterator[Opened]:
    master, slave = os.openpty()
    open_ends = {master}
    try:
        with lent(os.ttyname(slave), 19200) as connection:
            os.close(slave)
            transport = RelayPipe(connection, 19200)
            yield transport, FarEnd(master, lambda: os.close(open_ends.pop()) if open_ends else None)
            await transport.close()
    finally:
        for end in open_ends:
            os.close(end)


KINDS: dict[str, Callable[[], contextlib.AbstractAsyncContextManager[Opened]]] = {
    "serial": lambda: pty_pair(open_serial),
    "serial by threads": lambda: pty_pair(threaded_serial),
    "tcp": lambda: tcp_pair(open_tcp),
    "tcp by threads": lambda: tcp_pair(threaded_tcp),
    "rfc2217": rfc2217_pair,
    "relay": relay_pair,
    "udp": lambda: udp_pair(open_udp),
    "udp by threads": lambda: udp_pair(threaded_udp),
}
STREAMS = [kind for kind in KINDS if not kind.startswith("udp")]


@contextlib.asynccontextmanager
async def rig(kind: str) -> AsyncIterator[Rig]:
    """An open pipe with its far end; afterwards every descriptor that it took must be free again."""
    before = len(os.listdir("/dev/fd"))
    async with KINDS[kind]() as (transport, far):
        each = Rig(transport, far)
        try:
            yield each
        finally:
            await transport.close()
    assert len(os.listdir("/dev/fd")) == before
