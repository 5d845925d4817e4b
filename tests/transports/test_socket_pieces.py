"""Sockets: which hosts and errors are told how, the time for each address, and the blocking form for Windows."""

from __future__ import annotations

import asyncio
import errno
import gc
import os
import socket
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from multidrop.transports import Unreachable, sockets
from multidrop.transports.pipe import DescriptorPipe
from multidrop.transports.sockets import (
    SocketDevice,
    SocketEndpoint,
    check,
    explain,
    exposed,
    host_port,
    open_tcp,
    open_udp,
    set_socket_options,
)
from multidrop.transports.threaded import ThreadedPipe
from tests.support.cases import for_each
from tests.support.until import PATIENCE, until

REMEDY = "check the address, its power and the network"
CLOSED = "closed by the other end; check its power and the network"
CUT = "the other end cut the connection; check its power and the network"
REFUSED = "nothing listens there (connection refused); check its power and the port's number"
SILENT = "the other end no longer replies; check its power and the network"
NO_NETWORK = "no route to that network; check the address and this machine's own network"


def of_windows(number: int, text: str = "in words") -> OSError:
    """An error as Python makes it there."""
    error = OSError(errno.EINVAL, text)
    error.winerror = number  # type: ignore[attr-defined]
    return error


# Words


@for_each(
    "host, reachable",
    [
        ("localhost", False),
        ("127.0.0.1", False),
        ("127.8.8.8", False),
        ("::1", False),
        ("0.0.0.0", True),
        ("::", True),
        ("10.0.0.5", True),
        ("fe80::1", True),
        ("press", True),
        ("localhost.example", True),
    ],
)
def test_only_a_loopback_address_is_out_of_the_networks_reach(host: str, reachable: bool) -> None:
    assert exposed(host) == reachable


@for_each("host, port, told", [("drive", 503, "drive:503"), ("10.0.0.5", 1, "10.0.0.5:1"), ("::1", 503, "[::1]:503")])
def test_a_place_is_written_as_in_a_url(host: str, port: int, told: str) -> None:
    assert host_port(host, port) == told


@for_each(
    "host, port, told",
    [
        ("drive", 1, ""),
        ("fe80::1%eth0", 65535, ""),
        ("", 503, "x: invalid host name"),
        ("a b", 503, "x: invalid host name"),
        *((f"a{sign}b", 503, "x: invalid host name") for sign in "/?#@[]"),
        ("drive", 0, "x: invalid port number 0; valid: 1 to 65535"),
        ("drive", -1, "x: invalid port number -1; valid: 1 to 65535"),
        ("drive", 65536, "x: invalid port number 65536; valid: 1 to 65535"),
        ("drive", 65537, "x: invalid port number 65537; valid: 1 to 65535"),
    ],
)
def test_a_host_or_a_port_that_cannot_be_is_refused(host: str, port: int, told: str) -> None:
    try:
        check("x", host, port)
    except Unreachable as refusal:
        assert str(refusal) == told
    else:
        assert told == ""


@for_each(
    "error, told",
    [
        (None, CLOSED),
        (OSError(errno.EPIPE, "Broken pipe"), CLOSED),
        (OSError(errno.ECONNREFUSED, ""), REFUSED),
        (OSError(errno.ECONNRESET, ""), CUT),
        (OSError(errno.ETIMEDOUT, ""), SILENT),
        (OSError(errno.EHOSTUNREACH, ""), f"no route to that host; {REMEDY}"),
        (OSError(errno.ENETUNREACH, ""), NO_NETWORK),
        (OSError(errno.EMFILE, "in other words"), os.strerror(errno.EMFILE)),
        (OSError(errno.EACCES, ""), os.strerror(errno.EACCES)),
        (OSError(10060, "of Windows' sockets"), "of Windows' sockets"),
        (OSError(10000, "of Windows' sockets"), "of Windows' sockets"),
        (OSError("in words"), "in words"),
        (
            socket.gaierror(-2, "Name or service not known"),
            "unknown host name; check the spelling, or give its address",
        ),
        (of_windows(64), CUT),
        (of_windows(1236), CUT),
        (of_windows(121), SILENT),
        (of_windows(1225), REFUSED),
        (of_windows(1231), NO_NETWORK),
        (of_windows(1232), f"no route to that host; {REMEDY}"),
        (of_windows(5), os.strerror(errno.EINVAL)),
    ],
)
def test_an_error_is_told_with_its_remedy(error: OSError | None, told: str) -> None:
    assert explain(error) == told


