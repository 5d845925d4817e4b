"""TCP and UDP."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import socket
import sys
from typing import Any

from transports.base import Transport, Unreachable
from transports.threaded import ThreadedPipe

if sys.platform != "win32":
    from transports.descriptor import DescriptorPipe
    from transports.serial_posix import output_queue

CONNECT = 5.0
"""Seconds that connecting may take, name look-up and all addresses of a host together."""
_READ = 65536
_PIECE = 4096
"""Bytes of a stream a turn of the event loop: one flooded line must not hold up all others, and the keys."""
_PATIENCE = 0.5

_QUIET = 10
"""Seconds of silence after which the system asks the other end whether it is still there."""
_OPTIONS: tuple[tuple[int, str, int], ...] = (
    (socket.SOL_SOCKET, "SO_KEEPALIVE", 1),
    (socket.IPPROTO_TCP, "TCP_NODELAY", 1),
    (socket.IPPROTO_TCP, "TCP_KEEPIDLE", _QUIET),
    (socket.IPPROTO_TCP, "TCP_KEEPALIVE", _QUIET),  # what macOS calls TCP_KEEPIDLE
    (socket.IPPROTO_TCP, "TCP_KEEPINTVL", 3),
    (socket.IPPROTO_TCP, "TCP_KEEPCNT", 3),
    (
        socket.IPPROTO_TCP,
        "TCP_USER_TIMEOUT",
        20_000,
    ),  # ms; else unconfirmed bytes hide a pulled cable for 15 min
    # What the system took cannot be taken back, so it gets little: a stop stands behind it.
    (socket.SOL_SOCKET, "SO_SNDBUF", 8192),
    (socket.IPPROTO_TCP, "TCP_NOTSENT_LOWAT", 1024),
)

_WHY = {
    errno.ECONNREFUSED: "nothing listens there (connection refused); check its power and the port's number",
    errno.ECONNRESET: "the other end cut the connection; open it again",
    errno.EPIPE: "closed by the other end; open it again",
    errno.ETIMEDOUT: "the other end answers no more; check its power and the network, then open it again",
    errno.EHOSTUNREACH: "there is no way to that host; check the address, its power and the network",
    errno.ENETUNREACH: "there is no way to that network; check the address and this machine's own network",
}


async def open_tcp(host: str, port: int, scheme: str = "tcp") -> Transport:
    """Connect within 5 s; `scheme` is what its name begins with. Raises Unreachable."""
    name = f"{scheme}://{host_port(host, port)}"
    return _pipe(name, await _connected(name, host, port, socket.SOCK_STREAM))


async def open_udp(host: str, port: int) -> Transport:
    """A UDP socket to one other end: one `write` is one datagram. Sends nothing by itself. Raises Unreachable."""
    name = f"udp://{host_port(host, port)}"
    return _pipe(name, await _connected(name, host, port, socket.SOCK_DGRAM))


def host_port(host: str, port: int) -> str:
    """`host:port` as it stands in a URL."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def check(name: str, host: str, port: int) -> None:
    """Raises Unreachable where these can be no host and no port number."""
    if not host or set(host) & set("/?#@[] "):
        raise Unreachable(f"{name}: that is no host name")
    if not 0 < port < 65536:
        raise Unreachable(f"{name}: {port} is no port number; those are 1 to 65535")


def set_socket_options(connection: socket.socket) -> None:
    """No delays, little buffering, and a dead connection is noticed within 20 s, as far as the system can."""
    for level, option, value in _OPTIONS:
        number = getattr(socket, option, None)
        if number is not None:
            with contextlib.suppress(OSError):
                connection.setsockopt(level, number, value)


def explain(error: OSError | None) -> str:
    """Why a connection broke, or was not made, and what to do about it; None: it came to its end."""
    if error is None:
        return "closed by the other end; open it again"
    if isinstance(error, socket.gaierror):
        return "there is no host of that name; check the spelling, or give its address"
    return _WHY.get(error.errno or 0) or (os.strerror(error.errno) if error.errno else str(error))


async def _connected(name: str, host: str, port: int, kind: socket.SocketKind) -> socket.socket:
    check(name, host, port)
    try:
        async with asyncio.timeout(CONNECT):
            return await _first(host, port, kind)
    except TimeoutError:
        raise Unreachable(
            f"{name}: no answer within {CONNECT:g} s; check the address, its power and the network"
        ) from None
    except UnicodeError:
        raise Unreachable(f"{name}: that is no host name") from None
    except OSError as error:
        raise Unreachable(f"{name}: {explain(error)}") from error


async def _first(host: str, port: int, kind: socket.SocketKind) -> socket.socket:
    """The first address of the host that can be connected to. Each gets its share of the time."""
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(host, port, type=kind)
    failed: OSError = TimeoutError()
    for family, _, protocol, _, address in found:
        try:
            async with asyncio.timeout(CONNECT / len(found)):
                return await _socket(family, kind, protocol, address)
        except OSError as error:
            failed = error
    raise failed


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
    if sys.platform == "win32":
        return ThreadedPipe(SocketDevice(name, made))
    else:
        return DescriptorPipe(SocketEndpoint(name, made))


class _Socket:
    """What both forms share."""

    def __init__(self, name: str, made: socket.socket) -> None:
        self.name = name
        self._socket = made
        self._stream = made.type == socket.SOCK_STREAM

    def read(self) -> bytes | None:
        """What has come. Nothing is the end of a stream, but a datagram like any other."""
        data = self._socket.recv(_PIECE if self._stream else _READ)
        return data or (None if self._stream else b"")

    def explain(self, error: OSError | None) -> str:
        """One line for a person."""
        return explain(error)

    def close(self) -> None:
        """Close it. What came is read first, or the other end would see an abort and not an end."""
        with contextlib.suppress(OSError):
            self._socket.setblocking(False)
            while self._stream and self._socket.recv(_READ):
                pass
        self._socket.close()


class SocketEndpoint(_Socket):
    """A connected, non-blocking socket."""

    def fileno(self) -> int:
        """The descriptor."""
        return self._socket.fileno()

    def write(self, data: bytes | memoryview) -> int:
        """How much the system took."""
        return self._socket.send(data)

    def unsent(self) -> int:
        """What the other end has not confirmed yet."""
        if sys.platform == "win32":
            return 0
        else:
            return output_queue(self._socket.fileno()) if self._stream else 0

    def drop(self) -> int:
        """The system gives nothing back."""
        return 0


class SocketDevice(_Socket):
    """The same with blocking calls, for where descriptors cannot be watched."""

    def __init__(self, name: str, made: socket.socket) -> None:
        super().__init__(name, made)
        made.settimeout(_PATIENCE)
        self.piece = 1024 if self._stream else 0
        self._cancelled = False

    def read(self) -> bytes | None:
        """Wait for bytes, for a while."""
        try:
            return super().read()
        except TimeoutError:
            return b""

    def write(self, data: bytes) -> None:
        """Write all of it, however long the other end takes."""
        while data and not self._cancelled:
            with contextlib.suppress(TimeoutError):
                data = data[self._socket.send(data) :]

    def purge(self) -> None:
        """There is nobody to ask."""

    def abort(self) -> int:
        """The system gives nothing back."""
        return 0

    def cancel(self) -> None:
        """End a waiting read; a waiting write ends by itself soon after."""
        self._cancelled = True
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
