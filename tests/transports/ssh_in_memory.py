"""Programs `ssh` that are no processes: each says and does what a test has written down for it."""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from multidrop.transports import ssh_session
from multidrop.transports.relay import GREETING, FrameSplitter, Kind, frame
from tests.support.until import PATIENCE

RELAY = f"{GREETING}\n".encode()
SOCAT = b"multidrop-socat\n"


@dataclass
class Play:
    """What one program does."""

    said: bytes = b""
    """Its first output."""
    words: str = ""
    """What it prints as messages at its start."""
    status: int | None = None
    """The status with which it ends at once; None: it stays."""
    reply: Callable[[bytes], bytes] = lambda data: b""
    """What it says to bytes that it gets."""
    last: bytes = b""
    """What it says after the end of its input."""
    deaf: bool = False
    """It closes its output at the end of its input, and does not end."""
    ignores: tuple[int, ...] = ()
    """The signals that do not end it."""
    gate: threading.Event | None = None
    """Its start takes until this is set."""


@dataclass
class Clock:
    """The clock of the module under test: only the waits for a program make it go on."""

    now: float = 100.0

    def monotonic(self) -> float:
        return self.now


class Program:
    """One of them, as `subprocess.Popen` gives it."""

    def __init__(self, play: Play, clock: Clock, command: Sequence[str], stdin: int, stderr: int) -> None:
        self.command, self.clock, self.play = list(command), clock, play
        self.pid = next(_PIDS)
        self.heard = bytearray()
        self.signals: list[int] = []
        self.status: int | None = None
        self.mask = signal.pthread_sigmask(signal.SIG_BLOCK, [])
        self._messages = os.dup(stderr)
        self._socket = socket.socket(fileno=os.dup(stdin))
        self._thread = threading.Thread(target=self._live)
        self.print(play.words)
        self._socket.sendall(play.said)
        if play.status is not None:
            self.end(play.status)
        else:
            self._thread.start()

    def print(self, words: str) -> None:
        """Print messages."""
        os.write(self._messages, words.encode())

    def say(self, data: bytes) -> None:
        self._socket.sendall(data)

    def close_output(self) -> None:
        """Say no more, and stay."""
        self._socket.shutdown(socket.SHUT_WR)

    def end(self, status: int) -> None:
        """End by itself. What waits for its output then learns of it."""
        if self.status is None:
            self.status = status
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
            os.close(self._messages)

    def _live(self) -> None:
        with contextlib.suppress(OSError):
            while data := self._socket.recv(65536):
                self.heard += data
                self._socket.sendall(self.play.reply(data))
            self._socket.sendall(self.play.last)
            if self.play.deaf:
                self.close_output()
            else:
                self.end(0)

    # As the module under test uses it

    def poll(self) -> int | None:
        return self.status

    def wait(self, timeout: float) -> int:
        if self.status is None:
            self.clock.now += timeout
            raise subprocess.TimeoutExpired(self.command, timeout)
        return self.status

    def signalled(self, number: int) -> None:
        self.signals.append(number)
        if number not in self.play.ignores:
            self.end(-number)

    def forget(self) -> None:
        """Free what it has, at the end of a test."""
        self.end(-1)
        if self._thread.ident is not None:
            self._thread.join(PATIENCE)
        self._socket.close()


@dataclass
class Machine:
    """This machine: the next starts of `ssh` take the next plays."""

    plays: list[Play | OSError] = field(default_factory=list)
    started: list[Program] = field(default_factory=list)
    clock: Clock = field(default_factory=Clock)

    def start(self, command: Sequence[str], stdin: int, stdout: int, stderr: int, start_new_session: bool) -> Program:
        play = self.plays.pop(0)
        if isinstance(play, OSError):
            raise play
        assert stdin == stdout and start_new_session, "the terminal's Ctrl+C would end it"
        if play.gate is not None:
            play.gate.wait(PATIENCE)
        self.started.append(Program(play, self.clock, command, stdin, stderr))
        return self.started[-1]

    def kill_group(self, group: int, number: int) -> None:
        for program in self.started:
            if program.pid == group:
                return program.signalled(number)
        raise ProcessLookupError(errno.ESRCH, os.strerror(errno.ESRCH))


def installed(patch: pytest.MonkeyPatch) -> Machine:
    """Put such programs in the place of `ssh`."""
    machine = Machine()
    patch.setattr(subprocess, "Popen", machine.start)
    patch.setattr(os, "killpg", machine.kill_group)
    patch.setattr(ssh_session, "time", SimpleNamespace(monotonic=machine.clock.monotonic))
    return machine


class FarRelay:
    """The replies of a relay on the far side. `sent` are the bytes for its port."""

    def __init__(self, machine: Machine, takes: float = 0.0) -> None:
        """`takes`: the time to it and back, s."""
        self.sent = bytearray()
        self._machine, self._takes, self._frames = machine, takes, FrameSplitter()

    def reply(self, data: bytes) -> bytes:
        said = b""
        for kind, payload in self._frames.take(data):
            if kind is Kind.BEAT:
                self._machine.clock.now += self._takes
                said += frame(Kind.BEAT)
            elif kind is Kind.DATA:
                self.sent += payload
                said += frame(Kind.DONE, len(self.sent).to_bytes(8))
        return said


_PIDS = itertools.count(700_001)
