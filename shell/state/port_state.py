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
import os
import stat
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote, unquote

from multidrop.base.atomic import open_private, private_folder, safe_name, sync_folder
from multidrop.base.store import Damaged, Store, digest
from multidrop.dialects import DriveState, Owed
from multidrop.dialects.state import Remembered
from multidrop.drives.port_journal import Keeper

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

MOST_REPLIED = 64
"""The largest number of drives remembered for a port; the oldest are dropped."""
RANGES = {"checksum": range(3), "em": range(4)}
LINE = 128
"""The size of `NAME.line`, bytes: more than a line, then zeros."""
MOST_OWED_ROWS = 64
"""The largest number of drives recorded for a port; the oldest are dropped."""
LONGEST_NAME = 100
PSEUDO_TERMINALS = "/dev/pts/"
KEPT_FOR = 60 * 86400.0
"""The time for which the files of an adapter that is not there are kept, s."""
LOST = "if this session is interrupted, the next one cannot repair this port"
Row = TypeVar("Row", Owed, Remembered)


class PortMemory:
    """The memory of one port; `remark` is for a person, empty if there is nothing to say."""

    def __init__(self, path: Path) -> None:
        self.drives: tuple[Remembered, ...] = ()
        self.baud = 0
        """The baud rate at which they replied last; 0: not known, or the port has none."""
        self.remark = ""
        self._store, self._name = Store(path.parent), path.name
        try:
            self.drives, self.baud = self._store.load(self._name, self._parsed)
        except Damaged:
            self.remark = f"{path} is damaged and is ignored; multidrop writes a new one"
        except OSError:
            return

    def _parsed(self, kept: Any) -> tuple[tuple[Remembered, ...], int]:
        rows = [_row(Remembered, row, party=bool, checksum=int, em=int) for row in kept["drives"]]
        if any(row.party != bool(row.address) or len(row.address) > 1 for row in rows):
            raise ValueError(rows)
        return tuple(rows[-MOST_REPLIED:]), int(kept.get("baud", 0))

    def update(self, found: Mapping[str, Remembered | None], baud: int = 0) -> None:
        """Take over what is known of the drives at these addresses, which reply at `baud`; None forgets one.

        A port has drives in party mode or one that is not, never both.
        """
        new = [remembered for remembered in found.values() if remembered is not None]
        kept = [drive for drive in self.drives if drive.address not in found]
        if new:
            kept = [remembered for remembered in kept if remembered.party == new[0].party]
        drives, baud = tuple(kept + new)[-MOST_REPLIED:], baud if new else self.baud
        if set(drives) != set(self.drives) or baud != self.baud:
            self.drives, self.baud = drives, baud
            if self._store.folder.is_dir():
                with contextlib.suppress(OSError):
                    content = {"baud": baud, "drives": list(map(asdict, drives))}
                    self._store.write(self._name, content, 1, synced=False)


def _row(kind: type[Row], row: object, **kinds: type) -> Row:
    """Parse a drive of a file; its fields are texts but for `kinds`. Raises ValueError."""
    wanted = {field.name: kinds.get(field.name, str) for field in fields(kind)}
    if not isinstance(row, dict) or {key: type(value) for key, value in row.items()} != wanted:
        raise ValueError(row)
    if any(row[key] not in valid for key, valid in RANGES.items() if key in row):
        raise ValueError(row)
    return kind(**row)


