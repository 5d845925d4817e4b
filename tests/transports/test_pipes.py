"""One body of tests over every kind of pipe, opened through its public function against a real far end."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import select
import socket
import sys
import termios
import threading
import time
import tty
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field

import pytest
import serial
from serial import rfc2217

from tests.support.lent_port import lent
from transports import Controllable, Transport, TransportLost
from transports.relay_pipe import RelayPipe
from transports.rfc2217 import PIECE, open_rfc2217
from transports.serial_port import SerialDevice, open_serial
from transports.sockets import SocketDevice, open_tcp, open_udp, set_socket_options
from transports.threaded import ThreadedPipe

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="the far ends are pseudo-terminals"),
    pytest.mark.filterwarnings(r"ignore:set(Daemon|Name)\(\):DeprecationWarning"),
]

PATIENCE = 10.0


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
RFC2217 = pytest.param("rfc2217", marks=pytest.mark.slow)  # opening takes 0.6 s of settings, one after the other
every_kind = pytest.mark.parametrize("kind", [RFC2217 if kind == "rfc2217" else kind for kind in KINDS])
every_stream = pytest.mark.parametrize("kind", [RFC2217 if kind == "rfc2217" else kind for kind in STREAMS])


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


@every_kind
async def test_every_byte_goes_through_both_ways_one_by_one(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        for value in range(256):
            each.transport.write(bytes([value]))
        assert await each.far.receive(256) == bytes(range(256))
        for value in range(256):
            await each.far.send(bytes([value]))
        await each.until(lambda: len(each.data) == 256)
        assert each.data == bytes(range(256))
        assert each.losses == []


@every_stream
async def test_a_large_write_goes_through_whole(kind: str) -> None:
    large = bytes(range(251)) * (80 if kind == "rfc2217" else 1000)
    async with rig(kind) as each:
        each.start()
        each.transport.write(large)
        assert await each.far.receive(len(large)) == large
        await each.far.send(large)
        await each.until(lambda: len(each.data) == len(large))
        assert each.data == large


@every_kind
async def test_what_comes_before_the_start_is_kept(kind: str) -> None:
    async with rig(kind) as each:
        await each.far.send(b"early")
        each.start()
        await each.until(lambda: each.data == b"early")


@every_kind
async def test_a_lost_pipe_is_told_once_and_takes_nothing_more(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        each.far.hang_up()
        await each.until(lambda: each.losses)
        each.transport.write(b"more")
        assert each.transport.discard() == 0
        await asyncio.sleep(0.05)
        (loss,) = each.losses
        assert str(loss).startswith(f"{each.transport.name} was lost: ")
        assert re.search("check its power|nothing listens|plug it in", str(loss))
        assert "\n" not in str(loss)


@pytest.mark.parametrize("kind", ["tcp", "tcp by threads"])
async def test_the_last_words_of_the_other_end_are_delivered_before_the_loss(kind: str) -> None:
    async with rig(kind) as each:
        await each.far.send(b"bye" * 100)
        each.far.hang_up()
        each.start()
        await each.until(lambda: each.losses)
        assert each.data == b"bye" * 100


@pytest.mark.slow
async def test_the_last_words_over_rfc2217_are_delivered_before_the_loss() -> None:
    async with rig("rfc2217") as each:
        await each.far.send(b"bye" * 100)
        await asyncio.sleep(0.2)  # the server passes them on; nobody tells when it has
        each.far.hang_up()
        await asyncio.sleep(0.2)  # pyserial's own reader has ended by now, with all of them in its queue
        each.start()
        await each.until(lambda: each.losses)
        assert each.data == b"bye" * 100


@every_stream
async def test_discard_drops_what_has_not_gone(kind: str) -> None:
    large = 1_000_000
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"x" * large)
        await asyncio.sleep(0.1)  # the pipe fills, as nobody reads
        dropped = each.transport.discard()
        assert dropped > large / 2
        each.transport.write(b"!")
        arrived = b""
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert len(arrived) <= large - dropped + 1
        assert arrived.endswith(b"!")


@pytest.mark.parametrize("kind", [kind for kind in STREAMS if kind != "rfc2217"])
async def test_discard_with_whole_sends_what_has_begun_to_its_end_and_nothing_of_the_rest(kind: str) -> None:
    large = 1_000_000
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"x" * large)
        each.transport.write(b"y" * large)
        await asyncio.sleep(0.1)  # the pipe fills, as nobody reads
        assert each.transport.discard(whole=True) == large
        each.transport.write(b"!")
        arrived = b""
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert arrived == b"x" * large + b"!"


@every_kind
async def test_discard_drops_nothing_that_is_written_after_it(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        assert each.transport.discard() == 0
        each.transport.write(b"after")
        assert await each.far.receive(5) == b"after"


async def test_a_large_write_over_rfc2217_counts_as_several() -> None:
    async with rig("rfc2217") as each:
        each.start()
        each.transport.write(b"x" * 1_000_000)
        await asyncio.sleep(0.1)  # the pipe fills, as nobody reads
        dropped = each.transport.discard(whole=True)
        each.transport.write(b"!")
        arrived = b""
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert dropped > 500_000 and dropped % PIECE in (0, 1_000_000 % PIECE)
        assert arrived == b"x" * (1_000_000 - dropped) + b"!"


@pytest.mark.parametrize("kind", ["serial", "tcp", "udp", "relay", "rfc2217"])
async def test_a_thread_writes_its_stop_while_the_loop_is_held_up_and_nothing_follows_until_the_loop_knows(kind: str):
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"MR 5")
        assert await each.far.receive(4) == b"MR 5"
        arrived: list[bytes] = []

        def stop() -> None:
            assert each.transport.preempt(False, lambda dropped: b"stop")
            select.select([each.far.descriptor], [], [], PATIENCE)
            arrived.append(os.read(each.far.descriptor, 100))

        thread = threading.Thread(target=stop)
        thread.start()
        thread.join(PATIENCE)  # the loop does nothing meanwhile
        assert arrived == [b"stop"]
        assert not each.transport.write(b"1200\r")
        each.transport.yielded()
        assert each.transport.write(b"after")
        assert await each.far.receive(5) == b"after"


@pytest.mark.parametrize("kind", ["serial", "tcp", "relay"])
@pytest.mark.parametrize("whole", [False, True])
async def test_what_preempts_the_loop_drops_what_is_unsent_and_follows_what_has_begun(kind: str, whole: bool):
    large = 1_000_000
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"x" * large)
        each.transport.write(b"y" * large)
        dropped: list[int] = []

        def stop(unsent: int) -> bytes:
            dropped.append(unsent)
            return b"!"

        thread = threading.Thread(target=each.transport.preempt, args=(whole, stop))
        thread.start()
        thread.join(PATIENCE)
        arrived = b""
        while b"!" not in arrived:
            arrived += await each.far.receive_some()
        assert arrived.strip(b"x") == b"!"
        assert dropped[0] == large if whole else dropped[0] > large
        assert not whole or len(arrived) == large + 1


async def test_a_broken_pipe_is_not_preempted():
    async with rig("tcp") as each:
        each.start()
        each.far.hang_up()
        await each.until(lambda: each.losses)
        assert not each.transport.preempt(False, lambda dropped: b"stop")
        assert not each.transport.write(b"MR 5\r")


@every_kind
async def test_close_may_be_repeated_and_is_no_loss(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        await asyncio.gather(each.transport.close(), each.transport.close())
        await each.transport.close()
        each.transport.write(b"nothing")
        assert each.transport.discard() == 0
        each.far.hang_up()
        await asyncio.sleep(0.02)
        assert each.losses == []


@every_kind
async def test_what_was_written_before_the_close_arrives(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        each.transport.write(b"\x1b*SL 0\n")
        await each.transport.close()
        assert await each.far.receive(7) == b"\x1b*SL 0\n"


@every_kind
async def test_a_pipe_that_was_never_started_closes(kind: str) -> None:
    async with rig(kind) as each:
        await each.far.send(b"unread")


@pytest.mark.slow
@every_stream
async def test_a_stuck_pipe_blocks_neither_writing_nor_closing(kind: str) -> None:
    gaps = [0.0]

    async def beat() -> None:
        while True:
            began = time.monotonic()
            await asyncio.sleep(0.005)
            gaps.append(time.monotonic() - began)

    async with rig(kind) as each:
        each.start()
        heart = asyncio.create_task(beat())
        began = time.monotonic()
        for _ in range(20):
            each.transport.write(b"x" * 50_000)
            await asyncio.sleep(0)
        assert time.monotonic() - began < 1.0
        await each.transport.close()
        assert time.monotonic() - began < 5.0
        heart.cancel()
        assert max(gaps) < 0.5
        assert each.losses == []


@every_kind
async def test_a_cancelled_close_closes_all_the_same(kind: str) -> None:
    async with rig(kind) as each:
        each.start()
        closing = asyncio.create_task(each.transport.close())
        await asyncio.sleep(0)
        closing.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await closing
        await each.transport.close()


@pytest.mark.slow
async def test_discard_on_rfc2217_has_the_server_drop_its_part() -> None:
    async with rig("rfc2217") as each:
        assert each.far.purged is not None
        each.far.purged.clear()  # opening purges too
        each.transport.discard()
        assert await asyncio.to_thread(each.far.purged.wait, PATIENCE)


@pytest.mark.slow
async def test_rfc2217_sets_the_rate_of_the_far_port() -> None:
    async with rig("rfc2217") as each:
        assert termios.tcgetattr(each.far.descriptor)[4:6] == [termios.B19200] * 2
        assert isinstance(each.transport, Controllable) and each.transport.control is not None
        await asyncio.to_thread(each.transport.control.set_baud, 38400)  # in a thread: the server confirms it
        assert termios.tcgetattr(each.far.descriptor)[4:6] == [termios.B38400] * 2
        await asyncio.to_thread(each.transport.control.set_break, True)
        await asyncio.to_thread(each.transport.control.set_break, False)


async def test_a_relay_sets_the_rate_of_the_far_port_and_names_a_refusal() -> None:
    async with rig("relay") as each:
        each.start()
        assert isinstance(each.transport, Controllable) and (control := each.transport.control) is not None
        await asyncio.to_thread(control.set_baud, 38400)
        assert termios.tcgetattr(each.far.descriptor)[4:6] == [termios.B38400] * 2
        assert control.baud == 38400
        with pytest.raises(OSError):
            await asyncio.to_thread(control.set_baud, 2**32 - 1)
        assert control.baud == 38400
        await asyncio.to_thread(control.set_break, True)
        await asyncio.to_thread(control.set_break, False)


async def test_a_socket_has_no_settings_of_a_serial_port() -> None:
    async with rig("tcp") as each:
        assert isinstance(each.transport, Controllable) and each.transport.control is None
