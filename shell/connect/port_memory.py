"""The memory of a port in the state folder: which drives replied there last, and how they were set.

It saves time and proves nothing: a drive confirms it before anything depends on it. So it is neither locked nor synced,
and a file that cannot be read or written only costs that time. It is replaced as a whole.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path

from multidrop.dialects.state import Remembered

MOST = 64
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
        drives, baud = tuple(kept + new)[-MOST:], baud if new else self.baud
        if set(drives) != set(self.drives) or baud != self.baud:
            self.drives, self.baud = drives, baud
            self._save()

    def _load(self) -> None:
        if not self._path.is_file():  # a pipe in its place would be waited for
            return
        try:
            kept = json.loads(self._path.read_text(encoding="utf-8"))
            self.drives = tuple(_row(each) for each in kept["drives"])[-MOST:]
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
