"""Backups of texts: drafts of an editor, sources of what was downloaded, and what a drive held before a download.

The last are the user's own: they lie in the data folder, the others in the state folder.
"""

from __future__ import annotations

import contextlib
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from multidrop.base.atomic import create_atomically, make_folder
from multidrop.base.errors import Diagnostic
from multidrop.base.files import why
from multidrop.base.store import Store, digest
from multidrop.dialects.program_files import Held


class Copy(NamedTuple):
    """A text that a person wrote: its file, and the time of its download or of its last change."""

    file: str
    text: str
    at: str
    base: str = ""
    """A digest of what the file held when a draft was made; empty: not known."""

    @classmethod
    def parse(cls, found: Any) -> Copy:
        return cls(str(found["file"]), str(found["text"]), str(found["at"]), str(found.get("base", "")))


class Drafts:
    """Copies of text that was edited and not saved: a crash or a hang-up of the line loses no more than seconds.

    A copy is deleted when its text is saved or given up. It is offered when its file is opened again.
    """

    def __init__(self, state: Path) -> None:
        self._store = Store(state / "drafts", 50)

    def keep(self, draft: Copy) -> None:
        """Write a copy, whole or not at all. Raises Diagnostic. For a thread: it syncs."""
        try:
            self._store.write(self._name(draft.file), draft._asdict())
        except OSError as problem:
            raise Diagnostic(f"no copy of the text can be kept: {why(problem)}", draft.file, "save the file") from None

    def find(self, file: str) -> Copy | None:
        return self._store.find(self._name(file), Copy.parse)

    def forget(self, file: str) -> None:
        self._store.forget(self._name(file))

    def _name(self, file: str) -> str:
        return f"{digest(str(Path(file).absolute()), 24)}.json"


class Sources:
    """Copies of downloaded files, found again by what the drive then held: the remarks and the layout of an upload.

    A copy saves a person's remarks and proves nothing: it is used only where its lines are those of the drive. So a
    copy that cannot be written or read costs no more than that.
    """

    def __init__(self, state: Path) -> None:
        self._store = Store(state / "sources", 200)

    def keep(self, held: Held, source: Copy) -> None:
        """Keep the file whose download left this in the drive."""
        with contextlib.suppress(OSError):
            self._store.write(self._name(held), source._asdict())

    def find(self, held: Held) -> Copy | None:
        """Return the last downloaded file that left this in a drive; None for none."""
        return self._store.find(self._name(held), Copy.parse)

    def _name(self, held: Held) -> str:
        listing = "\n".join(f"{line.at} {line.text.upper()}" for line in held.lines)
        return f"{digest(listing, 32)}.json"


# Backups of what drives hold


def write_backup(data: Path, at: datetime, bus: str, address: str, ending: str, text: str) -> Path:
    """Write a new text file that can be downloaded; return its absolute path. Raises Diagnostic. For a thread.

    Its name has date, time, bus and drive, then a number. It appears whole and is on the disk on return. No file is
    ever replaced or deleted here.
    """
    folder = (data / "backups").absolute()
    parts = (f"{at:%Y-%m-%d-%H%M%S}", quote(bus, safe=""), quote(address, safe=""))
    name = "-".join(filter(None, parts))
    try:
        make_folder(folder)
        path, number = folder / f"{name}{ending}", 1
        while True:
            try:
                create_atomically(path, text.encode())
                return path
            except FileExistsError:
                number += 1
                path = folder / f"{name}-{number}{ending}"
    except OSError as problem:
        hint = "nothing was sent; free the disk, or name another folder in MULTIDROP_DATA_DIR"
        raise Diagnostic(f"the backup cannot be written: {why(problem)}", str(folder), hint) from None