# Connecting


@pytest.mark.skipif(sys.platform != "linux", reason="not every system has all of them")
def test_a_dead_connection_is_noticed_in_five_seconds_and_little_waits_in_the_system() -> None:
    with socket.socket() as made:
        set_socket_options(made)
        found = {
            name: made.getsockopt(socket.IPPROTO_TCP, getattr(socket, name))
            for name in ("TCP_NODELAY", "TCP_KEEPIDLE", "TCP_KEEPINTVL", "TCP_KEEPCNT", "TCP_USER_TIMEOUT")
        }
        assert found == {
            "TCP_NODELAY": 1,
            "TCP_KEEPIDLE": 3,
            "TCP_KEEPINTVL": 1,
            "TCP_KEEPCNT": 5,
            "TCP_USER_TIMEOUT": 5000,
        }
        assert made.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
        assert made.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF) == 2 * 8192, "Linux doubles it"
        if sys.version_info >= (3, 12):
            assert made.getsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT) == 1024


class Net:
    """Addresses by host, and what a connection to an address does: an error, or a time in s (inf: for ever)."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        loop = asyncio.get_running_loop()
        self.hosts: dict[str, list[str] | OSError] = {}
        self.connects: dict[str, OSError | float] = {}
        self.asked: list[tuple[object, ...]] = []
        self.tried: list[tuple[float, str]] = []
        self.look_up_takes = 0.0
        patch.setattr(loop, "getaddrinfo", self.look_up)
        patch.setattr(loop, "sock_connect", self.connect)

    async def look_up(self, host: str, port: int, type: socket.SocketKind) -> list[Any]:
        self.asked.append((host, port, type))
        await asyncio.sleep(self.look_up_takes)
        found = self.hosts[host]
        if isinstance(found, OSError):
            raise found
        return [(socket.AF_INET, type, 0, "", (address, port)) for address in found]

    async def connect(self, made: socket.socket, address: tuple[str, int]) -> None:
        assert made.gettimeout() == 0.0, "it must not block the loop"
        self.tried.append((asyncio.get_running_loop().time(), address[0]))
        does = self.connects.get(address[0], 0.0)
        if isinstance(does, OSError):
            raise does
        await asyncio.sleep(does)


@pytest.fixture
def net(monkeypatch: pytest.MonkeyPatch) -> Callable[[], Net]:
    return lambda: Net(monkeypatch)


def descriptors() -> int:
    return len(os.listdir("/dev/fd")) if sys.platform != "win32" else 0


@pytest.mark.virtual
@for_each(
    "within, addresses, took, told, at",
    [
        (None, ["slow"], 5.0, f"no reply within 5 s; {REMEDY}", [0.0]),
        (0.5, ["slow"], 0.5, f"no reply within 0.5 s; {REMEDY}", [0.0]),
        (None, ["slow", "slow"], 5.0, f"no reply within 5 s; {REMEDY}", [0.0, 2.5]),
        (None, ["slow", "full"], 2.5, REFUSED, [0.0, 2.5]),
        (None, ["full", "odd"], 0.0, f"no route to that host; {REMEDY}", [0.0, 0.0]),
        (None, [], 0.0, f"no reply within 5 s; {REMEDY}", []),
    ],
)
async def test_each_address_gets_its_share_of_the_time_and_the_last_error_is_told(
    net: Callable[[], Net], within: float | None, addresses: list[str], took: float, told: str, at: list[float]
) -> None:
    here, loop = net(), asyncio.get_running_loop()
    here.hosts["drive"] = addresses
    here.connects = {
        "slow": 99.0,
        "full": OSError(errno.ECONNREFUSED, ""),
        "odd": OSError(errno.EHOSTUNREACH, ""),
    }
    before, began = descriptors(), loop.time()
    with pytest.raises(Unreachable) as caught:
        await open_tcp("drive", 503, within=within)
    assert str(caught.value) == f"tcp://drive:503: {told}"
    assert loop.time() - began == pytest.approx(took)
    assert [when - began for when, _ in here.tried] == [pytest.approx(each) for each in at]
    assert here.asked == [("drive", 503, socket.SOCK_STREAM)]
    assert descriptors() == before


@pytest.mark.virtual
async def test_the_first_address_that_accepts_is_used_in_time(net: Callable[[], Net]) -> None:
    here = net()
    here.hosts["drive"] = ["full", "slow", "near", "never asked"]
    here.connects = {"full": OSError(errno.ECONNREFUSED, ""), "slow": 99.0}
    transport = await open_tcp("drive", 503, "rfc2217", within=3.0)
    assert [address for _, address in here.tried] == ["full", "slow", "near"]
    assert (transport.name, transport.network) == ("rfc2217://drive:503", True)
    await transport.close()


@pytest.mark.virtual
@for_each(
    "error, told",
    [
        (
            socket.gaierror(-2, "Name or service not known"),
            "unknown host name; check the spelling, or give its address",
        ),
        (OSError(errno.ENETUNREACH, ""), NO_NETWORK),
    ],
)
async def test_a_host_that_is_not_found_is_asked_for_again_next_time(
    net: Callable[[], Net], error: OSError, told: str
) -> None:
    here = net()
    here.hosts["drive"] = error
    for _ in range(2):
        with pytest.raises(Unreachable) as caught:
            await open_tcp("drive", 503)
        assert str(caught.value) == f"tcp://drive:503: {told}"
    here.hosts["drive"] = ["near"]
    await (await open_tcp("drive", 503)).close()
    assert here.asked == [("drive", 503, socket.SOCK_STREAM)] * 3


@pytest.mark.virtual
async def test_a_look_up_that_takes_long_serves_all_who_wait_for_it_and_no_other_host(net: Callable[[], Net]) -> None:
    here = net()
    here.look_up_takes = 0.9
    here.hosts = {"drive": ["near"], "other": ["near"]}
    with pytest.raises(Unreachable, match=r"no reply within 0.5 s"):
        await open_tcp("drive", 503, within=0.5)
    found = await asyncio.gather(open_tcp("drive", 503), open_tcp("drive", 503), open_tcp("other", 503))
    assert [each[0] for each in here.asked] == ["drive", "other"]
    for each in found:
        await each.close()
    await (await open_udp("drive", 503)).close()
    assert here.asked[2:] == [("drive", 503, socket.SOCK_DGRAM)]


@pytest.mark.virtual
async def test_a_look_up_that_ends_when_nobody_waits_any_more_is_no_failure(net: Callable[[], Net]) -> None:
    here, loop, failures = net(), asyncio.get_running_loop(), list[object]()
    loop.set_exception_handler(lambda _, context: failures.append(context))
    here.look_up_takes, here.hosts["drive"] = 0.9, socket.gaierror(-2, "Name or service not known")
    for cancel in (False, True):
        with pytest.raises(Unreachable, match=r"no reply within 0.5 s"):
            await open_tcp("drive", 503, within=0.5)
        (look_up,) = asyncio.all_tasks() - {asyncio.current_task()}
        if cancel:  # as at the end of the program
            look_up.cancel()
        del look_up
        await asyncio.sleep(1)
        gc.collect()
        assert failures == [], "a person would see it as a defect"
    assert len(here.asked) == 2


@pytest.mark.virtual
async def test_a_connection_that_is_cancelled_leaves_no_socket(net: Callable[[], Net]) -> None:
    here, before = net(), descriptors()
    here.hosts["drive"], here.connects["far"] = ["far"], 99.0
    opening = asyncio.create_task(open_tcp("drive", 503))
    await asyncio.sleep(0.1)
    assert len(here.tried) == 1
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    assert descriptors() == before


# An open pipe


@pytest.fixture
def streams() -> Iterator[tuple[socket.socket, socket.socket]]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        near = socket.create_connection(listener.getsockname())
        far, _ = listener.accept()
    far.settimeout(PATIENCE)
    with near, far:
        yield near, far


@pytest.mark.fork
def test_what_has_not_been_confirmed_of_a_stream_is_counted_and_of_datagrams_nothing(
    streams: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sockets, "output_queue", lambda descriptor: 7 if descriptor == streams[0].fileno() else -1)
    endpoint = SocketEndpoint("tcp://drive:503", streams[0])
    assert (endpoint.fileno(), endpoint.unsent(), endpoint.drop()) == (streams[0].fileno(), 7, 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
        assert SocketEndpoint("udp://drive:503", datagrams).unsent() == 0
    monkeypatch.setattr("sys.platform", "win32")
    assert endpoint.unsent() == 0


def test_a_stream_is_read_a_piece_at_a_time_and_its_end_is_told(streams: tuple[socket.socket, socket.socket]) -> None:
    near, far = streams
    endpoint = SocketEndpoint("tcp://drive:503", near)
    far.sendall(b"x" * 10_000)
    read = [endpoint.read() or b"" for _ in range(2)]
    assert max(map(len, read)) <= 4096, "one flooded line must not delay all others"
    while sum(map(len, read)) < 10_000:
        read.append(endpoint.read() or b"")
    assert endpoint.write(b"PR P\r") == 5 and far.recv(99) == b"PR P\r"
    far.close()
    assert endpoint.read() is None
    assert endpoint.explain(None) == CLOSED


def test_a_datagram_is_read_whole_and_an_empty_one_is_no_end() -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with near, far:
        for kind in (SocketEndpoint, SocketDevice):
            endpoint = kind("udp://drive:503", near)
            far.send(b"x" * 9000)
            far.send(b"")
            assert (endpoint.read(), endpoint.read()) == (b"x" * 9000, b"")


@for_each("kind", [SocketEndpoint, SocketDevice])
def test_a_close_reads_what_has_arrived_so_that_the_other_end_gets_the_last_bytes(
    kind: type[SocketEndpoint] | type[SocketDevice],
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        near = socket.create_connection(listener.getsockname())
        far, _ = listener.accept()
    with far:
        far.settimeout(PATIENCE)
        endpoint = kind("tcp://drive:503", near)
        far.sendall(b"0" * 10_000)
        endpoint.write(b"\x1b")
        endpoint.close()
        assert near.fileno() == -1
        assert far.recv(9) == b"\x1b" and far.recv(9) == b"", "an abort would be an error, and could take the stop away"


async def test_on_windows_a_connection_is_served_by_threads(
    streams: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    for platform, kind in (("win32", ThreadedPipe), ("linux", DescriptorPipe)):
        if platform != sys.platform == "win32":
            continue
        with socket.create_server(("127.0.0.1", 0)) as listener, monkeypatch.context() as patched:
            patched.setattr("sys.platform", platform)
            port = listener.getsockname()[1]
            transport, data = await open_tcp("127.0.0.1", port), bytearray()
            far, _ = listener.accept()
            with far:
                far.settimeout(PATIENCE)
                assert isinstance(transport, kind)
                assert (transport.name, transport.network) == (f"tcp://127.0.0.1:{port}", True)
                transport.start(data.extend, lambda loss: None)
                transport.write(b"PR P\r\n")
                far.sendall(b"51200\r\n")
                await until(lambda data=data: data == b"51200\r\n")
                assert await asyncio.to_thread(far.recv, 99) == b"PR P\r\n"
                await transport.close()


class Slow:
    """A blocking socket that takes little, or nothing for a while, of each send."""

    def __init__(self, kind: socket.SocketKind, *takes: int) -> None:
        self.type, self._takes = kind, list(takes)
        self.sent: list[bytes] = []
        self.patience = 99.0
        self.closed: list[int] = []
        self.then: Callable[[], None] = lambda: None

    def settimeout(self, seconds: float) -> None:
        self.patience = seconds

    def recv(self, most: int) -> bytes:
        raise TimeoutError

    def send(self, data: bytes) -> int:
        takes = self._takes.pop(0)
        if not takes:
            self.then()
            raise TimeoutError
        self.sent.append(data[:takes])
        return takes

    def shutdown(self, how: int) -> None:
        self.closed.append(how)
        raise OSError(errno.ENOTCONN, "not connected")


def test_a_blocking_write_goes_on_until_all_has_left_or_it_is_cancelled() -> None:
    slow: Any = Slow(socket.SOCK_STREAM, 3, 0, 0, 2, 9)
    device = SocketDevice("tcp://drive:503", slow)
    assert slow.patience < 0.9, "a read that waits ends before a close gives up"
    assert (device.name, device.piece, device.abort()) == ("tcp://drive:503", 1024, 0)
    assert device.read() == b"", "nothing has come yet: that is no end"
    device.write(b"MR 51200\r")
    assert b"".join(slow.sent) == b"MR 51200\r"
    device.write(b"")
    stuck: Any = Slow(socket.SOCK_STREAM, 3, 0, 6)
    device = SocketDevice("tcp://drive:503", stuck)
    stuck.then = device.cancel
    device.write(b"MR 51200\r")
    assert (stuck.sent, stuck.closed) == ([b"MR "], [socket.SHUT_RDWR])
    device.write(b"PR P\r")
    assert stuck.sent == [b"MR "], "nothing leaves behind a cancel"
    datagrams: Any = Slow(socket.SOCK_DGRAM)
    assert SocketDevice("udp://drive:503", datagrams).piece == 0, "a write is one datagram"
