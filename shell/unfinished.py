"""Marks of downloads under way: the next session on the port names the backup where this one is killed."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

from macros.atomic import write_atomically

FOLDER = "unfinished"


@contextlib.contextmanager
def marked(state: Path, port: str, address: str, file: str, backup: Path) -> Iterator[None]:
    """Keep a mark while a download is under way; without a port there is nothing to come back to."""
    path = _folder(state, port) / f"{quote(address, safe='') or '-'}.json"
    mark = {"pid": os.getpid(), "address": address, "file": file, "backup": str(backup)}
    if port:
        with contextlib.suppress(OSError):  # the backup is on the disk, and its path on the screen
            write_atomically(path, json.dumps(mark).encode(), 0o600)
    try:
        yield
    finally:
        if port:
            with contextlib.suppress(OSError):
                path.unlink()


def left(state: Path, port: str) -> list[str]:
    """Return what killed downloads on a port have left, a line each, and forget it."""
    if not port:
        return []
    found = []
    for path in sorted(_folder(state, port).glob("*.json")):
        with contextlib.suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
            mark = json.loads(path.read_text(encoding="utf-8"))
            if _runs(int(mark["pid"])):
                continue
            path.unlink()
            who = f"{mark['address']}: " if mark["address"] else ""
            found.append(
                f"{who}the download of {mark['file']} was cut off with its session; the program may be incomplete; "
                f"what was in the drive before is in {mark['backup']}"
            )
    return found


def _folder(state: Path, port: str) -> Path:
    return state / FOLDER / quote(port, safe="")[:100]


def _runs(pid: int) -> bool:
    """Whether a process runs, as far as the system shows."""
    if sys.platform == "win32":
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return pid != os.getpid()
