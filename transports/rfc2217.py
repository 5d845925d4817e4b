"""Serial ports of a device server, over the network (RFC 2217), through pyserial's client for it."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
from typing import cast

from serial import rfc2217

from transports.base import Transport, Unreachable
from transports.pipe import in_thread
from transports.sockets import check, explain, host_port, set_socket_options
from transports.threaded import ThreadedPipe

_PATIENCE = 1.0
_READ = 4096


async def open_rfc2217(host: str, port: int, baud: int = 9600) -> Transport:
    """Open the port behind `host:port` at `baud` bits a second, 8N1, in about 0.35 s. Raises Unreachable."""
    name = f"rfc2217://{host_port(host, port)}"
    check(name, host, port)
    device = await in_thread(lambda: _open(name, baud), Rfc2217Device.close)
    return ThreadedPipe(device)


def _open(name: str, baud: int) -> Rfc2217Device:
    try:
        return Rfc2217Device(name, baud)
    except OSError as error:
        raise Unreachable(f"{name}: {_reason(error)}") from error
    except ValueError as error:
        raise Unreachable(f"{name}: it does not take these settings, {baud} baud, 8N1 ({error})") from error


def _reason(error: OSError) -> str:
    """What pyserial met stands behind its error, which itself is only a text."""
    met = error.__context__
    if isinstance(met, TimeoutError):
        return "no answer within 5 s; check the address, its power and the network"
    if isinstance(met, UnicodeError):
        return "that is no host name"
    if isinstance(met, OSError):
        return explain(met)
    text = str(error)
    if "does not seem to support" in text:
        return "it does not speak RFC 2217; if it passes bytes on as they are, use tcp://"
    if "parameter change" in text or "timeout while waiting" in text:
        return "it does not accept the settings of the port (8N1 at this baud rate)"
    return text


class _Port(rfc2217.Serial):
    """pyserial's client, which forgets to close its socket when the other end was first to go."""

    def close(self) -> None:
        link = self.link
        super().close()
        if link is not None:
            link.close()

    @property
    def link(self) -> socket.socket | None:
        """The connection; None when it is closed."""
        return cast("socket.socket | None", vars(self).get("_socket"))

    @property
    def arrived(self) -> queue.Queue[bytes | None]:
        """What came, a byte at a time; None is the end.

        Its own `read` refuses to give what is still in here once the connection has ended.
        """
        return cast("queue.Queue[bytes | None]", vars(self)["_read_buffer"])

    @property
    def alive(self) -> bool:
        """Whether its own reading thread still runs."""
        thread = cast("threading.Thread | None", vars(self)["_thread"])
        return thread is not None and thread.is_alive()


class Rfc2217Device:
    """One port of a device server. Opening blocks; raises what pyserial raises."""

    piece = 256

    def __init__(self, name: str, baud: int) -> None:
        self.name = name
        self._port = _Port(name, baud)
        self._ended = False
        link = self._port.link
        if link is not None:
            set_socket_options(link)

    def read(self) -> bytes | None:
        """Wait for the first byte, for a while, then take what there is."""
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
        """Write all of it; IAC is doubled on the way."""
        self._port.write(data)

    def purge(self) -> None:
        """Have the server drop what it has not sent; its confirmation is not waited for."""
        self._port.rfc2217_send_subnegotiation(rfc2217.PURGE_DATA, rfc2217.PURGE_TRANSMIT_BUFFER)

    def abort(self) -> int:
        """The system gives nothing back."""
        return 0

    def cancel(self) -> None:
        """End a waiting read and write."""
        link = self._port.link
        if link is not None:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)

    def explain(self, error: OSError | None) -> str:
        """One line for a person."""
        met = error.__context__ if error else None
        return explain(met if isinstance(met, OSError) else error)

    def close(self) -> None:
        """Close it; takes 0.3 s."""
        self._port.close()
