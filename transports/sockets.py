"""TCP and UDP."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import socket
import sys
from ipaddress import ip_address
from typing import Any

from multidrop.transports import Transport, Unreachable
from multidrop.transports.threaded import ThreadedPipe


def exposed(host: str) -> bool:
    """True unless the host is a loopback address or localhost; an unknown name counts as reachable."""
    try:
        return host != "localhost" and not ip_address(host).is_loopback
    except ValueError:
        return True


if sys.platform != "win32":
    from multidrop.transports import output_queue
    from multidrop.transports.pipe import DescriptorPipe

CONNECT = 5.0
"""Greatest time in seconds to connect: name look-up and all addresses of a host together."""
_READ_BYTES = 65536
_PIECE = 4096
"""Bytes of a stream per turn of the event loop: one flooded line must not delay all others, and the keys."""
_PATIENCE = 0.5

_QUIET = 3
"""Seconds of silence after which the system probes the other end, each second from then on."""
_UNCONFIRMED = 5
"""Seconds for which the other end's system may confirm nothing. A slow drive's system confirms what waits for it."""
_OPTIONS: tuple[tuple[int, str, int], ...] = (
    (socket.SOL_SOCKET, "SO_KEEPALIVE", 1),
    (socket.IPPROTO_TCP, "TCP_NODELAY", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPIDLE", _QUIET),
    (socket.IPPROTO_TCP, "TCP_KEEPALIVE", _QUIET),  # what macOS calls TCP_KEEPIDLE
    (socket.IPPROTO_TCP, "TCP_KEEPINTVL", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPCNT", _UNCONFIRMED),
    (socket.IPPROTO_TCP, "TCP_USER_TIMEOUT", _UNCONFIRMED * 1000),  # ms; else a pulled cable is hidden for 15 min
    # What the system took cannot be taken back, so it gets little: a stop follows it.
    (socket.SOL_SOCKET, "SO_SNDBUF", 8192),
    (socket.IPPROTO_TCP, "TCP_NOTSENT_LOWAT", 1024),
)

_WHY = {
    errno.ECONNREFUSED: "nothing listens there (connection refused); check its power and the port's number",
    errno.ECONNRESET: "the other end cut the connection; check its power and the network",
    errno.EPIPE: "closed by the other end; check its power and the network",
    errno.ETIMEDOUT: "the other end no longer replies; check its power and the network",
    errno.EHOSTUNREACH: "no route to that host; check the address, its power and the network",
    errno.ENETUNREACH: "no route to that network; check the address and this machine's own network",
}
_WINDOWS = {
    64: errno.ECONNRESET,
    121: errno.ETIMEDOUT,
    1225: errno.ECONNREFUSED,
    1231: errno.ENETUNREACH,
    1232: errno.EHOSTUNREACH,
    1236: errno.ECONNRESET,
}
"""Errors of Windows that Python gives no number of its own."""


async def open_tcp(host: str, port: int, scheme: str = "tcp", within: float | None = None) -> Transport:
    """Connect within a time, s, by default within 5; its name begins with `scheme`. Raises Unreachable."""
    name = f"{scheme}://{host_port(host, port)}"
    return _pipe(name, await connected(name, host, port, given=within))


async def open_udp(host: str, port: int) -> Transport:
    """Make a UDP socket to one other end: one `write` is one datagram. Sends nothing. Raises Unreachable."""
    name = f"udp://{host_port(host, port)}"
    return _pipe(name, await connected(name, host, port, socket.SOCK_DGRAM))


def host_port(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def check(name: str, host: str, port: int) -> None:
    """Raise Unreachable if the host name or the port number is invalid."""
    if not host or set(host) & set("/?#@[] "):
        raise Unreachable(f"{name}: invalid host name")
    if not 0 < port < 65536:
        raise Unreachable(f"{name}: invalid port number {port}; valid: 1 to 65535")


def set_socket_options(connection: socket.socket) -> None:
    """Set no delay, small buffers, and detection of a dead connection, where the system can.

    Linux notices it after 5 to 6 s, also on a silent line.
    """
    for level, option, value in _OPTIONS:
        number = getattr(socket, option, None)
        if number is not None:
            with contextlib.suppress(OSError):
                connection.setsockopt(level, number, value)


def explain(error: OSError | None) -> str:
    if error is None:
        return "closed by the other end; check its power and the network"
    if isinstance(error, socket.gaierror):
        return "unknown host name; check the spelling, or give its address"
    number = _WINDOWS.get(getattr(error, "winerror", None) or 0, error.errno or 0)
    known = number < 10000  # greater ones are of Windows' sockets, which `os.strerror` does not know
    return _WHY.get(number) or (os.strerror(number) if number and known else error.strerror or str(error))


async def connected(
    name: str,
    host: str,
    port: int,
    kind: socket.SocketKind = socket.SOCK_STREAM,
    given: float | None = None,
) -> socket.socket:
    """Connect within a time, s. Raises Unreachable, which begins with `name`."""
    within = given or CONNECT
    check(name, host, port)
    try:
        async with asyncio.timeout(within):
            return await _first(host, port, kind, within)
    except TimeoutError:
        raise Unreachable(
            f"{name}: no reply within {within:g} s; check the address, its power and the network"
        ) from None
    except UnicodeError:
        raise Unreachable(f"{name}: invalid host name") from None
    except OSError as error:
        raise Unreachable(f"{name}: {explain(error)}") from error


async def _first(host: str, port: int, kind: socket.SocketKind, within: float) -> socket.socket:
    """Connect to the first address of the host that accepts. Each gets its share of the time."""
    addresses = await _look_up(host, port, kind)
    failed: OSError = TimeoutError()
    for family, _, protocol, _, address in addresses:
        try:
            async with asyncio.timeout(within / len(addresses)):
                return await _socket(family, kind, protocol, address)
        except OSError as error:
            failed = error
    raise failed


async def _look_up(host: str, port: int, kind: socket.SocketKind) -> list[Any]:
    """Look a host up. This holds a thread until a name server replies, so it is never begun twice at a time."""
    loop = asyncio.get_running_loop()
    key = loop, host, port, kind
    if key not in _look_ups:
        _look_ups[key] = loop.create_task(loop.getaddrinfo(host, port, type=kind))
        _look_ups[key].add_done_callback(lambda task: (_look_ups.pop(key), task.cancelled() or task.exception()))
    return await asyncio.shield(_look_ups[key])


_look_ups: dict[tuple[asyncio.AbstractEventLoop, str, int, socket.SocketKind], asyncio.Task[list[Any]]] = {}


async def _socket(family: int, kind: socket.SocketKind, protocol: int, address: Any) -> socket.socket:
    made = socket.socket(family, kind, protocol)
    try:
        made.setblocking(False)
        if kind == socket.SOCK_STREAM:
            set_socket_options(made)
        await asyncio.get_running_loop().sock_connect(made, address)
    except BaseException:
        made.close()
        raise
    return made


def _pipe(name: str, made: socket.socket) -> Transport:
    pipe: Transport
    if sys.platform == "win32":
        pipe = ThreadedPipe(SocketDevice(name, made))
    else:
        pipe = DescriptorPipe(SocketEndpoint(name, made))
    pipe.network = True
    return pipe


class _Socket:
    """The common part of both forms."""

    def __init__(self, name: str, made: socket.socket) -> None:
        self.name = name
        self._socket = made
        self._stream = made.type == socket.SOCK_STREAM

    def read(self) -> bytes | None:
        """Bytes that arrived. An empty read is the end of a stream, but a valid datagram."""
        data = self._socket.recv(_PIECE if self._stream else _READ_BYTES)
        return data or (None if self._stream else b"")

    def explain(self, error: OSError | None) -> str:
        return explain(error)

    def close(self) -> None:
        """Read what arrived, and close: unread bytes would turn the close into an abort."""
        with contextlib.suppress(OSError):
            self._socket.setblocking(False)
            while self._stream and self._socket.recv(_READ_BYTES):
                pass
        self._socket.close()


class SocketEndpoint(_Socket):
    """A connected, non-blocking socket."""

    def fileno(self) -> int:
        return self._socket.fileno()

    def write(self, data: bytes | memoryview) -> int:
        return self._socket.send(data)

    def unsent(self) -> int:
        """Bytes that the other end has not confirmed yet."""
        if sys.platform == "win32":
            return 0
        else:
            return output_queue(self._socket.fileno()) if self._stream else 0

    def drop(self) -> int:
        return 0


class SocketDevice(_Socket):
    """A connected socket with blocking calls, for systems that cannot watch a descriptor."""

    def __init__(self, name: str, made: socket.socket) -> None:
        super().__init__(name, made)
        made.settimeout(_PATIENCE)
        self.piece = 1024 if self._stream else 0
        self._cancelled = False

    def read(self) -> bytes | None:
        """Wait for bytes for up to half a second."""
        try:
            return super().read()
        except TimeoutError:
            return b""

    def write(self, data: bytes) -> None:
        while data and not self._cancelled:
            with contextlib.suppress(TimeoutError):
                data = data[self._socket.send(data) :]

    def abort(self) -> int:
        return 0

    def cancel(self) -> None:
        """End a `read` that waits; a waiting write ends by itself soon after."""
        self._cancelled = True
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
