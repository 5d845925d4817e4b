"""The programs of this machine that have a serial port open. Two on one port take bytes from each other.

Many of them take no lock (minicom, screen, socat, cat), so a port that can be opened is not yet ours alone. Linux lists
the open files of every process, but of other accounts' only to root: where that hides something, the services that are
known for opening ports are named with their remedy.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from multidrop.transports.serial_ports import com_name

ROOT = Path("/")
CLOSE = "close it there"
TERMINALS = "/dev/pts/"
SERVICES = {
    "ModemManager": "it tries new ports as modems: `sudo systemctl stop ModemManager`",
    "brltty": "it takes adapters for Braille displays: `sudo systemctl stop brltty`",
    "gpsd": "it reads GPS receivers: `sudo systemctl stop gpsd.socket gpsd`",
}
"""The remedy for each service that opens ports by itself; the name is the one that the kernel shows."""
TAKER = "brltty"
LOGINS = ("agetty", "getty", "mgetty", "login")
"""A login on a serial port. Its command line names the port, and init starts it again if it is only ended."""


class User(NamedTuple):
    """A program that has a port open, or may have. `pid` 0: this program itself. Shown as `name (pid n)`."""

    name: str
    pid: int

    def __str__(self) -> str:
        if not self.pid:
            return "this program itself"
        return f"{self.name} (pid {self.pid})" if self.name else f"pid {self.pid}"

    def remedy(self, port: str) -> str:
        """What frees the port."""
        if self.name in LOGINS:
            return f"it is a login: `sudo systemctl stop serial-getty@{Path(os.path.realpath(port)).name}`"
        return SERVICES.get(self.name, CLOSE)


if sys.platform == "win32":

    def _shared(port: str) -> mmap.mmap:
        return mmap.mmap(-1, 4, tagname=f"multidrop {com_name(port)}".replace("\\", "/"))

    def mark(port: str) -> mmap.mmap:
        """Mark a port as this process's, until the mark is closed or the process ends."""
        shared = _shared(port)
        shared[:] = os.getpid().to_bytes(4, "little")
        return shared


def holder(port: str, root: Path = ROOT) -> User | None:
    """The program that has a port open; None if none is known.

    Looked at: the locks of the kernel, lock files, and on Linux the open files of every process that may be read. It
    takes some milliseconds. `root` is the folder of `proc` and `var`. Windows tells of none, so there it is the mark of
    another multidrop.
    """
    if sys.platform == "win32":
        with _shared(port) as shared:
            pid = int.from_bytes(shared[:], "little")
        return None if not pid else User("", 0) if pid == os.getpid() else User("multidrop", pid)
    else:
        return lock_owner(port) or other(port, root)


def other(port: str, root: Path = ROOT) -> User | None:
    """The program that has a port open beside this one, without a lock that keeps others out; None: none is known."""
    return None if sys.platform == "win32" else _with_lock_file(port, root) or _with_open_file(port, root)


def lock_owner(port: str) -> User | None:
    """The program that has locked this port; None if unknown (only Linux reports it)."""
    if sys.platform == "win32":
        return None
    else:
        try:
            node = os.stat(port)
            locks = Path("/proc/locks").read_text()
        except OSError:
            return None
        place = f"{os.major(node.st_dev):02x}:{os.minor(node.st_dev):02x}:{node.st_ino}"
        for line in locks.splitlines():
            fields = line.split()
            if len(fields) > 5 and fields[1] == "FLOCK" and fields[5] == place and fields[4] != "0":
                return User("", 0) if int(fields[4]) == os.getpid() else _program(fields[4], ROOT)
        return None


def in_use(port: str) -> str:
    """Say who has a port that could not be opened, and what to do."""
    if (user := holder(port)) is not None:
        return f"{user}; {user.remedy(port)}"
    if maybe := suspects(port):
        return f"another program, perhaps {maybe}"
    tool = {"linux": "fuser -v", "darwin": "lsof"}.get(sys.platform)
    return f"another program; {CLOSE}" + (f" (`sudo {tool} {port}` names it)" if tool else "")


