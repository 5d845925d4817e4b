"""The program that has a serial port open, for a person who cannot open it."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path


def holder(device: str, root: Path = Path("/")) -> str:
    """The program that has a port open, as `name (pid n)`; empty if none is known.

    Looked at: the locks of the kernel, lock files, and on Linux the open files of every process that may be read. It
    takes a few milliseconds. `root` is the folder of `proc` and `var`.
    """
    if sys.platform == "win32":
        return ""
    else:
        from multidrop.transports.serial_posix import lock_owner

        return lock_owner(device) or _with_lock_file(device, root) or _with_open_file(device, root)


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
        if not process.isdigit() or int(process) == os.getpid():
            continue
        folder = root / "proc" / process / "fd"
        if any(_target(folder / each) == port for each in _entries(folder)):
            return _program(process, root)
    return ""


def _entries(folder: Path) -> list[str]:
    try:
        return os.listdir(folder)
    except OSError:
        return []


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:
        return ""


def _program(pid: str, root: Path) -> str:
    try:
        name = (root / "proc" / pid / "comm").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return f"pid {pid}"
    return f"{name} (pid {pid})"
