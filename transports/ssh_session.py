"""A serial port of another machine, through the user's own `ssh` program: its keys, configuration, and jump hosts.

The far side is `multidrop relay`, or `socat` where that is not installed.

`ssh` has one socket as its standard input and output. It runs in a session of its own, so a Ctrl+C at the terminal
does not end it ahead of the stop. Its messages go to a file, of which the last line is the reason of an end.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator

from multidrop.transports import Transport, Unreachable
from multidrop.transports.pipe import DescriptorPipe, in_thread
from multidrop.transports.relay import GREETING, WORD, FrameSplitter, GarbledFrame, Kind, frame
from multidrop.transports.relay_pipe import RelayPipe, SocketStream
from multidrop.transports.ssh import RELAY, SOCAT, FarPort, NotInstalled

# The command lines of `ssh` and of the far machine, and the reasons of a failure.
#
# The far shell gets one command: it executes `multidrop relay` where that is installed, and `socat` where it is not.
# Both take the place of the shell, so that none stays between. The port's path is quoted for that shell: it executes
# nothing.


CONNECT = 5
"""Seconds in which ssh must reach the host."""
SOCAT_WORD = "multidrop-socat"
"""The first line of a far side with socat."""
MISSING = 127
"""The far shell's status where neither program is installed."""
_OPTIONS = (
    "BatchMode=yes",  # it asks nothing: no person could answer
    f"ConnectTimeout={CONNECT}",
    "ServerAliveInterval=2",
    "ServerAliveCountMax=2",
    "ClearAllForwardings=yes",  # a person's other connection has them
    "RemoteCommand=none",
    "LogLevel=INFO",
)
_LINE = "raw,echo=0,cs8,parenb=0,cstopb=0,crtscts=0,clocal=1,nonblock,flock-ex-nb"
"""The settings for socat: as for a port here."""
_CLAIM = 'x=,ioctl-void=0x540c; case "$(readlink -f {path})" in /dev/pts/*) x=;; esac'
"""TIOCEXCL shuts out programs that ignore the lock; a pseudo-terminal would keep it after socat has ended."""
_SPECIAL = re.compile(r"""([\\,:!"'()\[\]{}])""")
"""The characters that mean something in an address of socat."""
_HINTS = (
    ("host key verification failed", "run `ssh {login}` once by hand, and compare and accept the key of the host"),
    ("permission denied (", "`ssh {login}` must log in without a password; set up a key with ssh-copy-id"),
    ("could not resolve", "check the spelling, or give its address"),
    ("connection refused", "no ssh server listens there; check the port's number and the server"),
    ("timed out", "check the address, its power and the network"),
    ("no route to host", "check the address, its power and the network"),
    ("invalid choice: 'relay'", "multidrop there is older; install this version there, or add relay=socat to the URL"),
    ("flock(", "another program has the port; close it there"),
    ("no such file", "plug it in there, or look at /dev/serial/by-id there"),
    ("inappropriate ioctl", "it is not a serial port"),
)
"""What to do, by a part of the last line of ssh or of socat."""
_WINDOWS = ("operable program or batch file", "cmdlet", "commandnotfoundexception")
"""Parts of what cmd.exe and PowerShell say of a command for another shell."""


def arguments(far: FarPort, baud: int, way: str = "") -> list[str]:
    """The command line of ssh. `way`: one of `WAYS`, or empty to try both."""
    given = ["ssh", "-T", "-e", "none"]
    for option in _OPTIONS:
        given += ["-o", option]
    if far.port:
        given += ["-p", str(far.port)]
    if far.user:
        given += ["-l", far.user]
    return [*given, "--", far.host, f"exec /bin/sh -c {shlex.quote(far_command(far.path, baud, way))}"]