def beside(port: str) -> str:
    """Say which program has an open port as well, and what to do; empty: none is known."""
    user = other(port)
    if user is None:
        return ""
    return f"{user} has {port} open as well, and each takes bytes from the other; {user.remedy(port)}"


def suspects(port: str, root: Path = ROOT) -> str:
    """Name the services that may have a port open, where this account may not know, each with its remedy."""
    users = []
    for process in _processes(root):
        user = _program(process.name, root)
        known = user.name in SERVICES and not os.path.realpath(port).startswith(TERMINALS)
        if (known or user.name in LOGINS and _names(process, port)) and _hidden(process):
            users.append(f"{user}: {user.remedy(port)}")
    return "; or ".join(users)


def taker(root: Path = ROOT) -> str:
    """Name a service that takes adapters away, where it runs: their ports vanish a moment after they are plugged in."""
    for process in _processes(root):
        if (user := _program(process.name, root)).name == TAKER:
            return f"; {user} is running, and may have taken it: {SERVICES[TAKER]}"
    return ""


def _processes(root: Path) -> Iterator[Path]:
    with contextlib.suppress(OSError):
        yield from sorted(process for process in (root / "proc").iterdir() if process.name.isdigit())


def _hidden(process: Path) -> bool:
    """Whether this account may not see which files a process has open."""
    try:
        next((process / "fd").iterdir(), None)
    except PermissionError:
        return True
    except OSError:
        return False
    return False


def _names(process: Path, port: str) -> bool:
    """Whether the command line of a process has the name of a port, with or without `/dev/`."""
    try:
        words = (process / "cmdline").read_bytes().decode("utf-8", "replace").split("\0")
    except OSError:
        return False
    device = os.path.realpath(port)
    return not {device, device.removeprefix("/dev/")}.isdisjoint(words)


def _with_lock_file(port: str, root: Path) -> User | None:
    """The program of a UUCP lock file, as minicom and picocom leave it; None if that has ended, or is this one.

    Such a file is named by the port's path below `/dev`, each slash as `_`: `LCK..ttyUSB0`, `LCK..pts_7`.
    """
    paths = dict.fromkeys((os.path.realpath(port), os.path.abspath(port)))
    names = [f"LCK..{path.removeprefix('/dev/').replace('/', '_')}" for path in paths]
    for folder in ("run/lock", "var/lock", "var/lock/lockdev"):
        for name in names:
            try:
                match = re.search(r"\d+", (root / folder / name).read_text(encoding="latin-1"))
            except OSError:
                continue
            if match and int(match[0]) != os.getpid() and (root / "proc" / match[0]).is_dir():
                return _program(match[0], root)
    return None


def _with_open_file(port: str, root: Path) -> User | None:
    """A process that has a port open, but not the far side of a pseudo-terminal: it serves the port."""
    device = os.path.realpath(port)
    for process in _processes(root):
        if int(process.name) != os.getpid():
            files = dict(_open_files(process))
            if device in files.values() and not _serves(process, files, device):
                return _program(process.name, root)
    return None


def _open_files(process: Path) -> Iterator[tuple[str, str]]:
    """The number and the target of each open file of a process; none where this account may not know."""
    with contextlib.suppress(OSError):
        for link in (process / "fd").iterdir():
            with contextlib.suppress(OSError):
                yield link.name, os.readlink(link)


def _serves(process: Path, files: dict[str, str], device: str) -> bool:
    """Whether a process has the far side of this pseudo-terminal."""
    if not device.startswith(TERMINALS):
        return False
    for number, target in files.items():
        if target in ("/dev/ptmx", "/dev/pts/ptmx"):
            with contextlib.suppress(OSError):
                text = (process / "fdinfo" / number).read_text()
                if re.search(rf"^tty-index:\s*{device.removeprefix(TERMINALS)}$", text, re.M):
                    return True
    return False


def _program(pid: str, root: Path) -> User:
    try:
        name = (root / "proc" / pid / "comm").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        name = ""
    return User(name, int(pid))
