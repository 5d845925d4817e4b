"""A bus on a pseudo-terminal: a serial port that any terminal program opens by the name of a link.

The server keeps the client's end open itself, so that the pseudo-terminal lives without a client, and the client's
baud rate can be read from its settings. When the last client closes an ordinary serial port, the port forgets unread
bytes, the baud rate and exclusive use. So does this one; bytes that were written too fast for the wire are dropped some
seconds later. A client that flushes its output (tcflush) takes back what has not gone out at the wire's pace, as from a
serial port's buffer; packet mode reports that.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import select
import struct
import sys
import termios
import tty
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.simulator.serving.running import InputQueue, RunningFloor, ServedClient
from multidrop.simulator.wire import resample

# The number of clients that have a pseudo-terminal open, counted without polling.
#
# A simulator that holds both ends of a pseudo-terminal gets no signal when its client comes or goes. On Linux inotify
# reports it; elsewhere the number is unknown, and a client is assumed.


_OPEN, _CLOSE = 0x20, 0x08 | 0x10
_EVENT = struct.Struct("iIII")


class TtyWatch:
    """Counts the clients of a device file from now on. `fd` is readable when the count changes; None: unknown."""

    def __init__(self, path: str) -> None:
        self.fd = _watch(path)
        self._clients = 0

    def clients(self) -> int | None:
        """The number of clients now; None if it is unknown."""
        if self.fd is None:
            return None
        while True:
            try:
                data = os.read(self.fd, 4096)
            except BlockingIOError:
                return self._clients
            at = 0
            while at < len(data):
                _, mask, _, length = _EVENT.unpack_from(data, at)
                self._clients += bool(mask & _OPEN) - bool(mask & _CLOSE)
                at += _EVENT.size + length

    def deserted(self) -> bool:
        """Whether no client has it open. Quick to ask; the end of the last client may be seen a moment late."""
        return self._clients == 0 and self.clients() == 0

    def close(self) -> None:
        if self.fd is not None:
            os.close(self.fd)
            self.fd = None


def _watch(path: str) -> int | None:
    """Open an inotify descriptor for opens and closes of `path`; None if that is not possible."""
    if sys.platform != "linux":
        return None
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        fd: int = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, AttributeError):
        return None
    if fd < 0:
        return None
    if libc.inotify_add_watch(fd, os.fsencode(path), _OPEN | _CLOSE) < 0:
        os.close(fd)
        return None
    return fd


# The symlink to a pseudo-terminal: held by one server, never in place of a regular file.


assert sys.platform != "win32"


class PtyLink:
    """A link at a path. Raises Diagnostic if another server holds it. `where` names its bus in errors."""

    def __init__(self, path: Path, where: str) -> None:
        self.path, self._where = path, where
        self._lock_path = path.with_name(f".{path.name}.lock")
        self._lock = self._locked()

    def _locked(self) -> int:
        """Hold the link by a lock: the target of a stale link may belong to another program by now."""
        try:
            lock = os.open(self._lock_path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise self._cannot(error) from None
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            hint = "end the other multidrop sim, or use another path"
            raise Diagnostic(f"{self.path} is served already", self._where, hint) from None
        return lock

    def make(self, device: str) -> None:
        """Create the symlink, replacing a stale one; never overwrite a regular file. Raises Diagnostic."""
        link = self.path
        if not link.is_symlink() and link.exists():
            raise Diagnostic(f"{link} exists and is not a link", self._where, "remove it, or use another path")
        new = link.with_name(f".{link.name}.{os.getpid()}")
        try:
            new.unlink(missing_ok=True)
            new.symlink_to(device)
            new.replace(link)
        except OSError as error:
            raise self._cannot(error) from None

    def remove(self, device: str) -> None:
        if self.path.is_symlink() and os.readlink(self.path) == device:
            self.path.unlink(missing_ok=True)

    def release(self) -> None:
        """Let other servers use the link."""
        if self._lock >= 0:
            self._lock_path.unlink(missing_ok=True)
            os.close(self._lock)
            self._lock = -1

    def _cannot(self, error: OSError) -> Diagnostic:
        return Diagnostic(f"cannot make the link {self.path} ({error.strerror})", self._where)


assert sys.platform != "win32"

READ_SIZE = 4096
FLUSHED: int = termios.TIOCPKT_FLUSHWRITE
BAUDS: dict[int, int] = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()
}
FULL = contextlib.suppress(BlockingIOError)
"""The pseudo-terminal takes no more, or has nothing."""
SPEEDS = {baud: code for code, baud in BAUDS.items()}


class PtyServer(ServedClient):
    """Serves one bus on a pseudo-terminal, with a symlink at `link` if one is given. Raises Diagnostic."""

    gathers = True

    def __init__(self, floor: RunningFloor, bus: str, link: Path | None) -> None:
        self._floor, self._bus = floor, bus
        self._link = PtyLink(link, f'bus "{bus}"') if link else None
        self._queue = InputQueue(floor, bus, self)
        self._master = self._slave = -1
        self._watch: TtyWatch | None = None
        self._device = ""
        try:
            self._open()
        except Diagnostic:
            self._release()
            raise
        self._detach = floor.attach(bus, self)

    @property
    def endpoint(self) -> str:
        """`pty:` and the absolute path that a client opens."""
        return f"pty:{self._link.path.absolute() if self._link else self._device}"

    @property
    def _wire_baud(self) -> int:
        return self._floor.floor.wires[self._bus].baud

    # -- Listener -----------------------------------------------------------------------------------

    def receive(self, data: bytes) -> None:
        """Pass on what the wire sends; a client that does not read loses it, as on a serial line."""
        if self._watch is None or self._watch.deserted():
            return
        if self._wire_baud and (baud := self._client_baud()):
            data = resample(data, self._wire_baud, baud)
        with FULL:
            os.write(self._master, data)

    def unplugged(self) -> None:
        """Hang up the client's end and remove the link."""
        self._shut()

    def plugged(self) -> None:
        self._open()

    def close(self) -> None:
        self._queue.close()
        self._detach()
        self._shut()
        self._release()

    # -- the pseudo-terminal ------------------------------------------------------------------------

    def _open(self) -> None:
        self._master, self._slave = os.openpty()
        self._device = os.ttyname(self._slave)
        os.set_blocking(self._master, False)
        fcntl.ioctl(self._master, termios.TIOCPKT, struct.pack("i", 1))
        self._make_fresh()
        if self._link is not None:
            try:
                self._link.make(self._device)
            except Diagnostic:
                self._close_both()
                raise
        self._watch = TtyWatch(self._device)
        self.resume()
        if self._watch.fd is not None:
            self._floor.loop.add_reader(self._watch.fd, self._came_or_went)

    def _shut(self) -> None:
        if self._master < 0 or self._watch is None:
            return
        self._floor.loop.remove_reader(self._master)
        if self._watch.fd is not None:
            self._floor.loop.remove_reader(self._watch.fd)
        self._watch.close()
        self._watch = None
        if self._link is not None:
            self._link.remove(self._device)
        self._close_both()

    def _release(self) -> None:
        if self._link is not None:
            self._link.release()

    def _close_both(self) -> None:
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    # -- Client ----------------------------------------------------------------------------------

    def pause(self) -> None:
        """Leave what the client writes in the pseudo-terminal: the wire is slower."""
        if self._master >= 0:
            self._floor.loop.remove_reader(self._master)

    def resume(self) -> None:
        if self._master >= 0:
            self._floor.loop.add_reader(self._master, self._readable)

    def poll(self) -> None:
        """Read if there is something: a client that flushes its output does not wait."""
        if self._master >= 0 and select.select((), (), (self._master,), 0)[2]:
            self._readable()

    def _readable(self) -> None:
        with FULL:
            if data := self._read(max(1, self._queue.room)):
                self._queue.write(data, self._client_baud() if self._wire_baud else None)

    def _read(self, most: int) -> bytes:
        """Read what the client has written. In packet mode the first byte says whether the client takes it back."""
        packet = os.read(self._master, 1 + most)
        if packet[:1] and packet[0] & FLUSHED:
            self._queue.retract()
        return packet[1:]

    def has_left(self) -> bool:
        return self._watch is not None and self._watch.deserted()

    def discard(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._master >= 0:
                self._read(READ_SIZE)

    def _came_or_went(self) -> None:
        if self._watch is not None and self._watch.clients() == 0:
            self._make_fresh()

    def _make_fresh(self) -> None:
        """Reset it to the state of a port without a client: raw, the wire's baud rate, empty, not exclusive."""
        tty.setraw(self._slave)
        attributes = termios.tcgetattr(self._slave)
        speed = SPEEDS.get(self._wire_baud)
        if speed is not None:
            attributes[4] = attributes[5] = speed
        termios.tcsetattr(self._slave, termios.TCSANOW, attributes)
        termios.tcflush(self._slave, termios.TCIFLUSH)
        fcntl.ioctl(self._slave, termios.TIOCNXCL)

    def _client_baud(self) -> int | None:
        return BAUDS.get(termios.tcgetattr(self._slave)[5])