def far_command(path: str, baud: int, way: str = "") -> str:
    """The command for the far shell. Without a terminal its PATH may lack the folder of pipx."""
    relay = f"exec multidrop relay --baud {baud} -- {shlex.quote(path)}"
    escaped = _SPECIAL.sub(r"\\\1", path)
    address = f"OPEN:{escaped},b{baud},{_LINE}"
    claim = _CLAIM.format(path=shlex.quote(path))
    socat = f'{claim}; echo {SOCAT_WORD}; exec socat STDIO {shlex.quote(address)}"$x"'
    steps = [
        f"if command -v {program} >/dev/null 2>&1; then {command}; fi"
        for program, command in ((RELAY, relay), (SOCAT, socat))
        if way in ("", program)
    ]
    return "; ".join(['PATH="$PATH:$HOME/.local/bin:/usr/local/bin"', *steps, f"exit {MISSING}"])


def unknown_greeting(line: str) -> str:
    """The reason to refuse a first line of another version of multidrop; empty for any other line."""
    if not line.startswith(f"{WORD} "):
        return ""
    return f"multidrop there speaks '{line[:40]}', this one '{GREETING}'; install one version on both machines"


def reason(far: FarPort, status: int | None, words: str, way: str = "") -> str:
    """Why the far side ended before its greeting: from the status of ssh and the last line that was said."""
    if status == MISSING:
        lacking = f"{way} is not" if way else "neither multidrop nor socat is"
        also = f" ({words})" if words else ""
        return f"{lacking} installed on {far.host}{also}; install {way or RELAY} there"
    known = next((hint for part, hint in _HINTS if part in words.lower()), "")
    hint = f"; {known.format(login=far.login)}" if known else ""
    if any(part in words.lower() for part in _WINDOWS):
        there = f"there `multidrop share {far.path[1:]} --rfc2217 2217`, here `ssh -L 2217:127.0.0.1:2217 {far.login}`"
        return f"its shell is one of Windows, where the relay does not run; {there} and rfc2217://127.0.0.1:2217"
    if status in (255, None):
        return f"not reached: {words or 'ssh ended without a word'}{hint}"
    if status < 0:
        return f"ssh was ended by signal {-status}"
    if words:
        return words + hint
    there = shlex.quote(far.path)  # for the far shell; this one has to pass it on as it is
    return f"the far side ended with status {status}; try: ssh {far.login} multidrop relay {shlex.quote(there)}"


if sys.platform != "win32":
    from multidrop.transports import output_queue

assert sys.platform != "win32"

LIMITS = (
    "on {host} socat passes the bytes on instead of multidrop: a stop waits there for the bytes sent before it, and "
    "the baud rate does not change while the port is open"
)
_PREAMBLE = 65536
"""The largest number of bytes that a far shell may print before the greeting."""
_SETTLE = 0.3
"""Seconds in which socat ends if it cannot open the port."""
ENDING_TIMEOUT = 2.5
"""Seconds that ssh gets for its end once its input has ended."""
_READ_BYTES = 4096
_PREFIX = re.compile(r"multidrop: |\S+ \S+ socat\[\d+\] [A-Z] ")
"""The beginning of each line of the far side."""


@contextlib.contextmanager
def _pipe_signal_open() -> Iterator[None]:
    """Let SIGPIPE through to a program that starts here: it inherits the mask of this thread, which may block it."""
    before = signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGPIPE})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class SshSession(SocketStream):
    """A running `ssh` with a socket to it. Its start may block; raises Unreachable."""

    def __init__(self, far: FarPort, baud: int, way: str) -> None:
        self._heard = 0
        with contextlib.ExitStack() as failing:
            try:
                ours, theirs = socket.socketpair()
                failing.enter_context(ours)
                self._words = failing.enter_context(tempfile.TemporaryFile())
                with theirs, _pipe_signal_open():
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
        super().__init__(far.name, ours)

    def unsent(self) -> int:
        """Bytes that ssh has not taken."""
        return output_queue(self._socket.fileno())

    def last_words(self) -> str:
        """The last line that ssh or the far side has printed."""
        size = os.fstat(self._words.fileno()).st_size
        text = os.pread(self._words.fileno(), _READ_BYTES, max(self._heard, size - _READ_BYTES)).decode(
            errors="replace"
        )
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
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
        # Read until the end, so that ssh never waits for a reader.
        deadline = time.monotonic() + (0.0 if lost else ENDING_TIMEOUT)
        with contextlib.suppress(OSError):
            while (left := deadline - time.monotonic()) > 0:
                self._socket.settimeout(left)
                if not self._socket.recv(_READ_BYTES):
                    break
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(max(0.05, deadline - time.monotonic()))
        for number in (signal.SIGTERM, signal.SIGKILL):
            if self._process.poll() is None:
                os.killpg(self._process.pid, number)  # with the programs that it uses as its way
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(1.0)
        self._socket.close()
        self._words.close()


