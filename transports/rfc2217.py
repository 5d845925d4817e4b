"""Serial ports of a device server, over the network (RFC 2217), through pyserial's client for it."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
from typing import cast

from serial import rfc2217

from transports.base import Transport, Unreachable
from transports.control import SerialControl
from transports.pipe import in_thread
from transports.sockets import check, explain, host_port, set_socket_options
from transports.threaded import ThreadedPipe

_PATIENCE = 1.0
_READ = 4096


async def open_rfc2217(host: str, port: int, baud: int = 9600) -> Transport:
    """Open the port that `host:port` serves, at `baud` bits/s, 8N1; takes about 0.35 s. Raises Unreachable."""
    name = f"rfc2217://{host_port(host, port)}"
    check(name, host, port)
    device = await in_thread(lambda: _open(name, baud), Rfc2217Device.close)
    return ThreadedPipe(device, device.control)


def _open(name: str, baud: int) -> Rfc2217Device:
    try:
        return Rfc2217Device(name, baud)
    except OSError as error:
        raise Unreachable(f"{name}: {_reason(error)}") from error
    except ValueError as error:
        raise Unreachable(f"{name}: invalid settings {baud} baud, 8N1 ({error})") from error


def _reason(error: OSError) -> str:
    """Reason for a person: pyserial's error has only a text, and the real error as its context."""
    met = error.__context__
    if isinstance(met, TimeoutError):
        return "no reply within 5 s; check the address, its power and the network"
    if isinstance(met, UnicodeError):
        return "invalid host name"
    if isinstance(met, OSError):
        return explain(met)
    text = str(error)
    if "does not seem to support" in text:
        return "the server does not support RFC 2217; if it passes bytes on unchanged, use tcp://"
    if "parameter change" in text or "timeout while waiting" in text:
        return "the server refuses the settings of the port (8N1 at this baud rate)"
    return text


class _Port(rfc2217.Serial):
    """pyserial's client, which leaves its socket open if the other end closed first."""

    def close(self) -> None:
        link = self.link
        super().close()
        if link is not None:
            link.close()

    @property
    def link(self) -> socket.socket | None:
        """The connection; None after it is closed."""
        return cast("socket.socket | None", vars(self).get("_socket"))

    @property
    def arrived(self) -> queue.Queue[bytes | None]:
        """Bytes that arrived, one by one; None is the end.

        pyserial's own `read` refuses to return what is left here once the connection has ended.
        """
        return cast("queue.Queue[bytes | None]", vars(self)["_read_buffer"])

    @property
    def alive(self) -> bool:
        """True if pyserial's reading thread still runs."""
        thread = cast("threading.Thread | None", vars(self)["_thread"])
        return thread is not None and thread.is_alive()


class Rfc2217Device:
    """One port of a device server. Opening blocks; raises what pyserial raises."""

    piece = 256

    def __init__(self, name: str, baud: int) -> None:
        self.name = name
        self._port = _Port(name, baud)
        self.control = SerialControl(self._port)
        self._ended = False
        link = self._port.link
        if link is not None:
            set_socket_options(link)

    def read(self) -> bytes | None:
        """Wait up to a second for the first byte, then take all that arrived."""
        if self._ended:
            return None
        data = bytearray()
        try:
            first = self._port.arrived.get(timeout=_PATIENCE)
            while first is not None:
                data += first
                if len(data) >= _READ:
                    return bytes(data)
                first = self._port.arrived.get_nowait()
            self._ended = True
        except queue.Empty:
            self._ended = not data and not self._port.alive
        return bytes(data) or (None if self._ended else b"")

    def write(self, data: bytes) -> None:
        """Write all bytes; pyserial doubles IAC."""
        self._port.write(data)

    def purge(self) -> None:
        """Tell the server to drop what it has not sent; do not wait for its confirmation."""
        self._port.rfc2217_send_subnegotiation(rfc2217.PURGE_DATA, rfc2217.PURGE_TRANSMIT_BUFFER)

    def abort(self) -> int:
        """Return 0: the system gives nothing back."""
        return 0

    def cancel(self) -> None:
        """End a `read` and a `write` that wait."""
        link = self._port.link
        if link is not None:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)

    def explain(self, error: OSError | None) -> str:
        """Reason of a break in one line for a person."""
        met = error.__context__ if error else None
        return explain(met if isinstance(met, OSError) else error)

    def close(self) -> None:
        """Close the port; takes 0.3 s."""
        self._port.close()
