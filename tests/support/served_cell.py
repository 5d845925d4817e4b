"""multidrop on real terminals, beside a simulated cell that a second process asks: is the drive at rest?"""

from __future__ import annotations

import re
import signal
import socket
import struct
import time

import pytest

from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.framing import sealed
from tests.support.cell_session import TCP, bus, party
from tests.support.front_door import Home
from tests.support.posix import fcntl, termios
from tests.support.until import PATIENCE

CELL = bus("press", party("b"), baud=0, serve=TCP)
CELL += bus("noisy", party("a", 'program = "noise.mxt"'), baud=0, serve=TCP)
NOISE = """PG 1
LB G1
PR "noise noise noise noise noise noise noise noise noise"
BR G1
E
PG
"""
INT, HUP, TERM, QUIT = (getattr(signal, f"SIG{name}", name) for name in ("INT", "HUP", "TERM", "QUIT"))
SIGNALS = [TERM, QUIT, *(pytest.param(number, marks=pytest.mark.nightly) for number in (INT, HUP))]
"""Signals that end a program, some of them in every run where a test starts a process for each."""
FLOOD = 250_000
"""Bytes, more than a terminal and a queue in front of it hold."""
LOG = "seen.log"


class Shop(Home):
    """A served cell with a quiet drive b on `press` and, on `noisy`, a drive a whose program prints without end."""

    def __init__(self, folder):
        super().__init__(folder)
        self.file("noise.mxt", NOISE)
        self.serve(CELL)
        known = "party=1&checksum=1&em=1&timeout=20"  # the cell is a process of its own, which a busy machine delays
        self.urls = {
            line: f"{self.endpoints[line]['tcp']}?drives={name}&{known}"
            for line, name in (("press", "b"), ("noisy", "a"))
        }
        self.settings("".join(f"[connections.{line}]\nurl = '{url}'\n" for line, url in self.urls.items()))

    def has_seen(self, size):
        """Whether the log of a session, which `/log seen.log` began, has lines of so many bytes: what it worked off.

        An entry of a short line takes four times the bytes of the line and its time.
        """
        log = self.folder / LOG
        return log.exists() and log.stat().st_size >= 4 * size

    def velocity(self):
        """Of drive b, steps a second."""
        with socket.create_connection(("127.0.0.1", self.port("press")), 3.0) as wire:
            return int(_asked(wire, b'bPR "<",V,">"', rb"<(-?\d+)>"))

    def leave(self):
        """End every terminal, and what the drives do."""
        self.end_all()
        (self.folder / LOG).unlink(missing_ok=True)
        self._stop("noisy", "a")
        self._stop("press", "b")
        until(lambda: self.velocity() == 0, "the drive goes on")

    def _stop(self, line, name):
        """Stop a drive, and wait until it has: it answers in order, and what it printed before is before that."""
        with socket.create_connection(("127.0.0.1", self.port(line)), 3.0) as wire:
            wire.sendall(MCode(party=True).stop([name], sure=False) + b"\n")
            _asked(wire, name.encode() + b'PR "qu","iet"', rb"(quiet)")


def _asked(wire, line, answer):
    """What a drive prints, asked on the bare wire: a judge has more patience than a host with a drive."""
    deadline, heard = time.monotonic() + PATIENCE, b""
    wire.sendall(sealed(line) + b"\n")
    while not (found := re.search(answer, heard)):
        try:
            heard = heard[-100:] + wire.recv(65536)
        except TimeoutError:  # another client's line ran into it
            assert time.monotonic() < deadline, f"no answer to {line!r}"
            wire.sendall(sealed(line) + b"\n")
    return found[1]


def until(condition, what):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.01)  # between two looks


def ends(child):
    """The exit code of a process whose terminal nobody reads."""
    until(lambda: not child.isalive(), "it does not end")
    return child.exitstatus if child.exitstatus is not None else -child.signalstatus


def pipe_is_full(stream):
    """Whether a pipe that is not read takes hardly more: 16 pages, not all of them filled, as Linux makes them."""
    return struct.unpack("i", fcntl.ioctl(stream.fileno(), termios.FIONREAD, b"\0" * 4))[0] >= 35_000


@pytest.fixture(scope="session")
def floor(tmp_path_factory):
    """The cell for all tests of a test process."""
    made = Shop(tmp_path_factory.mktemp("shop"))
    yield made
    made.close()


@pytest.fixture
def shop(floor):
    """The cell for one test, which leaves its drives at rest."""
    yield floor
    floor.leave()
