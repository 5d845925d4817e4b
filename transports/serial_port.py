"""Serial ports and pseudo-terminals: 8 data bits, no parity, 1 stop bit, no flow control, exclusive use."""

from __future__ import annotations

import contextlib
import sys

import serial

from multidrop.transports.base import Transport, Unreachable
from multidrop.transports.control import SerialControl
from multidrop.transports.pipe import in_thread
from multidrop.transports.serial_open import opened
from multidrop.transports.threaded import ThreadedPipe

if sys.platform != "win32":
    from multidrop.transports.descriptor import DescriptorPipe
    from multidrop.transports.serial_posix import SerialEndpoint

_PIECE = 256
_PATIENCE = 0.5
"""Seconds after which a waiting read checks for its end: a cancel between two reads would be lost."""


async def open_serial(port: str, baud: int = 9600) -> Transport:
    """Open a port by its name or path, at `baud` bits/s, and drop stale input. Raises Unreachable."""
    if baud < 1:
        raise Unreachable(f"{port}: invalid baud rate {baud}; give one such as 9600")
    if sys.platform == "win32":
        device = await in_thread(lambda: opened(SerialDevice, port, baud), SerialDevice.close)
        return ThreadedPipe(device, device.control)
    else:
        endpoint = await in_thread(lambda: opened(SerialEndpoint, port, baud), SerialEndpoint.close)
        return DescriptorPipe(endpoint, endpoint.control)


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
