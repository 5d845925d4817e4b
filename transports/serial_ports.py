"""The serial ports of this machine, and the programs that have them open."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

_LINKS = ("dev/serial/by-id", "dev/serial/by-path")


@dataclass(frozen=True)
class PortInfo:
    """A port: its current name, its stable name, and a description."""

    device: str
    stable_name: str = ""
    """A link that follows the adapter, or else the socket that it is plugged into; empty if there is none."""
    description: str = ""


def list_ports(root: Path = Path("/")) -> list[PortInfo]:
    """List the ports in the order of their numbers. `root` is the folder of `dev` and `sys`."""
    from serial.tools import list_ports as pyserial

    stable = _stable_names(root)
    found = [
        PortInfo(
            port.device,
            stable.get(os.path.realpath(port.device), ""),
            "" if port.description in (None, "n/a") else str(port.description),
        )
        for port in pyserial.comports()
        if _has_hardware(port.device, root)
    ]
    return sorted(found, key=lambda port: natural(port.device))


def stable_name(device: str, root: Path = Path("/")) -> str:
    """Return the stable name of a port, or the given one if it has none."""
    return _stable_names(root).get(os.path.realpath(device), os.path.abspath(device) if "/" in device else device)


def natural(name: str) -> list[tuple[int, str]]:
    """A sort key that puts COM9 before COM10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", name)]


def _has_hardware(device: str, root: Path) -> bool:
    """True if a port has a chip: Linux creates some `ttyS` without one, and gives them type 0."""
    try:
        return (root / "sys/class/tty" / Path(device).name / "type").read_text().strip() != "0"
    except OSError:
        return True


def _stable_names(root: Path) -> dict[str, str]:
    names: dict[str, str] = {}
    for folder in _LINKS:
        for link in _entries(root / folder):
            names.setdefault(os.path.realpath(link), str(link))
    return names


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def holder(device: str, root: Path = Path("/")) -> str:
    """The program that has a port open, as `name (pid n)`; empty if none is known.

    Looked at: the locks of the kernel, lock files, and on Linux the open files of every process that may be read. It
    takes a few milliseconds. `root` is the folder of `proc` and `var`.
    """
    if sys.platform == "win32":
        return ""
    else:
        return lock_owner(device) or _with_lock_file(device, root) or _with_open_file(device, root)


def lock_owner(port: str) -> str:
    """The program that has locked this port, as `name (pid n)`; empty if unknown (only Linux reports it)."""
    if sys.platform == "win32":
        return ""
    else:
        try:
            node = os.stat(port)
            locks = Path("/proc/locks").read_text()
        except OSError:
            return ""
        place = f"{os.major(node.st_dev):02x}:{os.minor(node.st_dev):02x}:{node.st_ino}"
        for line in locks.splitlines():
            fields = line.split()
            if len(fields) > 5 and fields[1] == "FLOCK" and fields[5] == place and fields[4] != "0":
                return "this program itself" if int(fields[4]) == os.getpid() else _program(fields[4], Path("/"))
        return ""


def _with_lock_file(device: str, root: Path) -> str:
    """The program of a UUCP lock file, as minicom and picocom leave it; empty if that has ended."""
    name = f"LCK..{Path(os.path.realpath(device)).name}"
    for folder in ("run/lock", "var/lock", "var/lock/lockdev"):
        try:
            found = re.search(r"\d+", (root / folder / name).read_text(encoding="latin-1"))
        except OSError:
            continue
        if found and (root / "proc" / found[0]).is_dir():
            return _program(found[0], root)
    return ""


def _with_open_file(device: str, root: Path) -> str:
    port = os.path.realpath(device)
    for process in _entries(root / "proc"):
        if process.name.isdigit() and int(process.name) != os.getpid():
            for link in _entries(process / "fd"):
                with contextlib.suppress(OSError):
                    if os.readlink(link) == port:
                        return _program(process.name, root)
    return ""


def _program(pid: str, root: Path) -> str:
    try:
        name = (root / "proc" / pid / "comm").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return f"pid {pid}"
    return f"{name} (pid {pid})"
