"""multidrop on real terminals, beside a simulated cell that a second process asks: is the drive at rest?"""

from __future__ import annotations

import asyncio
import fcntl
import json
import socket
import struct
import sys
import termios
import time

import pexpect

from dialects.mcode.host.checksum import sealed
from dialects.mcode.host.codec import MCode
from shell.connect.settings import Settings
from shell.events import Printed
from shell.session import Session
from tests.support.processes import Running, environment

CELL = """
[[bus]]
name = "press"
serve = ["tcp://127.0.0.1:0"]
baud = 0
[[bus.drive]]
personality = "LMDCM"
name = "b"
party = true
set = { EM = 1, CK = 1 }
[[bus]]
name = "noisy"
serve = ["tcp://127.0.0.1:0"]
baud = 0
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
set = { EM = 1, CK = 1 }
program = "noise.mxt"
"""
NOISE = """PG 1
LB G1
PR "noise noise noise noise noise noise noise noise noise"
BR G1
E
PG
"""
FLOOD = 250_000
"""Bytes, more than a terminal and a queue in front of it hold."""
PATIENCE = 30.0


class Shop:
    """A served cell with a quiet drive b on `press` and, on `noisy`, a drive a whose program prints without end."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "cell.toml").write_text(CELL)
        (folder / "noise.mxt").write_text(NOISE)
        self.sim = Running("sim", "cell.toml", "--json", folder=folder)
        told = [json.loads(line) for line in self.sim.until('{"ready": true}')[:-1]]
        self.port = int(told[1]["endpoint"].rpartition(":")[2])
        known = "party=1&checksum=1&em=1"
        self.urls = {
            each["bus"]: f"{each['endpoint']}?drives={name}&{known}" for each, name in zip(told, "ba", strict=True)
        }
        (folder / "conf").mkdir()
        saved = "".join(f"[connections.{bus}]\nurl = '{url}'\n" for bus, url in self.urls.items())
        (folder / "conf" / "multidrop.toml").write_text(saved)
        self.terminals = []

    def terminal(self, *arguments):
        child = pexpect.spawn(
            sys.executable, ["-m", "multidrop", *arguments], cwd=self.folder, env=environment(self.folder),
            timeout=PATIENCE, encoding="utf-8", dimensions=(24, 80),
        )  # fmt: skip
        child.delaybeforesend = None
        self.terminals.append(child)
        return child

    def script(self, text):
        (self.folder / "script.txt").write_text(text)
        return "script.txt"

    def velocity(self):
        """Of drive b, steps a second."""
        (found,) = asyncio.run(self._ask("press", "PR V"))
        return int(found)

    async def _ask(self, bus, line):
        session = Session(Settings(folder=self.folder / "judge", state=self.folder / "judge"))
        heard = []
        session.subscribe(lambda event: heard.append(event) if isinstance(event, Printed) else None)
        try:
            await session.open(self.urls[bus], bus)
            await session.run(line)
        finally:
            await session.close()
        return [event.text for event in heard if event.solicited]

    def leave(self):
        """End every terminal, and what the drives do."""
        for child in self.terminals:
            child.close(force=True)
        self.terminals.clear()
        self._silence()
        asyncio.run(self._ask("noisy", "/stop"))
        asyncio.run(self._ask("press", "/stop"))
        until(lambda: self.velocity() == 0, "the drive goes on")

    def _silence(self):
        """Stop what the noisy drive prints: on a slow machine its answers are lost in so much. It obeys in order."""
        with socket.create_connection(("127.0.0.1", self.port), PATIENCE) as wire:
            stop = MCode(party=True).stop(["a"], sure=False)
            wire.sendall(stop + b"\n" + sealed(b'aPR "qu","iet"') + b"\n")
            heard = b""
            while b"quiet" not in heard:
                heard = heard[-10:] + wire.recv(65536)

    def close(self):
        self.sim.process.terminate()
        assert self.sim.end() == 0


def until(condition, what):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.01)  # between two looks


def ends(child):
    """The exit code of a process whose terminal nobody reads."""
    until(lambda: not child.isalive(), "it does not end")
    return child.exitstatus if child.exitstatus is not None else -child.signalstatus


def flooded(shop):
    """Until so much has come from the noisy drive."""
    with socket.create_connection(("127.0.0.1", shop.port), PATIENCE) as wire:  # which hears what the process hears
        heard = 0
        while heard < FLOOD:
            heard += len(wire.recv(65536))


def pipe_is_full(stream):
    """Whether a pipe that is not read takes hardly more: 16 pages, not all of them filled, as Linux makes them."""
    return struct.unpack("i", fcntl.ioctl(stream.fileno(), termios.FIONREAD, b"\0" * 4))[0] >= 35_000
