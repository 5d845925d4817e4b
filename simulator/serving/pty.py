"""A bus on a pseudo-terminal: a serial port that any terminal program opens by the name of a link.

Our own descriptor on the client's end stays open, so the pseudo-terminal lives while nobody has it open, and so that
the client's baud rate can be read from its settings. What an ordinary serial port forgets when its last client goes
is forgotten here too: unread bytes, the baud rate and exclusive use; what it wrote too fast for the wire, some seconds
later. A client that flushes its output (tcflush) takes back what has not gone out at the wire's pace, as it does from a
serial port's buffer; packet mode tells of it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import struct
import sys
import termios
import tty
from pathlib import Path

from dialects import Diagnostic
from simulator.serving.inlet import Inlet
from simulator.serving.running import RunningFloor
from simulator.serving.tty_watch import TtyWatch
from simulator.wire.baud import resample

assert sys.platform != "win32"

READ_SIZE = 4096
FLUSHED: int = termios.TIOCPKT_FLUSHWRITE
BAUDS: dict[int, int] = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()
}
SPEEDS = {baud: code for code, baud in BAUDS.items()}


class PtyServer:
    """Serves one bus on a pseudo-terminal, with a link to it at `link` where one is given. Raises Diagnostic."""

    def __init__(self, floor: RunningFloor, bus: str, link: Path | None) -> None:
        self._floor, self._bus, self._link = floor, bus, link
        self._inlet = Inlet(floor, bus, self)
        self._master = self._slave = -1
        self._watch: TtyWatch | None = None
        self._device = ""
        self._claim = self._claimed()
        try:
            self._open()
        except Diagnostic:
            self._give_up()
            raise
        self._detach = floor.attach(bus, self)

    @property
    def endpoint(self) -> str:
        """`pty:` and the absolute path that a client opens."""
        return f"pty:{self._link.absolute() if self._link else self._device}"

    @property
    def _wire_baud(self) -> int:
        return self._floor.floor.wires[self._bus].baud

    # -- Listener -----------------------------------------------------------------------------------

    def hear(self, data: bytes) -> None:
        """Pass on what the wire says; a client that does not read loses it, as on a serial line."""
        if self._watch is None or self._watch.deserted():
            return
        if self._wire_baud and (baud := self._client_baud()):
            data = resample(data, self._wire_baud, baud)
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)

    def unplugged(self) -> None:
        """The client's end hangs up and the link is gone."""
        self._shut()

    def plugged(self) -> None:
        """A new pseudo-terminal stands behind the same link."""
        self._open()

    def disconnected(self) -> None:
        """A serial port stays where it is: what hangs on it has power of its own."""

    def connectable(self) -> None:
        """Nothing has changed."""

    def close(self) -> None:
        """End of service."""
        self._inlet.close()
        self._detach()
        self._shut()
        self._give_up()

    # -- the pseudo-terminal ------------------------------------------------------------------------

    def _open(self) -> None:
        self._master, self._slave = os.openpty()
        self._device = os.ttyname(self._slave)
        os.set_blocking(self._master, False)
        fcntl.ioctl(self._master, termios.TIOCPKT, struct.pack("i", 1))
        self._make_fresh()
        try:
            self._make_link()
        except OSError as error:
            self._close_both()
            raise Diagnostic(f"cannot make the link {self._link} ({error.strerror})", self._where) from None
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
        if self._link is not None and self._is_ours(self._link):
            self._link.unlink(missing_ok=True)
        self._close_both()

    def _close_both(self) -> None:
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1

    # -- what an inlet needs ------------------------------------------------------------------------

    def pause(self) -> None:
        """The wire does not carry what the client writes as fast: it waits in the pseudo-terminal."""
        if self._master >= 0:
            self._floor.loop.remove_reader(self._master)

    def resume(self) -> None:
        """There is room again."""
        if self._master >= 0:
            self._floor.loop.add_reader(self._master, self._readable)

    def look(self) -> None:
        """A client that flushes its output is not kept waiting."""
        if self._master >= 0 and select.select((), (), (self._master,), 0)[2]:
            self._readable()

    def _readable(self) -> None:
        with contextlib.suppress(BlockingIOError):
            if data := self._read(max(1, self._inlet.room)):
                self._inlet.write(data, self._client_baud() if self._wire_baud else None)

    def _read(self, most: int) -> bytes:
        """What the client has written. Packet mode tells in the first byte whether it takes that back instead."""
        packet = os.read(self._master, 1 + most)
        if packet[:1] and packet[0] & FLUSHED:
            self._inlet.retract()
        return packet[1:]

    def gone(self) -> bool:
        """Whether nobody has it open."""
        return self._watch is not None and self._watch.deserted()

    def drop(self) -> None:
        """Throw away what is unread."""
        with contextlib.suppress(BlockingIOError):
            while self._master >= 0:
                self._read(READ_SIZE)

    def _came_or_went(self) -> None:
        if self._watch is not None and self._watch.clients() == 0:
            self._make_fresh()

    def _make_fresh(self) -> None:
        """As a port is when nobody has it open: raw, at the wire's baud rate, nothing to read, free for all."""
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

    # -- the link -----------------------------------------------------------------------------------

    @property
    def _where(self) -> str:
        return f'bus "{self._bus}"'

    @property
    def _claim_path(self) -> Path | None:
        return self._link.with_name(f".{self._link.name}.lock") if self._link else None

    def _claimed(self) -> int:
        """Hold the link for this server alone, by a lock: what a stale link leads to may be somebody else's by now."""
        path = self._claim_path
        if path is None:
            return -1
        try:
            claim = os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise Diagnostic(f"cannot make the link {self._link} ({error.strerror})", self._where) from None
        try:
            fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(claim)
            raise Diagnostic(
                f"{self._link} is served already", self._where, "end the other multidrop sim, or serve elsewhere"
            ) from None
        return claim

    def _give_up(self) -> None:
        if self._claim_path is not None and self._claim >= 0:
            self._claim_path.unlink(missing_ok=True)
            os.close(self._claim)
            self._claim = -1

    def _is_ours(self, link: Path) -> bool:
        return link.is_symlink() and os.readlink(link) == self._device

    def _make_link(self) -> None:
        """Put the link there, in place of a stale one; anything that is no link is somebody's file."""
        link = self._link
        if link is None:
            return
        if not link.is_symlink() and link.exists():
            raise Diagnostic(f"{link} is there already and is not a link", self._where, "remove it or serve elsewhere")
        new = link.with_name(f".{link.name}.{os.getpid()}")
        new.unlink(missing_ok=True)
        new.symlink_to(self._device)
        new.replace(link)
