"""The peculiarities of sockets: refusals, unknown hosts, datagrams, options, and the bytes before a loss."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import struct
import sys
from collections.abc import Iterator

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports import Unreachable, rfc2217, sockets
from multidrop.transports.pipe import DescriptorPipe
from multidrop.transports.rfc2217 import open_rfc2217
from multidrop.transports.sockets import open_tcp, open_udp
from tests.support.until import PATIENCE

pytestmark = pytest.mark.filterwarnings(r"ignore:set(Daemon|Name)\(\):DeprecationWarning")


class Ear:
    """Listens to one transport."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []
        self.lost: asyncio.Future[TransportLost] = asyncio.get_running_loop().create_future()

    async def loss(self) -> str:
        return str(await asyncio.wait_for(self.lost, PATIENCE))


@pytest.fixture
def closed_port() -> Iterator[int]:
    """A port that is taken and listens to nothing."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield taken.getsockname()[1]


@pytest.mark.parametrize(("number", "told"), [(1225, "nothing listens there"), (1231, "no route to that network")])
def test_errors_that_windows_alone_numbers_are_told_as_elsewhere(number: int, told: str) -> None:
    error = OSError(22, "Invalid argument")
    error.winerror = number  # type: ignore[attr-defined]
    assert sockets.explain(error).startswith(told)


async def test_a_refused_connection_says_where_and_why(closed_port: int) -> None:
    with pytest.raises(Unreachable, match=f"^tcp://127.0.0.1:{closed_port}: nothing listens there"):
        await open_tcp("127.0.0.1", closed_port)
    with pytest.raises(Unreachable, match=f"^rfc2217://127.0.0.1:{closed_port}: nothing listens there"):
        await open_rfc2217("127.0.0.1", closed_port, 9600)


@pytest.mark.parametrize("port", [0, -1, 65536])
async def test_a_number_that_is_no_port_is_refused(port: int) -> None:
    for opened in (open_tcp("127.0.0.1", port), open_udp("::1", port), open_rfc2217("127.0.0.1", port, 9600)):
        with pytest.raises(Unreachable, match="invalid port number"):
            await opened


@pytest.mark.parametrize("host", ["no such host", "nowhere.invalid", "a..b", "x" * 70, "", "a/b?c", "user@drive"])
async def test_a_host_that_cannot_be_is_refused_in_one_line(host: str) -> None:
    for opened in (open_tcp(host, 503), open_rfc2217(host, 503, 9600)):
        with pytest.raises(Unreachable, match="host") as caught:
            await opened
        assert "\n" not in str(caught.value)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse when the backlog is full")
async def test_a_host_that_does_not_answer_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sockets, "CONNECT", 0.2)
    with contextlib.ExitStack() as stack:
        deaf = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        for _ in range(3):
            filler = stack.enter_context(socket.socket())
            filler.setblocking(False)
            filler.connect_ex(deaf.getsockname())
        with pytest.raises(Unreachable, match=r"no reply within 0.2 s"):
            await open_tcp(*deaf.getsockname())


async def test_a_second_address_of_a_host_is_tried(monkeypatch: pytest.MonkeyPatch, closed_port: int) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        both = [
            (socket.AF_INET, socket.SOCK_STREAM, 0, "", ("127.0.0.1", port))
            for port in (closed_port, listener.getsockname()[1])
        ]

        async def look_up(*_: object, **__: object) -> object:
            return both

        monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", look_up)
        await (await open_tcp("drive", 503)).close()


async def test_a_name_server_that_is_silent_is_asked_once_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look-up holds a thread; a line that is tried again for hours must not hold them all."""
    asked = []

    async def look_up(*_: object, **__: object) -> object:
        asked.append(1)
        await asyncio.sleep(60)
        return []

    monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", look_up)
    for _ in range(3):
        with pytest.raises(Unreachable, match="no reply within 0.05 s"):
            await open_tcp("drive", 503, within=0.05)
    assert len(asked) == 1


async def test_a_tcp_connection_sends_at_once_and_keeps_little_in_the_system() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        transport = await open_tcp(*listener.getsockname())
        device = "_device" if sys.platform == "win32" else "_endpoint"
        inner: socket.socket = getattr(transport, device)._socket
        assert inner.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        assert inner.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        assert inner.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF) <= 2 * 8192
        await transport.close()


