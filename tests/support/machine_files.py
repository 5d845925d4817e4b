"""The files of an imaginary machine that tell which program has which file open."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest


class Machine:
    """The files of an imaginary machine."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for folder in ("proc", "run/lock", "var/lock/lockdev"):
            (root / folder).mkdir(parents=True)

    def process(self, pid: int, name: str, *files: str, line: str = "") -> Path:
        """Start a process that has some files open."""
        folder = self.root / "proc" / str(pid)
        (folder / "fd").mkdir(parents=True)
        (folder / "fdinfo").mkdir()
        (folder / "comm").write_text(f"{name}\n")
        (folder / "cmdline").write_bytes((line or name).replace(" ", "\0").encode() + b"\0")
        for number, file in enumerate(files, 3):
            (folder / "fd" / str(number)).symlink_to(file)
        return folder

    def lock(self, name: str, pid: str, folder: str = "run/lock") -> None:
        (self.root / folder / name).write_text(pid)


def hide(monkeypatch: pytest.MonkeyPatch, *pids: int) -> None:
    """Make processes those of another account."""
    every = Path.iterdir

    def listed(path: Path) -> Iterator[Path]:
        if path.name == "fd" and int(path.parent.name) in pids:
            raise PermissionError(path)
        return every(path)

    monkeypatch.setattr(Path, "iterdir", listed)
