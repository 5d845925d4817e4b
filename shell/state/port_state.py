"""The record of a port in the state folder, for the next session if this one is interrupted.

Theory of operation. A port has three files. A session locks `NAME.line` while the port
is open. The file holds a line that may move something, while that line is being sent. A line in an unlocked file was
interrupted with its session. It is written in place and not synced, which takes microseconds: it survives the process,
not the machine. `NAME.json` holds the echo modes to restore in drives; it is replaced as a whole and synced before
such a mode is changed. Without a writable folder a session works all the same, and says so once it matters.

The third, `PortMemory`, holds which drives replied last and how they were set. It saves time and proves nothing: a
drive confirms it before anything depends on it. So it is neither locked nor synced, as the URLs opened last are not.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from urllib.parse import quote

from multidrop.dialects import DriveState, Owed
from multidrop.dialects.state import Remembered
from multidrop.drives.port_journal import Keeper
from multidrop.macros.atomic import write_atomically

MOST_REPLIED = 64
"""The largest number of drives remembered for a port; the oldest are dropped."""
RANGES = {"checksum": range(3), "em": range(4)}


class PortMemory:
    """The memory of one port; `remark` is for a person, empty if there is nothing to say."""

    def __init__(self, path: Path) -> None:
        self.drives: tuple[Remembered, ...] = ()
        self.baud = 0
        """The baud rate at which they replied last; 0: not known, or the port has none."""
        self.remark = ""
        self._path = path
        self._load()

    def update(self, found: Mapping[str, Remembered | None], baud: int = 0) -> None:
        """Take over what is known of the drives at these addresses, which reply at `baud`; None forgets one.

        A port has drives in party mode or one that is not, never both.
        """
        new = [each for each in found.values() if each is not None]
        kept = [each for each in self.drives if each.address not in found]
        if new:
            kept = [each for each in kept if each.party == new[0].party]
        drives, baud = tuple(kept + new)[-MOST_REPLIED:], baud if new else self.baud
        if set(drives) != set(self.drives) or baud != self.baud:
            self.drives, self.baud = drives, baud
            self._save()

    def _load(self) -> None:
        if not self._path.is_file():  # a pipe in its place would be waited for
            return
        try:
            kept = json.loads(self._path.read_text(encoding="utf-8"))
            self.drives = tuple(_row(each) for each in kept["drives"])[-MOST_REPLIED:]
            self.baud = int(kept.get("baud", 0))
        except OSError:
            return
        except (ValueError, TypeError, KeyError, RecursionError):
            self.remark = f"{self._path} is damaged and is ignored; multidrop writes a new one"

    def _save(self) -> None:
        kept = {"baud": self.baud, "drives": [asdict(each) for each in self.drives]}
        text = json.dumps(kept, indent=1) + "\n"
        new = self._path.with_name(f"{self._path.name}.{os.getpid()}.new")
        try:
            with open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as file:
                file.write(text)
            new.replace(self._path)
        except OSError:
            with contextlib.suppress(OSError):
                new.unlink()


def _row(row: object) -> Remembered:
    """Parse a drive of the file. Raises ValueError."""
    kinds = {"party": bool, "checksum": int, "em": int}
    wanted = {field.name: kinds.get(field.name, str) for field in fields(Remembered)}
    if not isinstance(row, dict) or {key: type(value) for key, value in row.items()} != wanted:
        raise ValueError(row)
    if any(row[key] not in valid for key, valid in RANGES.items()) or len(row["address"]) > 1:
        raise ValueError(row)
    if row["party"] != bool(row["address"]):
        raise ValueError(row)
    return Remembered(**row)


if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

LINE = 128
"""The size of `NAME.line`, bytes: more than a line, then zeros."""
MOST = 64
"""The largest number of drives recorded for a port; the oldest are dropped."""
LONGEST_NAME = 100
LOST = "if this session is interrupted, the next one cannot repair this port"


class PortState(Keeper):
    """The record that the last session left on a port, and a `Keeper` for this one.

    `cut` is the line that it was sending, `owed` the settings that it did not restore; `remarks` are for a person.
    """

    def __init__(self, folder: Path, port: str, baud: int = 0) -> None:
        self.cut = ""
        self.owed: tuple[Owed, ...] = ()
        self.remarks: list[str] = []
        self.notify: Callable[[str], None] = self.remarks.append
        self._port, self._baud = port, baud
        self._base = folder / "ports" / _file_name(port)
        self._line = -1
        self._shared = False
        """Another session has the port open, too, and keeps its record."""
        self._why = ""
        """The reason why nothing can be kept, until it is published."""
        self._writing = asyncio.Lock()
        self.memory = PortMemory(Path(f"{self._base}.drives"))
        """The memory of its drives."""
        if self.memory.remark:
            self.remarks.append(self.memory.remark)
        try:
            self._line = self._locked()
        except BlockingIOError:
            self._shared, self._why = True, f"another session uses {port} too"
        except OSError as problem:
            self._why = f"{self._base.parent} cannot be used ({problem.strerror or problem})"
        else:
            self._load()

    async def owes(self, known: DriveState) -> None:
        """Record the settings to restore in this drive, or that there are none."""
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

    def remember(self, drives: Mapping[str, Remembered | None]) -> None:
        """Remember drives by address; None forgets one. Another session that has the port open remembers its own."""
        if self._line >= 0:
            self.memory.update(drives, self._baud)

    def begun(self, line: str) -> None:
        """Record a line that may move something, as it begins to leave."""
        if not self._shared:
            self._miss()
        self._mark(line.encode("latin-1", "replace"))

    def ended(self) -> None:
        """Clear the record: the drives received the whole line, or their buffers overflowed."""
        self._mark(b"")

    def close(self) -> None:
        """Release the port; an unfinished line stays on record."""
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
        """Go on without the record after a disk error, and say so once."""
        if self._line >= 0:
            os.close(self._line)
            self._line = -1
            self._why = f"{self._base.parent} cannot be written ({why})"
            self._miss()

    def _miss(self) -> None:
        """Publish once, when it matters, that nothing can be kept."""
        if self._why:
            self.notify(f"{self._why}: {LOST}")
            self._why = ""

    def _locked(self) -> int:
        """Lock `NAME.line` and read the interrupted line from it; return the descriptor. Raises OSError."""
        self._base.parent.mkdir(parents=True, exist_ok=True)
        line = os.open(f"{self._base}.line", os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o600)
        try:
            _lock(line)
            found = os.read(line, LINE).rstrip(b"\0").decode("latin-1")
            self.cut = "".join(each if each.isprintable() else "?" for each in found)
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
            self.remarks.append(f"{path} cannot be read ({problem.strerror or problem}) and is ignored")
        except (ValueError, TypeError, KeyError, RecursionError):
            self.remarks.append(f"{path} is damaged and is ignored; delete it")

    def _save(self) -> str:
        """Replace or delete `NAME.json`; return the error in words. For a thread: a sync takes time."""
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
    """Parse a drive of the file. Raises ValueError."""
    wanted = {field.name: int if field.name == "em" else str for field in fields(Owed)}
    if not isinstance(row, dict) or {key: type(value) for key, value in row.items()} != wanted:
        raise ValueError(row)
    if row["em"] not in range(4):
        raise ValueError(row)
    return Owed(**row)


def memory_of(folder: Path, port: str) -> tuple[PortMemory, float]:
    """The memory of a port in the state folder, and when it was written (s since 1970; 0: never). Changes nothing."""
    path = Path(f"{folder / 'ports' / _file_name(port)}.drives")
    try:
        at = path.stat().st_mtime
    except OSError:
        at = 0.0
    return PortMemory(path), at


def _file_name(port: str) -> str:
    name = quote(port, safe="")
    if len(name) > LONGEST_NAME:
        import hashlib

        name = f"{name[:LONGEST_NAME]}-{hashlib.sha256(port.encode()).hexdigest()[:12]}"
    return name


def _write_at_start(descriptor: int, data: bytes) -> None:
    os.lseek(descriptor, 0, os.SEEK_SET)
    os.write(descriptor, data)


def _write_synced(path: Path, text: str) -> None:
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """Sync a folder so that its names last; Windows has no such call."""
    if sys.platform != "win32":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _lock(descriptor: int) -> None:
    """Lock the file until this process ends. Raises BlockingIOError if another process holds it."""
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


MOST_OPENED = 12


@dataclass(frozen=True)
class Opened:
    """A URL as it was typed, or the name of a saved connection, and when it was opened (s since 1970)."""

    url: str
    at: float


def lately(folder: Path) -> list[Opened]:
    """The URLs opened last, the newest first."""
    try:
        rows = json.loads(_file(folder).read_text(encoding="utf-8"))["opened"]
        return [Opened(str(row["url"]), float(row["at"])) for row in rows][:MOST_OPENED]
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return []


def note(folder: Path, url: str) -> None:
    """Note that a URL was opened now."""
    rows = [Opened(url, time.time()), *(each for each in lately(folder) if each.url != url)][:MOST_OPENED]
    text = json.dumps({"opened": [{"url": each.url, "at": each.at} for each in rows]}, indent=1) + "\n"
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(_file(folder), text.encode())


def _file(folder: Path) -> Path:
    return folder / "opened.json"
