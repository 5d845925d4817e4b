"""The watcher's side of a shared screen: the way to its host, here or over ssh, and the stop to it."""

from __future__ import annotations

import contextlib
import os
import re
import select
import socket
import sys
import threading
import time
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.features.shared_screen import wire
from multidrop.transports import Unreachable
from multidrop.transports.ssh import RELAY, WORD, FarPort

if sys.platform != "win32":
    from multidrop.features.shared_screen.host import peer
    from multidrop.transports.relay_pipe import SocketStream
    from multidrop.transports.ssh_session import OPENING, SshSession, reason

assert sys.platform != "win32"

SCREEN = "screen:"
"""The port of `multidrop relay` that is a shared screen; a number may follow."""
_FAR = re.compile(rf"ssh://(?:({WORD})@)?({WORD}|\[[0-9A-Fa-f:.]+\])(?::([0-9]{{1,5}}))?(?:/([0-9]*))?")
_READ_BYTES = 64 * 1024


def joined(where: str, folder: Path) -> tuple[SocketStream, str, bytes]:
    """Connect to a shared screen: its number, `ssh://[USER@]HOST[:PORT][/NUMBER]`, or empty for the only one here.

    Return the connection, who shares it, and the bytes after the greeting. Raises Diagnostic, Unreachable.
    """
    if "://" not in where:
        local = SocketStream("", connect(where, folder))
        return local, *_greet(local, "the shared screen", None)
    far = _far(where)
    session = SshSession(far, 9600, RELAY)
    return session, *_greet(session, far.name, far)


def _far(where: str) -> FarPort:
    if (match := _FAR.fullmatch(where)) is None:
        from multidrop.shell.secrets import url_without_secrets

        hint = "as in --join ssh://HOST, or --join ssh://USER@HOST:22/NUMBER"
        raise Diagnostic("is no screen to join", url_without_secrets(where), hint)
    user, host, port, number = match.groups("")
    return FarPort(host.strip("[]"), SCREEN + number, user, int(port or 0))


def _greet(connection: SocketStream, there: str, far: FarPort | None) -> tuple[str, bytes]:
    """Greet; return who shares the screen, and what came after his greeting. A far shell may say something before."""
    held, until = b"", time.monotonic() + OPENING
    try:
        while (left := until - time.monotonic()) > 0 and len(held) < _READ_BYTES:
            if not select.select([connection.fileno()], [], [], left)[0]:
                continue
            if not (data := connection.read(wire.LONGEST_GREETING)):
                break
            *lines, rest = (held := held + data).split(b"\n")
            for number, line in enumerate(lines):
                if line.startswith(wire.WORD.encode()):
                    version, name = wire.greeted(line)
                    if wrong := wire.other_version(version, there):
                        raise Unreachable(f"{there}: {wrong}")
                    connection.write(wire.greeting())
                    return name, b"\n".join([*lines[number + 1 :], rest])
    except (OSError, wire.GarbledMessage) as problem:
        held = held or str(problem).encode()
    except Unreachable:
        connection.close(True)
        raise
    why = "it does not reply as a shared screen does"
    if far is not None and isinstance(connection, SshSession):
        why = reason(far, connection.status(1.0), connection.last_words(), RELAY)
    connection.close(True)
    raise Unreachable(f"{there}: {why}")


def connect(number: str, folder: Path) -> socket.socket:
    """Connect to a screen that this account shares on this machine. Raises Diagnostic, Unreachable."""
    sockets: dict[str, socket.socket] = {}
    since: list[str] = []
    for path in sorted(folder.glob("*.sock")):
        made = socket.socket(socket.AF_UNIX)
        try:
            made.connect(str(path))
            if peer(made) != os.getuid():
                raise OSError(0, "of another account")
            since.append(f"{path.stem} since {time.strftime('%H:%M:%S', time.localtime(path.stat().st_mtime))}")
            sockets[path.stem] = made
        except OSError as problem:
            made.close()
            if isinstance(problem, ConnectionRefusedError):  # its program was killed
                with contextlib.suppress(OSError):
                    path.unlink()
    chosen = sockets.pop(number or next(iter(sockets), ""), None) if number or len(sockets) == 1 else None
    for other in sockets.values():
        other.close()
    if chosen is not None:
        return chosen
    if not since:
        raise Unreachable(f"no screen is shared by this account on {socket.gethostname()}; `tui --share` shares one")
    what = f"no screen {number} is shared" if number else f"{len(since)} screens are shared"
    raise Diagnostic(f"{what}: {', '.join(since)}", "tui --join", f"--join {since[0].split()[0]} joins that one")


def splice(made: socket.socket) -> None:
    """Pass bytes between a screen and standard input and output, until one of them ends: `multidrop relay screen:`."""

    def up() -> None:
        with contextlib.suppress(OSError):
            while data := os.read(0, 4096):
                made.sendall(data)
        with contextlib.suppress(OSError):
            made.shutdown(socket.SHUT_RDWR)

    threading.Thread(target=up, name="to the screen", daemon=True).start()  # a full output delays no stop
    with contextlib.suppress(OSError):
        while data := made.recv(_READ_BYTES):
            while data:
                data = data[os.write(1, data) :]


class Stops:
    """The stops that a watcher has sent, and which the host has heard. `send` may be called from any thread."""

    def __init__(self, connection: SocketStream) -> None:
        self._connection = connection
        self._lock = threading.Lock()
        self.sent = self.heard = 0
        self.trouble = ""
        """Why a stop does not arrive, from the first on that did not."""

    def send(self) -> None:
        with self._lock:
            self.sent += 1
            try:
                if not self.trouble:
                    self._connection.write(wire.STOP)
            except OSError as problem:
                self.trouble = problem.strerror or str(problem)

    def over(self, why: str) -> None:
        """Note the end of the connection."""
        self.trouble = self.trouble or why