class SocatEndpoint:
    """The bytes of a far socat, which knows no frames and cannot drop sent bytes."""

    def __init__(self, session: SshSession) -> None:
        self.name = session.name
        self._session = session
        self._lost = False

    def fileno(self) -> int:
        return self._session.fileno()

    def write(self, data: bytes | memoryview) -> int:
        return self._session.write(data)

    def unsent(self) -> int:
        return self._session.unsent()

    def read(self) -> bytes | None:
        return self._session.read(_READ_BYTES) or None

    def drop(self) -> int:
        return 0

    def explain(self, error: OSError | None) -> str:
        self._lost = True
        return self._session.last_words() or "the connection has ended; check the network and the other machine"

    def close(self) -> None:
        self._session.close(self._lost)


async def greeted(session: SshSession, far: FarPort, baud: int, way: str) -> Transport:
    """Wait for the greeting, and make the transport that it asks for. Raises Unreachable."""
    line, early = await _greeting(session, far, way)
    if line == GREETING:
        early, took = await _measured(session, early)
        return RelayPipe(session, baud, early, took)
    if (status := await asyncio.to_thread(session.status, _SETTLE)) is not None:
        raise _failure(far, status, session.last_words(), way)
    session.mark()
    pipe = DescriptorPipe(SocatEndpoint(session))
    pipe.limits = LIMITS.format(host=far.host)
    return pipe


async def _measured(session: SshSession, early: bytes) -> tuple[bytes, float]:
    """Ask for a sign of life; return all bytes that have arrived by its reply, and the time that it took, s."""
    frames, began = FrameSplitter(), time.monotonic()
    session.mark()
    with contextlib.suppress(GarbledFrame, OSError):  # which the pipe reports
        session.write(frame(Kind.BEAT))
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
    status = await asyncio.to_thread(session.status, ENDING_TIMEOUT)
    raise _failure(far, status, session.last_words() or said, way)


def _failure(far: FarPort, status: int | None, words: str, way: str) -> Unreachable:
    kind = NotInstalled if status == MISSING else Unreachable
    return kind(f"{far.name}: {reason(far, status, words, way)}")


OPENING = 20.0
"""Seconds until the greeting: several hosts on the way, a slow machine."""


async def open_ssh(far: FarPort, baud: int = 9600, within: float | None = None, way: str = "") -> Transport:
    """Open a port within a time, s; `way`: see `ssh.WAYS`. Raises Unreachable."""
    try:
        return await _opened(far, baud, within or OPENING, way)
    except NotInstalled as neither:
        if way:
            raise
        try:  # a server that allows a few commands only may refuse the first one as a whole
            return await _opened(far, baud, within or OPENING, SOCAT)
        except NotInstalled:
            raise neither from None


async def _opened(far: FarPort, baud: int, within: float, way: str) -> Transport:
    session = await in_thread(lambda: SshSession(far, baud, way), lambda late: late.close(True))
    try:
        async with asyncio.timeout(within):
            return await greeted(session, far, baud, way)
    except TimeoutError:
        why = session.last_words() or "no reply"
        await asyncio.shield(asyncio.to_thread(session.close, True))
        raise Unreachable(f"{far.name}: not reached within {within:g} s: {why}; try `ssh {far.login}`") from None
    except BaseException:
        await asyncio.shield(asyncio.to_thread(session.close, True))
        raise
