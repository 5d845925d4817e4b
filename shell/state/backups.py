"""Backups of what drives hold of programs: one new text file each in the state folder, which can be downloaded.

A file appears whole and is on the disk when its path is returned. No file is ever replaced or deleted here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import count
from pathlib import Path
from urllib.parse import quote

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import why
from multidrop.macros.atomic import create_atomically

FOLDER = "backups"


@dataclass(frozen=True)
class Backup:
    """The content of a backup, and what its name and its first lines say of it."""

    bus: str
    address: str
    at: datetime
    described: str
    """The drive: product, version, part and serial number."""
    remark: str
    """Begins a remark in the language of the file."""
    ending: str
    """The ending of the file's name."""
    names: Sequence[str]
    """Labels and variables as the drive prints them."""
    lines: Sequence[str]
    """A file that reproduces what the drive holds; empty where that is nothing."""

    def text(self) -> str:
        """The file."""
        where = f"{self.bus}, drive {self.address}" if self.address else self.bus
        head = [f"multidrop backup of {where}, {self.at.isoformat(' ', 'seconds')}", self.described]
        head += ["names in the drive:", *(f"  {name}" for name in self.names)] if self.names else ["no names"]
        head += [] if self.lines else ["the drive holds no program and no variable"]
        return "".join(f"{line}\n" for line in (*(f"{self.remark} {line}" for line in head), *self.lines))

    def file_names(self) -> Iterator[str]:
        """The names that the file may have: date, time, bus, drive; then with a number."""
        parts = [f"{self.at:%Y-%m-%d-%H%M%S}", quote(self.bus, safe=""), quote(self.address, safe="")]
        base = "-".join(part for part in parts if part)
        yield f"{base}{self.ending}"
        yield from (f"{base}-{number}{self.ending}" for number in count(2))


def write(state: Path, backup: Backup) -> Path:
    """Write a backup into the state folder; return its absolute path. Raises Diagnostic. For a thread: it syncs."""
    folder = (state / FOLDER).absolute()
    data = backup.text().encode()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return next(path for name in backup.file_names() if _created(path := folder / name, data))
    except OSError as problem:
        hint = "nothing was sent; free the disk, or name another folder in MULTIDROP_STATE_DIR"
        raise Diagnostic(f"the backup cannot be written: {why(problem)}", str(folder), hint) from None


def _created(path: Path, data: bytes) -> bool:
    """Write a new file; return whether its name was free."""
    try:
        create_atomically(path, data)
    except FileExistsError:
        return False
    return True
