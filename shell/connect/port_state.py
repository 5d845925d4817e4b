"""What is kept of a port in the state folder, for the next session that opens it, should this one not end well.

Theory of operation. Two files for a port. `NAME.line` is locked for as long as a session has the port open, and holds
the line that may move something while it is on its way to the drives: what stands there when the lock can be had was
cut off with its session. It is written in place and not synced, which costs microseconds: it outlives the process, not
the machine. `NAME.json` holds the echo modes that are to be restored in drives; it is replaced as a whole and synced
before such a mode is changed. Without a folder that can be written a session works all the same, which is said once it
matters.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, fields
from pathlib import Path
from urllib.parse import quote

from dialects import DriveState, Owed

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

LINE = 128
"""Bytes of `NAME.line`: more than a line has, then zeros."""
MOST = 64
"""Drives that are kept for a port; the oldest are forgotten."""
LONGEST_NAME = 100
LOST = "what a session that is cut off leaves behind on this port cannot be put right by the next one"


class PortState:
    """What the last session has left behind on a port, and a `Keeper` for this one.

    `cut` is the line that it was sending, `owed` what it did not put back; `remarks` are what a person should know.
    """

    def __init__(self, folder: Path, port: str) -> None:
        self.cut = ""
        self.owed: tuple[Owed, ...] = ()
        self.remarks: list[str] = []
        self.notify: Callable[[str], None] = self.remarks.append
        self._port = port
        self._base = folder / "ports" / _file_name(port)
        self._line = -1
        self._shared = False
        """Another session has the port open too, and keeps what it leaves behind."""
        self._why = ""
        """Why nothing can be kept, until that was told."""
        self._writing = asyncio.Lock()
        try:
            self._line = self._locked()
        except BlockingIOError:
            self._shared, self._why = True, f"another session uses {port} too"
        except OSError as problem:
            self._why = f"{self._base.parent} cannot be used ({problem.strerror or problem})"
        else:
            self._load()

    async def owes(self, known: DriveState) -> None:
        """Write down what is to be put back in this drive, or that nothing is."""
        if known.restore:
            self._miss()
        if self._line < 0 or not known.product:
            return
        async with self._writing:
            owed = [each for each in self.owed if not (each.like(known) and each.serial == known.serial)]
            owed += [known.restore] if known.restore else []
            if tuple(owed) == self.owed:
                return
            self.owed = tuple(owed[-MOST:])
            problem = await asyncio.to_thread(self._save)
        if problem:
            self._give_up(problem)

    def begun(self, line: str) -> None:
        """A line that may move something begins to leave."""
        if not self._shared:
            self._miss()
        self._mark(line.encode("latin-1", "replace"))

    def ended(self) -> None:
        """The drives have had it whole, or have overflowed."""
        self._mark(b"")

    def close(self) -> None:
        """Let go of the port; a line that has begun and not ended stays written down."""
        if self._line >= 0:
            os.close(self._line)
            self._line = -1

    def _mark(self, line: bytes) -> None:
        if self._line < 0:
            return
        try:
            _write_at_start(self._line, line[:LINE].ljust(LINE, b"\0"))
        except OSError as problem:
            self._give_up(problem.strerror or str(problem))

    def _give_up(self, why: str) -> None:
        """The disk is full, or gone: go on without, and say so once."""
        if self._line >= 0:
            os.close(self._line)
            self._line = -1
            self._why = f"{self._base.parent} cannot be written ({why})"
            self._miss()

    def _miss(self) -> None:
        """Say, once and when it matters, that nothing can be kept."""
        if self._why:
            self.notify(f"{self._why}: {LOST}")
            self._why = ""

    def _locked(self) -> int:
        """The descriptor of `NAME.line`, locked; what stands in it is the line that was cut off. Raises OSError."""
        self._base.parent.mkdir(parents=True, exist_ok=True)
        line = os.open(f"{self._base}.line", os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o600)
        try:
            _lock(line)
            self.cut = _printable(os.read(line, LINE).rstrip(b"\0"))
            if not self.cut:
                _write_at_start(line, b"\0" * LINE)
        except OSError:
            os.close(line)
            raise
        return line

    def _load(self) -> None:
        path = Path(f"{self._base}.json")
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            self.owed = tuple(_owed(each) for each in found["owed"])[-MOST:]
        except FileNotFoundError:
            return
        except OSError as problem:
            self.remarks.append(f"{path} cannot be read ({problem.strerror or problem}) and is passed over")
        except (ValueError, TypeError, KeyError, RecursionError):
            self.remarks.append(f"{path} is damaged and is passed over; delete it")

    def _save(self) -> str:
        """Replace `NAME.json`, or delete it; what went wrong, in words. In a thread: a sync takes its time."""
        path, new = Path(f"{self._base}.json"), Path(f"{self._base}.{os.getpid()}.new")
        try:
            if self.owed:
                text = json.dumps({"port": self._port, "owed": [asdict(each) for each in self.owed]}, indent=1)
                _write_synced(new, text + "\n")
                new.replace(path)
            else:
                path.unlink(missing_ok=True)
            _sync_folder(path.parent)
        except OSError as problem:
            with contextlib.suppress(OSError):
                new.unlink(missing_ok=True)
            return problem.strerror or str(problem)
        return ""


def _owed(row: object) -> Owed:
    """A drive of the file. Raises ValueError."""
    wanted = {field.name: int if field.name == "em" else str for field in fields(Owed)}
    if not isinstance(row, dict) or {key: type(value) for key, value in row.items()} != wanted:
        raise ValueError(row)
    if row["em"] not in range(4):
        raise ValueError(row)
    return Owed(**row)


def _file_name(port: str) -> str:
    name = quote(port, safe="")
    if len(name) > LONGEST_NAME:
        name = f"{name[:LONGEST_NAME]}-{hashlib.sha256(port.encode()).hexdigest()[:12]}"
    return name


def _printable(line: bytes) -> str:
    return "".join(each if each.isprintable() else "?" for each in line.decode("latin-1"))


def _write_at_start(descriptor: int, data: bytes) -> None:
    os.lseek(descriptor, 0, os.SEEK_SET)
    os.write(descriptor, data)


def _write_synced(path: Path, text: str) -> None:
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """A name lasts when its folder is synced; Windows knows no such thing."""
    if sys.platform != "win32":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _lock(descriptor: int) -> None:
    """Have the file for this process alone, until it ends. Raises BlockingIOError where another one has it."""
    if sys.platform == "win32":
        os.lseek(descriptor, LINE, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except PermissionError as held:
            raise BlockingIOError from held
        finally:
            os.lseek(descriptor, 0, os.SEEK_SET)
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
