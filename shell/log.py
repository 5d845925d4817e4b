"""The session log: everything typed and printed, all notices and failures, appended to a file with the time of day.

    2026-11-21T12:41:05.123 > press:b PR P
    2026-11-21T12:41:05.151 < press:b 384112

Every line is flushed. A full disk or a missing folder ends the log with one warning; the session goes on.
"""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from typing import TYPE_CHECKING

from dialects import Diagnostic
from dialects.files import why
from dialects.visible import visible
from drives.events import Unsolicited
from shell.events import Bytes, Entered, Failed, Notified, OnBus, Output, Printed, SessionEvent
from shell.lines import join_target
from shell.secrets import without_secrets

if TYPE_CHECKING:
    from shell.workspace import Workspace


class SessionLog:
    """Writes events to a file until it is closed or a write fails."""

    def __init__(self, workspace: Workspace, path: str) -> None:
        """Open the file to append to. Raises Diagnostic with its name."""
        self.path = Path(path)
        self._workspace = workspace
        try:
            self._file = open(  # noqa: SIM115
                self.path, "a", encoding="utf-8", errors="backslashreplace", opener=_without_blocking
            )
        except (OSError, ValueError) as problem:
            raise Diagnostic(f"cannot be written: {why(problem)}", path) from None
        self._gap = "\n" if _is_cut_off(self.path) else ""
        self._leave = workspace.subscribe(self._write)

    def close(self) -> None:
        """End the log. May be called again."""
        self._leave()
        with contextlib.suppress(OSError):  # a failed write was reported when it happened
            self._file.close()

    def _write(self, event: SessionEvent) -> None:
        if not (found := entries(event)):
            return
        at = event.event.at if isinstance(event, OnBus) else event.at
        stamp = self._workspace.wall(at).replace(tzinfo=None).isoformat(timespec="milliseconds")
        try:
            if not self.path.exists():
                raise FileNotFoundError(errno.ENOENT, "the file is gone")
            self._file.write(
                self._gap + "".join(f"{stamp} {visible(without_secrets(each), tabs=True)}\n" for each in found)
            )
            self._file.flush()
            self._gap = ""
        except OSError as problem:
            self.close()
            self._workspace.log = None
            self._workspace.notify(f"log {self.path}: {problem.strerror}; the log is off now", warning=True)


def _without_blocking(path: str, flags: int) -> int:
    """Open without blocking: a pipe without a reader raises OSError."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0), 0o666)


def _is_cut_off(path: Path) -> bool:
    """Whether the last line of a file has no end, as after a full disk or a power failure."""
    try:
        if not path.is_file() or not path.stat().st_size:
            return False
        with path.open("rb") as file:
            file.seek(-1, os.SEEK_END)
            return file.read(1) != b"\n"
    except OSError:
        return False


def entries(event: SessionEvent) -> list[str]:
    """An event as log lines without their time: sign, place, text; empty for one that is not logged."""
    if isinstance(event, OnBus):
        where = f"< {join_target(event.bus, '')} "
        return [where + text for text in event.event.lines] if isinstance(event.event, Unsolicited) else []
    if isinstance(event, Entered):
        where = join_target(event.bus, event.address)
        text = event.line.partition(" ")[2].strip() if event.line.startswith("@") else event.line
        return [f"> {where} {text}" if where else f"> {text}"]
    if isinstance(event, Printed):
        return [f"< {join_target(event.bus, event.address)} {event.text}"]
    if isinstance(event, Bytes):
        where = f"{'>' if event.outgoing else '<'} {join_target(event.bus, '')} "
        return [where + row for row in event.rows]
    if isinstance(event, Failed):
        return [f"! {event.text}"]
    if isinstance(event, Output | Notified):
        return [f"{'<' if isinstance(event, Output) else '*'} {event.text}"]
    return []
