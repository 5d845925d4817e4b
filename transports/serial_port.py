"""Serial ports and pseudo-terminals: 8 data bits, no parity, 1 stop bit, no flow control, exclusive use.

pyserial opens and configures a port. On systems with termios it is a descriptor; elsewhere its calls block, in threads.
Without `open_serial` no event loop is imported: `multidrop relay` needs none.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shlex
import sys
from collections.abc import Callable
from typing import TypeVar

import serial

from multidrop.transports import PortControl, Transport, Unreachable
from multidrop.transports.port_users import TERMINALS, beside, holder, in_use, taker
from multidrop.transports.serial_ports import com_name, present

if sys.platform != "win32":
    import fcntl
    import grp
    import pwd
    import termios

    from multidrop.transports import output_queue

    _REFUSALS: tuple[type[Exception], ...] = (ValueError, OverflowError, termios.error)
else:
    from multidrop.transports.port_users import mark

    _REFUSALS = (ValueError, OverflowError)

T = TypeVar("T")
_PIECE = 256
_PATIENCE = 0.5
"""Seconds after which a waiting read checks for its end: a cancel between two reads would be lost."""
_STUCK = 10.0
"""Seconds after which a port that takes no byte is lost, where a write waits: 256 bytes at 300 baud take 8.5 s."""
_READ_BYTES = 4096
_GONE = "the port is gone (unplugged, or its other side closed it); plug it in"


async def open_serial(port: str, baud: int = 9600) -> Transport:
    """Open a port by its name or path, at `baud` bits/s, and drop stale input. Raises Unreachable."""
    if baud < 1:
        raise Unreachable(f"{port}: invalid baud rate {baud}; give one such as 9600")
    from multidrop.transports.pipe import in_thread
    from multidrop.transports.threaded import ThreadedPipe, closing

    if sys.platform == "win32":
        if com_name(port) in closing:
            why = "is still being closed: its driver does not return; unplug it, or end multidrop"
            raise Unreachable(f"{port} {why}")
        device = await in_thread(lambda: opened(SerialDevice, port, baud), SerialDevice.close)
        return ThreadedPipe(device, device.control)
    else:
        endpoint = await in_thread(lambda: opened(SerialEndpoint, port, baud), SerialEndpoint.close)
        from multidrop.transports.serial_pipe import SerialPipe

        return SerialPipe(endpoint, endpoint.control, endpoint.other_user)


def opened(kind: Callable[[str, int], T], port: str, baud: int) -> T:
    """Open a port by one of the classes for it. Raises Unreachable with the reason and the remedy."""
    try:
        return kind(port, baud)
    except OSError as error:
        raise open_error(port, error) from error
    except (ValueError, OverflowError) as error:
        raise Unreachable(f"{port}: cannot be set to {baud} baud ({error})") from error


def open_error(port: str, error: OSError) -> Unreachable:
    """Make the reason and the remedy from the error that pyserial raised on opening a port."""
    why = _why_on_windows(port, str(error)) if sys.platform == "win32" else _why(port, error)
    return Unreachable(why or f"{port} could not be opened: {error.strerror or error}")


def _why(port: str, error: OSError) -> str:
    number = error.errno
    if number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK):
        return f"{port} is in use by {in_use(port)}"
    if number in (errno.EACCES, errno.EPERM):
        return f"no permission to open {port}; {_permission(port)}"
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR):
        return _nothing(port)
    if number in (errno.EISDIR, errno.ENOTTY) or "configure" in str(error):
        return f"{port} is not a serial port, or has no hardware; see `multidrop ports`"
    return f"{port} could not be opened: {os.strerror(number)}" if number else ""


_WINDOWS = {
    **dict.fromkeys((2, 3, 433, 1167), ""),
    **dict.fromkeys((5, 32), "is in use by another program; close it there"),
    **dict.fromkeys((22, 31, 1117), "does not work (its driver says so); plug it out and in"),
    121: "does not answer: the device at its other end is off, or out of reach (Bluetooth)",
    87: "is not a serial port, or refuses a setting; see `multidrop ports`",
}
"""The reasons by error number of Windows; empty: the port is not there."""


def _why_on_windows(port: str, text: str) -> str:
    """Reason on Windows, where pyserial gives the error's number only in its text: `(13, 'in words', None, 5)`."""
    number = re.search(r"None, ([0-9]+)\)", text)
    why = _WINDOWS.get(int(number[1])) if number else None
    return "" if why is None else f"{port} {why}" if why else _nothing(port)


def _nothing(port: str) -> str:
    return f"no port {port}; plug it in, or see `multidrop ports`{taker()}"


USUAL_GROUP = "dialout"
"""The group of serial ports in most distributions."""


