"""The files of logs: the folder of the state, the newest one, the parts of one, and their entries."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import opened, why
from multidrop.shell.log.disk import part
from multidrop.shell.log.entries import Entry, entry_of

if TYPE_CHECKING:
    from multidrop.shell.connect.settings import Settings

PROCESS = os.getpid()
NOTED = 50
"""The number of logs outside the folder that are remembered."""
ENDING = ".jsonl"
LONGEST = 1 << 20
"""The longest line that can be an entry, bytes."""


class Line(NamedTuple):
    """A line of a log. `entry` is None where it is not one."""

    path: Path
    number: int
    data: bytes
    entry: Entry | None

    @property
    def where(self) -> str:
        """`file:line`."""
        return f"{self.path}:{self.number}"


def folder(settings: Settings) -> Path:
    """The folder of the logs that have no name of their own."""
    return settings.state / "logs"


def fresh(settings: Settings) -> Path:
    """The name of a new log in the folder; the oldest ones there give way. Raises Diagnostic."""
    place = folder(settings)
    try:
        place.mkdir(parents=True, exist_ok=True)
        _make_room(place, settings.log.size * settings.log.files)
    except OSError as problem:
        raise Diagnostic(f"cannot be written: {why(problem)}", str(place)) from None
    return place / f"{datetime.now():%Y%m%d-%H%M%S}-{PROCESS}{ENDING}"


def _make_room(place: Path, most: int) -> None:
    """Remove the oldest logs of the folder until the rest fits."""
    total = 0
    for path in sorted((each for each in place.iterdir() if ENDING in each.name), key=_changed, reverse=True):
        total += path.stat().st_size
        if total > most:
            path.unlink(missing_ok=True)


def note(settings: Settings, path: Path) -> None:
    """Remember a log outside the folder, so that the newest one is found. A folder that cannot be written is left."""
    with contextlib.suppress(OSError):
        if path.resolve().parent == folder(settings).resolve() or not path.is_file():
            return
        listed = folder(settings) / "elsewhere"
        known = [each for each in _elsewhere(settings) if each != path.resolve()]
        listed.parent.mkdir(parents=True, exist_ok=True)
        text = "".join(f"{each}\n" for each in [*known, path.resolve()][-NOTED:])
        beside = listed.with_name(f".elsewhere-{PROCESS}")
        beside.write_text(text, encoding="utf-8", errors="surrogateescape")
        beside.replace(listed)


def _elsewhere(settings: Settings) -> list[Path]:
    try:
        text = (folder(settings) / "elsewhere").read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:
        return []
    return [Path(line) for line in text.splitlines() if line]


def newest(settings: Settings) -> Path:
    """The log that was last written. Raises Diagnostic where there is none."""
    found = [path for path in _elsewhere(settings) if path.is_file()]
    with contextlib.suppress(OSError):
        found += [path for path in folder(settings).iterdir() if path.name.endswith(ENDING)]
    if not found:
        hint = "/log FILE begins one; [log] always = true in the configuration keeps one of each session"
        raise Diagnostic("no session log yet", str(folder(settings)), hint)
    return max(found, key=_changed)


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def parts(path: Path) -> list[Path]:
    """The parts of a log that exist, the oldest first."""
    # Path's own methods raise for a name that is too long.
    if os.path.isdir(path):  # it cannot be read, and `.` and `/` have no name that a number could follow
        return [path]
    number = 1
    while os.path.exists(part(path, number)):
        number += 1
    found = [part(path, each) for each in range(number - 1, -1, -1)]
    return found if number == 1 or os.path.exists(path) else found[:-1]  # rotated, and nothing written since


def lines(path: Path, offset: int = 0, number: int = 0) -> Iterator[Line]:
    """Yield the lines of one file after so many bytes and lines. Raises Diagnostic where it cannot be read."""
    try:
        with opened(path) as file:
            file.seek(offset)
            while data := file.readline(LONGEST):
                number += 1
                yield Line(path, number, data, entry_of(data) if data.endswith(b"\n") else None)
    except (OSError, ValueError) as problem:
        raise Diagnostic(f"cannot be read: {why(problem)}", str(path)) from None
