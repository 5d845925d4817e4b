"""The settings of a serial port that change while it is open, through pyserial: baud rate, DTR, RTS, break.

A call may block, as a server of RFC 2217 has to confirm it; so it is made in a thread. Each raises OSError where the
port does not have the setting or refuses the value.
"""

from __future__ import annotations

import contextlib
import sys

import serial

if sys.platform != "win32":
    import termios

    _REFUSALS: tuple[type[Exception], ...] = (ValueError, OverflowError, termios.error)
else:
    _REFUSALS = (ValueError, OverflowError)


class SerialControl:
    """The settings of one open port."""

    def __init__(self, port: serial.SerialBase) -> None:
        self._port = port

    @property
    def baud(self) -> int:
        """The baud rate, bits/s, also of a port that is closed by now."""
        return int(self._port.baudrate)

    def set_baud(self, baud: int) -> None:
        """Change the baud rate; a refused one leaves the present one."""
        before = self._port.baudrate
        try:
            self._set("baudrate", baud)
        except OSError:
            with contextlib.suppress(OSError):
                self._set("baudrate", before)
            raise

    def set_dtr(self, on: bool) -> None:
        """Switch the DTR line."""
        self._set("dtr", on)

    def set_rts(self, on: bool) -> None:
        """Switch the RTS line."""
        self._set("rts", on)

    def set_break(self, on: bool) -> None:
        """Begin or end a break."""
        self._set("break_condition", on)

    def _set(self, name: str, value: int) -> None:
        try:
            setattr(self._port, name, value)
        except _REFUSALS as error:
            raise OSError(*error.args) from error