async def test_names_are_urls() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
        far.bind(("127.0.0.1", 0))
        transport = await open_udp("127.0.0.1", far.getsockname()[1])
        assert transport.name == f"udp://127.0.0.1:{far.getsockname()[1]}"
        await transport.close()
    assert sockets.host_port("fe80::1", 503) == "[fe80::1]:503"


async def test_each_udp_write_is_one_datagram_and_an_empty_one_is_no_end() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
        far.bind(("127.0.0.1", 0))
        far.settimeout(PATIENCE)
        transport, ear = await open_udp(*far.getsockname()), Ear()
        transport.start(ear.heard.append, ear.lost.set_result)
        for line in (b"PR P\n", b"PR V\n", b""):
            transport.write(line)
        assert [(await asyncio.to_thread(far.recvfrom, 99))[0] for _ in range(2)] == [b"PR P\n", b"PR V\n"]
        transport.write(b"?")
        _, address = await asyncio.to_thread(far.recvfrom, 99)
        far.sendto(b"", address)
        far.sendto(b"0\r\n", address)
        async with asyncio.timeout(PATIENCE):
            while not ear.heard:
                await asyncio.sleep(0.001)
        assert ear.heard == [b"0\r\n"] and not ear.lost.done()
        await transport.close()


@pytest.mark.wine("its datagram sockets do not tell that nobody listens")
async def test_udp_to_where_nothing_listens_is_lost() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        place = taken.getsockname()
    transport, ear = await open_udp(*place), Ear()
    transport.start(ear.heard.append, ear.lost.set_result)
    transport.write(b"PR P\r")
    assert "nothing listens there" in await ear.loss()
    await transport.close()


async def test_a_reset_is_a_loss() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        transport, ear = await open_tcp(*listener.getsockname()), Ear()
        transport.start(ear.heard.append, ear.lost.set_result)
        client, _ = listener.accept()
        client.setsockopt(
            socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("HH" if sys.platform == "win32" else "ii", 1, 0)
        )
        client.close()
        assert "cut the connection" in await ear.loss()
        await transport.close()


@pytest.mark.fork
async def test_when_a_write_finds_the_pipe_broken_what_had_come_is_delivered_first() -> None:
    near, far = socket.socketpair()
    near.setblocking(False)
    transport, ear = DescriptorPipe(sockets.SocketEndpoint("tcp://drive:503", near)), Ear()
    transport.start(ear.heard.append, ear.lost.set_result)
    far.sendall(b"last words")
    far.close()
    transport.write(b"PR P\r")  # fails at once; the reader had no turn yet
    assert not ear.lost.done()
    assert "closed by the other end" in await ear.loss()
    assert ear.heard == [b"last words"]
    await transport.close()


@pytest.mark.fork
async def test_a_pipe_that_broke_before_its_start_says_so_then() -> None:
    near, far = socket.socketpair()
    near.setblocking(False)
    transport, ear = DescriptorPipe(sockets.SocketEndpoint("tcp://drive:503", near)), Ear()
    far.close()
    transport.write(b"PR P\r")
    await asyncio.sleep(0)
    transport.start(ear.heard.append, ear.lost.set_result)
    assert "closed by the other end" in await ear.loss()
    await transport.close()


async def test_unsent_datagrams_are_dropped_by_discard() -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)  # UDP itself never fills up on one machine
    near.setblocking(False)
    far.setblocking(False)
    transport, ear = DescriptorPipe(sockets.SocketEndpoint("udp://drive:503", near)), Ear()
    transport.start(ear.heard.append, ear.lost.set_result)
    for _ in range(5000):
        transport.write(b"PR P\r")
    dropped = transport.discard()
    assert dropped > 0 and dropped % 5 == 0
    arrived = 0
    with contextlib.suppress(BlockingIOError):
        while far.recv(99) == b"PR P\r":
            arrived += 5
    assert arrived + dropped == 25_000
    await transport.close()
    far.close()


async def test_a_server_that_does_not_speak_rfc2217_is_told_from_one_that_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rfc2217, "CONFIRM", 0.05)
    refused = pytest.raises(Unreachable, match="does not support RFC 2217; .* use tcp://")
    with socket.create_server(("127.0.0.1", 0)) as listener, refused:
        await open_rfc2217("127.0.0.1", listener.getsockname()[1], 9600)
