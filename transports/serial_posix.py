"""A serial port as a descriptor, on systems with termios. pyserial opens and configures it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import sys
import termios
from pathlib import Path

import serial

from multidrop.transports.control import SerialControl

if sys.platform != "win32":
    from multidrop.transports.output_queue import output_queue

assert sys.platform != "win32"

_READ = 4096
_GONE = "the port is gone (unplugged, or its other side closed it); plug it in"


class SerialEndpoint:
    """The descriptor of an open port. Opening may block briefly; raises what pyserial raises."""

    def __init__(self, port: str, baud: int) -> None:
        self.name = port
        # The "inter byte timeout" of 0 is pyserial's way to VMIN=1: a read with nothing to read is then EAGAIN,
        # and an empty one can only mean that the line was hung up.
        try:  # pyserial passes on an error of termios, which is not an OSError, where a port goes at this moment
            self._port = serial.Serial(port, baud, timeout=0, exclusive=True, inter_byte_timeout=0)
        except termios.error as error:
            raise OSError(*error.args) from error
        self.control = SerialControl(self._port)
        self._descriptor: int = self._port.fileno()
        try:
            _ignore_breaks(self._descriptor)
        except termios.error as error:
            self._port.close()
            raise OSError(*error.args) from error
        self._claim()

    def _claim(self) -> None:
        """Shut out programs that ignore pyserial's advisory lock.

        A pseudo-terminal is not claimed: it keeps the mark while its other side is open, so a killed program would
        leave a port that cannot be opened again.
        """
        if not os.path.realpath(self.name).startswith("/dev/pts/"):
            self._exclusive(termios.TIOCEXCL)

    def _exclusive(self, request: int) -> None:
        with contextlib.suppress(OSError):
            fcntl.ioctl(self._descriptor, request)

    def fileno(self) -> int:
        """The descriptor."""
        return self._descriptor

    def read(self) -> bytes | None:
        """Bytes that arrived; None if the port was hung up."""
        return os.read(self._descriptor, _READ) or None

    def write(self, data: bytes | memoryview) -> int:
        """Write, and return how many bytes the driver took."""
        return os.write(self._descriptor, data)

    def unsent(self) -> int:
        """Bytes in the driver's output queue; always 0 for a pseudo-terminal."""
        return output_queue(self._descriptor)

    def drop(self) -> int:
        """Empty the driver's output queue."""
        held = self.unsent()
        with contextlib.suppress(termios.error):
            termios.tcflush(self._descriptor, termios.TCOFLUSH)
        return held

    def explain(self, error: OSError | None) -> str:
        """Reason of a break in one line for a person."""
        return _GONE if error is None or error.errno is None else f"{_GONE} ({error.strerror})"

    def close(self) -> None:
        """Close the port, after dropping what is stuck in the driver: the kernel would wait up to 30 s for it."""
        if self.unsent():
            self.drop()
        self._exclusive(termios.TIOCNXCL)
        with contextlib.suppress(OSError):
            self._port.close()


def _ignore_breaks(descriptor: int) -> None:
    """Clear BRKINT, which pyserial leaves as it was: a break on the line would empty both queues."""
    attributes = termios.tcgetattr(descriptor)
    if attributes[0] & termios.BRKINT:
        attributes[0] &= ~termios.BRKINT
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


def lock_owner(port: str) -> str:
    """The program that has locked this port, as `name (pid n)`; empty if unknown (only Linux reports it)."""
    try:
        node = os.stat(port)
        locks = Path("/proc/locks").read_text()
    except OSError:
        return ""
    place = f"{os.major(node.st_dev):02x}:{os.minor(node.st_dev):02x}:{node.st_ino}"
    for line in locks.splitlines():
        fields = line.split()
        if len(fields) > 5 and fields[1] == "FLOCK" and fields[5] == place and fields[4] != "0":
            return _program(int(fields[4]))
    return ""


def _program(pid: int) -> str:
    if pid == os.getpid():
        return "this program itself"
    try:
        return f"{Path(f'/proc/{pid}/comm').read_text().strip()} (pid {pid})"
    except OSError:
        return f"pid {pid}"