class PortState(Keeper):
    """The record that the last session left on a port, and a `Keeper` for this one.

    `cut` is the line that it was sending, `owed` the settings that it did not restore; `remarks` are for a person.
    """

    def __init__(self, folder: Path, port: str, baud: int = 0) -> None:
        self.cut = ""
        self.owed = ()
        self.remarks: list[str] = []
        self.notify: Callable[[str], None] = self.remarks.append
        self._port, self.baud = port, baud
        self._store, self._name = Store(folder / "ports"), _file_name(folder, port)
        self._line = -1
        self._shared = False
        """Another session has the port open, too, and keeps its record."""
        self._why = ""
        """The reason why nothing can be kept, until it is published."""
        self._writing = asyncio.Lock()
        self.memory = PortMemory(self._store.folder / f"{self._name}.drives")
        """The memory of its drives."""
        if self.memory.remark:
            self.remarks.append(self.memory.remark)
        try:
            self._line = self._locked()
        except BlockingIOError:
            self._shared, self._why = True, f"another session uses {port} too"
        except OSError as problem:
            self._why = f"{self._store.folder} cannot be used ({problem.strerror or problem})"
        else:
            self._load()

    async def owes(self, known: DriveState) -> None:
        """Record the settings to restore in this drive, or that there are none."""
        if known.restore:
            self._miss()
        if self._line < 0 or not known.product:
            return
        async with self._writing:
            own = ("", known.serial)
            owed = [each for each in self.owed if not (each.like(known) and each.serial in own)]
            owed += [known.restore] if known.restore else []
            if tuple(owed) == self.owed:
                return
            self.owed = tuple(owed[-MOST_OWED_ROWS:])
            try:
                await asyncio.to_thread(self._save)
            except OSError as problem:
                self._give_up(problem.strerror or str(problem))

    def remember(self, drives: Mapping[str, Remembered | None]) -> None:
        """Remember drives by address; None forgets one. Another session that has the port open remembers its own."""
        if self._line >= 0:
            self.memory.update(drives, self.baud)

    def begun(self, line: str) -> None:
        """Record a line that may move something, as it begins to leave."""
        if not self._shared:
            self._miss()
        self._mark(line.encode("latin-1", "replace"))

    def ended(self) -> None:
        """Clear the record: the drives received the whole line, or their buffers overflowed."""
        self._mark(b"")

    def close(self) -> None:
        """Release the port; an unfinished line stays on record. Delete the records of ports that are gone."""
        if self._line >= 0:
            os.close(self._line)
            self._line = -1
            with contextlib.suppress(OSError):
                _prune(self._store.folder, time.time())

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
            self._why = f"{self._store.folder} cannot be written ({why})"
            self._miss()

    def _miss(self) -> None:
        """Publish once, when it matters, that nothing can be kept."""
        if self._why:
            self.notify(f"{self._why}: {LOST}")
            self._why = ""

    def _locked(self) -> int:
        """Lock `NAME.line` until this process ends, and read the interrupted line from it; return the descriptor.

        Raises BlockingIOError if another process holds it, OSError.
        """
        private_folder(self._store.folder)  # a record in it is to survive a power cut
        line = open_private(self._store.folder / f"{self._name}.line", os.O_RDWR | os.O_CREAT)
        try:
            if sys.platform == "win32":
                os.lseek(line, LINE, os.SEEK_SET)
                try:
                    msvcrt.locking(line, msvcrt.LK_NBLCK, 1)
                except PermissionError as held:
                    raise BlockingIOError from held
                finally:
                    os.lseek(line, 0, os.SEEK_SET)
            else:
                fcntl.flock(line, fcntl.LOCK_EX | fcntl.LOCK_NB)
            holder = os.read(line, LINE).rstrip(b"\0").decode("latin-1")
            self.cut = "".join(character if character.isprintable() else "?" for character in holder)
            if not self.cut:
                _write_at_start(line, b"\0" * LINE)
        except OSError:
            os.close(line)
            raise
        return line

    def _load(self) -> None:
        path = self._store.folder / f"{self._name}.json"
        try:
            self.owed = self._store.load(
                path.name,
                lambda found: tuple(_row(Owed, {"lines": "", **row}, em=int) for row in found["owed"])[
                    -MOST_OWED_ROWS:
                ],
            )
        except FileNotFoundError:
            return
        except OSError as problem:
            self.remarks.append(f"{path} cannot be read ({problem.strerror or problem}) and is ignored")
        except Damaged:
            self.remarks.append(f"{path} is damaged and is ignored; delete it")

    def _save(self) -> None:
        """Replace or delete `NAME.json`. Raises OSError. For a thread: a sync takes time."""
        name = f"{self._name}.json"
        if self.owed:
            self._store.write(name, {"port": self._port, "owed": list(map(asdict, self.owed))}, 1)
        else:
            (self._store.folder / name).unlink(missing_ok=True)
        sync_folder(self._store.folder)


def _prune(folder: Path, now: float) -> None:
    """Delete the files of serial ports that do not exist any more, unless a drive is owed something. Raises OSError.

    A pseudo-terminal is gone for good; an adapter may be plugged in again, so its files stay for some weeks.
    """
    for line in folder.glob("*.line"):
        port = unquote(line.name.removesuffix(".line"))
        if not port.startswith("/dev/") or os.path.exists(port) or line.with_suffix(".json").exists():
            continue
        facts = line.lstat()
        gone = port.startswith(PSEUDO_TERMINALS) or now - facts.st_mtime > KEPT_FOR
        if gone and stat.S_ISREG(facts.st_mode):
            _delete(line)


def _delete(line: Path) -> None:
    """Delete the record of a port, and the memory of its drives, unless a session uses it or was interrupted."""
    if sys.platform != "win32":
        held = open_private(line, os.O_RDWR)
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not os.read(held, LINE).strip(b"\0"):
                line.unlink()
                line.with_suffix(".drives").unlink(missing_ok=True)
        except BlockingIOError:
            return
        finally:
            os.close(held)


def memory_of(folder: Path, port: str) -> tuple[PortMemory, float]:
    """The memory of a port in the state folder, and when it was written (s since 1970; 0: never). Changes nothing."""
    path = folder / "ports" / f"{_file_name(folder, port)}.drives"
    try:
        at = path.stat().st_mtime
    except OSError:
        at = 0.0
    return PortMemory(path), at


def _file_name(folder: Path, port: str) -> str:
    """The name of a port's files: a safe one, or that of an earlier version where it has left some."""
    safe, earlier = (
        name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}-{digest(port, 12)}"
        for name in (safe_name(port), quote(port, safe=""))
    )
    kept = safe != earlier and sys.platform != "win32" and any((folder / "ports").glob(f"{earlier}.*"))
    return earlier if kept else safe


def _write_at_start(descriptor: int, data: bytes) -> None:
    os.lseek(descriptor, 0, os.SEEK_SET)
    os.write(descriptor, data)