def _permission(port: str) -> str:
    """The remedy for a port that this account may not open: it depends on the owner, the group and the mode."""
    usual = f"`sudo usermod -aG {USUAL_GROUP} $USER`, then log in again"
    if sys.platform == "win32":
        return usual
    try:
        facts = os.stat(port)
    except OSError:
        return usual
    mode, name = facts.st_mode & 0o777, _group_name(facts.st_gid)
    rule = f"a udev rule with GROUP={USUAL_GROUP!r}, MODE='0660' lets that group use it"
    shown, group = f"its mode is {mode:04o}", shlex.quote(name)
    if facts.st_uid == os.geteuid():
        if mode & 0o600 == 0o600:
            return f"you own it, and {shown}: {ELSEWHERE}"
        return f"you own it, and {shown}: `chmod u+rw {shlex.quote(port)}`"
    if mode & 0o060 != 0o060 or facts.st_gid == 0:
        who = f"group {name}, {shown}" if mode & 0o060 != 0o060 else f"it is of the group {name} only"
        return f"{who}, so no other group helps: {rule}"
    if facts.st_gid in (os.getegid(), *os.getgroups()):
        return f"you are in its group {name}, which may use it: {ELSEWHERE}"
    if _is_member(facts.st_gid):
        return f"you are in its group {name}, but this login began before that: log out and in again"
    return f"`sudo usermod -aG {group} $USER`, then log in again"


ELSEWHERE = "something else refuses it (a container, SELinux, or another program that has it for itself)"


def _group_name(number: int) -> str:
    if sys.platform != "win32":
        with contextlib.suppress(KeyError):
            return grp.getgrgid(number).gr_name
    return str(number)


def _is_member(number: int) -> bool:
    """Whether the list of groups has this account, even if this login does not."""
    if sys.platform != "win32":
        with contextlib.suppress(KeyError):
            account = pwd.getpwuid(os.geteuid())
            return account.pw_name in grp.getgrgid(number).gr_mem or account.pw_gid == number
    return False


class SerialControl(PortControl):
    """The settings of one open port, through pyserial."""

    def __init__(self, port: serial.SerialBase) -> None:
        self._port = port
        self.baud = int(port.baudrate)

    def set_baud(self, baud: int) -> None:
        before = self._port.baudrate
        try:
            self._set("baudrate", baud)
        except OSError:
            with contextlib.suppress(OSError):
                self._set("baudrate", before)
            raise
        self.baud = int(self._port.baudrate)

    def _switch(self, line: str, on: bool) -> None:
        self._set({"DTR": "dtr", "RTS": "rts", "break": "break_condition"}[line], on)

    def _set(self, name: str, value: int) -> None:
        try:
            setattr(self._port, name, value)
        except _REFUSALS as error:
            raise OSError(*error.args) from error


class SerialDevice:
    """A port through pyserial's blocking calls, for systems that cannot watch a descriptor."""

    piece: int = _PIECE

    def __init__(self, port: str, baud: int) -> None:
        self.name = com_name(present(port) or port)
        if sys.platform == "win32" and (other := holder(self.name)):  # Wine opens a port twice
            raise Unreachable(f"{self.name} is in use by {other}; close it there")
        self._port = serial.Serial(self.name, baud, timeout=_PATIENCE, write_timeout=_STUCK, exclusive=True)
        if sys.platform == "win32":
            self._mark = mark(self.name)
        self.control = SerialControl(self._port)

    def read(self) -> bytes | None:
        """Wait for the first byte, then take all that arrived."""
        try:
            return self._port.read(1) + self._port.read(self._port.in_waiting)
        except TypeError as error:  # a close took away what pyserial waits with
            raise OSError(*error.args) from error

    def write(self, data: bytes) -> None:
        try:
            self._port.write(data)
        except TypeError as error:
            raise OSError(*error.args) from error

    def abort(self) -> int:
        """Empty the driver's output queue; on Windows this also ends a waiting write."""
        with contextlib.suppress(OSError):
            held = int(self._port.out_waiting)
            self._port.reset_output_buffer()
            return held
        return 0

    def cancel(self) -> None:
        with contextlib.suppress(OSError):
            self._port.cancel_read()
            self._port.cancel_write()

    def explain(self, error: OSError | None) -> str:
        if isinstance(error, serial.SerialTimeoutException):
            return f"it has taken no byte for {_STUCK:g} s (does its adapter hang?); plug it out and in"
        why = f" ({error})" if error else ""
        return f"the port is gone (unplugged?); plug it in{why}"

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._port.close()
        if sys.platform == "win32":
            self._mark.close()


if sys.platform != "win32":

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
            # Shut out programs that ignore pyserial's advisory lock. A pseudo-terminal is not claimed: it keeps the
            # mark while its other side is open, so a killed program would leave a port that cannot be opened again.
            if not os.path.realpath(self.name).startswith(TERMINALS):
                self._exclusive(termios.TIOCEXCL)
            self.other_user = beside(port)
            """The program that has the port open as well, with the remedy; empty: none was known at the opening."""

        def _exclusive(self, request: int) -> None:
            with contextlib.suppress(OSError):
                fcntl.ioctl(self._descriptor, request)

        def fileno(self) -> int:
            return self._descriptor

        def read(self) -> bytes | None:
            """Bytes that arrived; None if the port was hung up."""
            return os.read(self._descriptor, _READ_BYTES) or None

        def write(self, data: bytes | memoryview) -> int:
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
            return _GONE if error is None or error.errno is None else f"{_GONE} ({error.strerror})"

        def close(self) -> None:
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
