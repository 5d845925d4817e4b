"""The file with which a table of settings is compared: read in a thread, and read again before its values are used."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Protocol

from multidrop.base.errors import Diagnostic
from multidrop.dialects.values import Value
from multidrop.drives.drive import Drive
from multidrop.shell.params import file as files

Column = tuple[str, dict[str, Value]]
"""The name of the other side of a comparison, and its values."""


class EditedSettings(Protocol):
    """The table of settings, as far as a file needs it."""

    other: Column | None
    at: int

    def compare(self, name: str, values: dict[str, Value]) -> None:
        """Show the other side of a comparison."""


class FileColumn:
    """The file of a comparison. `say` shows a line, `run` runs work in the background; `table` gives the table."""

    def __init__(
        self,
        table: Callable[[], EditedSettings],
        say: Callable[[str], None],
        run: Callable[[Coroutine[Any, Any, None]], object],
    ) -> None:
        self._table, self._say, self._run = table, say, run
        self._file: files.SettingsFile | None = None
        self._column: Column | None = None

    def show(self, path: str, drive: Drive | None, done: Callable[[], None]) -> None:
        """Compare with a file; `done` is called once it is shown. `drive`: the one whose settings the table has."""
        self._run(self._load(path, drive, done))

    def look(self) -> None:
        """Read the file again if it is what the table is compared with."""
        if self._file is not None and self._table().other is self._column:
            self._run(self._load_again(self._file))

    async def _load(self, path: str, drive: Drive | None, done: Callable[[], None]) -> None:
        table = self._table()
        try:
            settings_file = await asyncio.to_thread(files.load, path)
            language = drive.family.values.parameters.language if drive is not None else ""
            if language and settings_file.language and settings_file.language != language:
                raise Diagnostic(f"has settings in {settings_file.language}, this drive has {language}", path)
        except Diagnostic as failure:
            self._say(f"nothing was sent: {failure}")
            return
        if self._table() is table:  # else another drive is shown by now
            self._take(settings_file)
            done()

    async def _load_again(self, file: files.SettingsFile) -> None:
        column = self._column
        try:
            now, said = await asyncio.to_thread(files.load, file.path), ""
        except Diagnostic as failure:
            now, said = file, f"{failure}; the values shown are those that it had"
        table = self._table()
        if table.other is not column:
            return
        if now != file:
            at = table.at
            self._take(now)
            table.at, said = at, f"{file.path} has changed on the disk: it was read again"
        if said:
            self._say(said)

    def _take(self, file: files.SettingsFile) -> None:
        table = self._table()
        table.compare(file.path.rpartition("/")[2], dict(file.named))
        self._file, self._column = file, table.other
