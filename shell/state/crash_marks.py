"""Marks of downloads and macros under way: the next session on the port explains them where this one is killed."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

from multidrop.base.atomic import safe_name
from multidrop.base.store import Store

if sys.platform == "win32":
    from multidrop.shell.console import runs


@contextlib.contextmanager
def marked(state: Path, port: str, address: str, file: str, backup: Path) -> Iterator[None]:
    """Keep a mark while a download is under way; without a port there is nothing to come back to."""
    who = f"{address}: " if address else ""
    text = (
        f"{who}the download of {file} was cut off with its session; the program may be incomplete; "
        f"what was in the drive before is in {backup}"
    )
    # Some disks take `a` and `A` for one name, and they are two drives.
    name = re.sub("[A-Z]", lambda found: f"%{ord(found[0]):02X}", safe_name(address))
    with _mark(state, port, name or "-", text):
        yield


@contextlib.contextmanager
def playing(state: Path, ports: Iterable[str], macro: str, begun: datetime) -> Iterator[None]:
    """Keep a mark on each port while a macro plays."""
    text = (
        f"macro {macro}, begun at {begun:%Y-%m-%d %H:%M:%S}, was cut off with its session; nothing stopped its drives: "
        "they may still move, and on_early_end was not executed"
    )
    with contextlib.ExitStack() as marks:
        for port in ports:
            marks.enter_context(_mark(state, port, f"macro-{macro}-{os.getpid()}", text))
        yield


@contextlib.contextmanager
def _mark(state: Path, port: str, name: str, text: str) -> Iterator[None]:
    """Keep a mark in the folder of a port. A disk that is full costs the mark, and ends nothing."""
    marks = _marks(state, port)
    if port:
        with contextlib.suppress(OSError):
            marks.write(f"{name}.json", {"pid": os.getpid(), "text": text})
    try:
        yield
    finally:
        if port:
            marks.forget(f"{name}.json")


def left(state: Path, port: str) -> list[str]:
    """Return what killed sessions on a port have left, a line each, and forget it."""
    if not port:
        return []

    def parse(mark: Any) -> tuple[int, str]:
        return int(mark["pid"]), str(mark["text"])

    marks, left_marks = _marks(state, port), []
    for path in sorted(marks.folder.glob("*.json")):
        mark = marks.find(path.name, parse)
        if mark is not None and not _runs(mark[0]):
            with contextlib.suppress(OSError):
                path.unlink()
                left_marks.append(mark[1])
    return left_marks


def _marks(state: Path, port: str) -> Store:
    folder = state / "unfinished"
    earlier = folder / quote(port, safe="")[:100]
    return Store(
        earlier if sys.platform != "win32" and earlier.is_dir() else folder / safe_name(port)[:100].rstrip(".")
    )


def _runs(pid: int) -> bool:
    """True if a process runs, as far as the system shows."""
    if sys.platform == "win32":
        return runs(pid) and pid != os.getpid()
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return pid != os.getpid()
