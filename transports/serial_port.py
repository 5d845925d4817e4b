"""Serial ports and pseudo-terminals: 8 data bits, no parity, 1 stop bit, no flow control, exclusive use."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import serial

from transports.base import Transport, Unreachable
from transports.control import SerialControl
from transports.pipe import in_thread
from transports.threaded import ThreadedPipe

if sys.platform != "win32":
    from transports.descriptor import DescriptorPipe
    from transports.serial_posix import SerialEndpoint, lock_owner

_PIECE = 256
_PATIENCE = 0.5
"""Seconds after which a waiting read checks for its end: a cancel between two reads would be lost."""

T = TypeVar("T")


async def open_serial(port: str, baud: int = 9600) -> Transport:
    """Open a port by its name or path, at `baud` bits/s, and drop stale input. Raises Unreachable."""
    if baud < 1:
        raise Unreachable(f"{port}: invalid baud rate {baud}; give one such as 9600")
    if sys.platform == "win32":
        device = await in_thread(lambda: _open(SerialDevice, port, baud), SerialDevice.close)
        return ThreadedPipe(device, device.control)
    else:
        endpoint = await in_thread(lambda: _open(SerialEndpoint, port, baud), SerialEndpoint.close)
        return DescriptorPipe(endpoint, endpoint.control)


def _open(kind: Callable[[str, int], T], port: str, baud: int) -> T:
    try:
        return kind(port, baud)
    except OSError as error:
        raise open_error(port, error) from error
    except (ValueError, OverflowError) as error:
        raise Unreachable(f"{port}: cannot be set to {baud} baud ({error})") from error


class SerialDevice:
    """A port through pyserial's blocking calls, for systems that cannot watch a descriptor."""

    piece = _PIECE

    def __init__(self, port: str, baud: int) -> None:
        self.name = port
        self._port = serial.Serial(port, baud, timeout=_PATIENCE, exclusive=True)
        self.control = SerialControl(self._port)

    def read(self) -> bytes | None:
        """Wait for the first byte, then take all that arrived."""
        return self._port.read(1) + self._port.read(self._port.in_waiting)

    def write(self, data: bytes) -> None:
        """Write all bytes."""
        self._port.write(data)

    def purge(self) -> None:
        """Do nothing: the other end has no command for it."""

    def abort(self) -> int:
        """Empty the driver's output queue; on Windows this also ends a waiting write."""
        with contextlib.suppress(OSError):
            held = int(self._port.out_waiting)
            self._port.reset_output_buffer()
            return held
        return 0

    def cancel(self) -> None:
        """End a `read` and a `write` that wait."""
        with contextlib.suppress(OSError):
            self._port.cancel_read()
            self._port.cancel_write()

    def explain(self, error: OSError | None) -> str:
        """Reason of a break in one line for a person."""
        why = f" ({error})" if error else ""
        return f"the port is gone (unplugged?); plug it in{why}"

    def close(self) -> None:
        """Close the port."""
        with contextlib.suppress(OSError):
            self._port.close()


def open_error(port: str, error: OSError) -> Unreachable:
    """Make the reason and the remedy from the error that pyserial raised on opening a port."""
    why = _why_on_windows(port, str(error)) if sys.platform == "win32" else _why(port, error)
    return Unreachable(why or f"{port} could not be opened: {error.strerror or error}")


def _why(port: str, error: OSError) -> str:
    number = error.errno
    if number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK):
        return f"{port} is in use by {_owner(port)}; close it there"
    if number in (errno.EACCES, errno.EPERM):
        return f"no permission to open {port}; `sudo usermod -aG {_group(port)} $USER`, then log in again"
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR):
        return _nothing(port)
    if number in (errno.EISDIR, errno.ENOTTY) or "configure" in str(error):
        return f"{port} is not a serial port, or has no hardware; see `multidrop ports`"
    return f"{port} could not be opened: {os.strerror(number)}" if number else ""


def _why_on_windows(port: str, text: str) -> str:
    """Reason on Windows, where pyserial gives no number but only the text of the error."""
    if "PermissionError" in text:
        return f"{port} is in use by another program; close it there"
    return _nothing(port) if "FileNotFoundError" in text else ""


def _nothing(port: str) -> str:
    return f"no port {port}; plug it in, or see `multidrop ports`"


def _owner(port: str) -> str:
    if sys.platform == "win32":
        return "another program"
    else:
        return lock_owner(port) or "another program"


def _group(port: str) -> str:
    """The group that may use a port; most distributions call it `dialout`."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError, KeyError):
            owner = Path(port).group()
            return owner if owner != "root" else "dialout"
    return "dialout"
