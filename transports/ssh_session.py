"""A running `ssh` and its far side: `multidrop relay` or `socat` on another machine.

`ssh` has one socket as its standard input and output. It runs in a session of its own, so a Ctrl+C at the terminal
does not end it ahead of the stop. Its messages go to a file, of which the last line is the reason of an end.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time

from transports.base import Transport, Unreachable
from transports.descriptor import DescriptorPipe
from transports.far_port import FarPort, NotInstalled
from transports.relay_frames import GREETING, Frames, Garbled, Kind, frame
from transports.relay_pipe import RelayPipe
from transports.ssh_command import MISSING, SOCAT_WORD, arguments, reason, unknown_greeting

if sys.platform != "win32":
    from transports.output_queue import output_queue

assert sys.platform != "win32"

LIMITS = (
    "on {host} socat passes the bytes on instead of multidrop: a stop waits there for the bytes sent before it, and "
    "the baud rate does not change while the port is open"
)
_PREAMBLE = 65536
"""The largest number of bytes that a far shell may print before the greeting."""
_SETTLE = 0.3
"""Seconds in which socat ends if it cannot open the port."""
_ENDING = 2.5
"""Seconds that ssh gets for its end once its input has ended."""
_READ = 4096
_PREFIX = re.compile(r"multidrop: |\S+ \S+ socat\[\d+\] [A-Z] ")
"""The beginning of each line of the far side."""


class SshSession:
    """A running `ssh` with a socket to it. Its start may block; raises Unreachable."""

    def __init__(self, far: FarPort, baud: int, way: str) -> None:
        self.name = far.name
        self._heard = 0
        with contextlib.ExitStack() as failing:
            try:
                self._socket, theirs = socket.socketpair()
                failing.enter_context(self._socket)
                self._words = failing.enter_context(tempfile.TemporaryFile())
                with theirs:
                    self._process = subprocess.Popen(
                        arguments(far, baud, way),
                        stdin=theirs.fileno(),
                        stdout=theirs.fileno(),
                        stderr=self._words.fileno(),
                        start_new_session=True,
                    )
            except OSError as error:
                why = "install OpenSSH's client" if error.filename == "ssh" else error.strerror or str(error)
                raise Unreachable(f"{far.name}: the program ssh cannot be started; {why}") from error
            failing.pop_all()
        self._socket.setblocking(False)

    async def read_some(self) -> bytes:
        """Wait for bytes; empty at the end."""
        try:
            return await asyncio.get_running_loop().sock_recv(self._socket, _READ)
        except OSError:
            return b""

    def fileno(self) -> int:
        """The descriptor."""
        return self._socket.fileno()

    def read(self, most: int) -> bytes:
        """Read what arrived; empty at the end."""
        return self._socket.recv(most)

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Write, and return how many bytes were taken."""
        return self._socket.send(data)

    def unsent(self) -> int:
        """Bytes that ssh has not taken."""
        return output_queue(self._socket.fileno())

    def last_words(self) -> str:
        """The last line that ssh or the far side has printed."""
        size = os.fstat(self._words.fileno()).st_size
        text = os.pread(self._words.fileno(), _READ, max(self._heard, size - _READ)).decode(errors="replace")
        lines = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
        return _PREFIX.sub("", lines[-1])[:400].rstrip(".") if lines else ""

    def mark(self) -> None:
        """Count lines printed until now not as the reason of an end."""
        self._heard = os.fstat(self._words.fileno()).st_size

    def status(self, within: float) -> int | None:
        """Wait for the exit status; None: it runs on."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self._process.wait(within)
        return None

    def close(self, lost: bool) -> None:
        """End it: the far side sees the end of its input. What is `lost` gets no time for that."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
        self._drain(time.monotonic() + (0.0 if lost else _ENDING))
        for number in (signal.SIGTERM, signal.SIGKILL):
            if self._process.poll() is None:
                os.killpg(self._process.pid, number)  # with the programs that it uses as its way
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(1.0)
        self._release()

    def _drain(self, deadline: float) -> None:
        """Read until the end, so that ssh never waits for a reader."""
        with contextlib.suppress(OSError):
            while (left := deadline - time.monotonic()) > 0:
                self._socket.settimeout(left)
                if not self._socket.recv(_READ):
                    break
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(max(0.05, deadline - time.monotonic()))

    def _release(self) -> None:
        self._socket.close()
        self._words.close()


class SocatEndpoint:
    """The bytes of a far socat, which knows no frames and cannot drop sent bytes."""

    def __init__(self, session: SshSession) -> None:
        self.name = session.name
        self._session = session
        self._lost = False
        self.fileno, self.write, self.unsent = session.fileno, session.write, session.unsent

    def read(self) -> bytes | None:
        """Bytes that arrived; None: the end."""
        return self._session.read(_READ) or None

    def drop(self) -> int:
        """Return 0: what has left cannot be taken back."""
        return 0

    def explain(self, error: OSError | None) -> str:
        """Reason of a break in one line for a person."""
        self._lost = True
        return self._session.last_words() or "the connection has ended; check the network and the other machine"

    def close(self) -> None:
        """End ssh."""
        self._session.close(self._lost)


class SocatPipe(DescriptorPipe):
    """A transport that keeps fewer promises than others; `limits` names the others."""

    def __init__(self, endpoint: SocatEndpoint, limits: str) -> None:
        super().__init__(endpoint)
        self.limits = limits


async def greeted(session: SshSession, far: FarPort, baud: int, way: str) -> Transport:
    """Wait for the greeting, and make the transport that it asks for. Raises Unreachable."""
    line, early = await _greeting(session, far, way)
    if line == GREETING:
        early, took = await _measured(session, early)
        return RelayPipe(session, baud, early, took)
    if (status := await asyncio.to_thread(session.status, _SETTLE)) is not None:
        raise _failure(far, status, session.last_words(), way)
    session.mark()
    return SocatPipe(SocatEndpoint(session), LIMITS.format(host=far.host))


async def _measured(session: SshSession, early: bytes) -> tuple[bytes, float]:
    """Ask for a sign of life; return all bytes that have arrived by its reply, and the time that it took, s."""
    frames, began = Frames(), time.monotonic()
    session.mark()
    session.write(frame(Kind.BEAT))
    with contextlib.suppress(Garbled):  # which the pipe reports
        replied = any(kind is Kind.BEAT for kind, _ in frames.take(early))
        while not replied and (data := await session.read_some()):
            early += data
            replied = any(kind is Kind.BEAT for kind, _ in frames.take(data))
    return early, time.monotonic() - began


async def _greeting(session: SshSession, far: FarPort, way: str) -> tuple[str, bytes]:
    """The first line that is a greeting, and the bytes after it; a far shell may print others before."""
    held, count, said = b"", 0, ""
    while count < _PREAMBLE and (data := await session.read_some()):
        count += len(data)
        *lines, held = (held + data).split(b"\n")
        for number, line in enumerate(lines):
            text = line.decode(errors="replace").strip()
            if text in (GREETING, SOCAT_WORD):
                return text, b"\n".join([*lines[number + 1 :], held])
            if wrong := unknown_greeting(text):
                raise Unreachable(f"{far.name}: {wrong}")
            said = text or said
    status = await asyncio.to_thread(session.status, _ENDING)
    raise _failure(far, status, session.last_words() or said, way)


def _failure(far: FarPort, status: int | None, words: str, way: str) -> Unreachable:
    kind = NotInstalled if status == MISSING else Unreachable
    return kind(f"{far.name}: {reason(far, status, words, way)}")
