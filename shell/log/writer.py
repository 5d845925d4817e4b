"""The writer of a session log: the events of a session as entries, and the file that a thread appends them to."""

from __future__ import annotations

import errno
import os
import stat
import sys
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.base.files import why
from multidrop.base.text import counted, visible
from multidrop.dialects import Kind, Priority, Request
from multidrop.drives.bus import Bus
from multidrop.drives.events import BusEvent, Ended, Sent, Traffic, Unsolicited
from multidrop.shell.events import (
    Entered,
    Failed,
    Notified,
    OnBus,
    Output,
    Printed,
    SessionEvent,
    StateChanged,
    TwinEvent,
)
from multidrop.shell.line_syntax import EVERYONE
from multidrop.shell.log import files
from multidrop.shell.log.files import BEGIN, KINDS, TRAFFIC, LogEntry, line_of
from multidrop.shell.log.index import IndexKeeper
from multidrop.shell.openings import model
from multidrop.shell.threads import BoundedWriter
from multidrop.shell.workspace import Workspace

MOST_LAST_ENTRIES = 50
"""Entries that are kept for a screen."""
COMMANDS = (Kind.COMMAND, Kind.SETTING)
_KINDS = {Printed: "printed", Output: "output", Notified: "notice", Failed: "failed"}


def begin(workspace: Workspace) -> None:
    """Begin a log in the folder of logs, if the configuration wants one for each session; warn where it cannot be."""
    if not workspace.settings.log.always:
        return
    try:
        workspace.log = SessionLog(workspace, files.fresh(workspace.settings))
    except Diagnostic as problem:
        workspace.notify(f"log: {problem}; this session has no log", warning=True)


class SessionLog:
    """Writes the events of a session to a file."""

    def __init__(self, workspace: Workspace, path: str | Path) -> None:
        """Open the file to append to. Raises Diagnostic with its name."""
        self.path = Path(path)
        self._workspace = workspace
        self._stops = workspace.stops
        self._begun = False
        self._last: deque[LogEntry] = deque(maxlen=MOST_LAST_ENTRIES)
        self._buses: dict[str, str] = {}
        """What was last written of each bus."""
        self._departing: dict[str, Request] = {}
        """By bus, the request whose bytes are written next."""
        self._in_flight: dict[str, Request] = {}
        limits = workspace.settings.log
        try:
            self._disk = Disk(self.path, limits.size, limits.files, self._head, self._missing)
        except (OSError, ValueError) as problem:
            raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
        self._put(self._changes(workspace.now()))
        self._leave = workspace.subscribe(self._take)
        files.note(workspace.settings, self.path)

    def close(self) -> None:
        self._leave()
        self._disk.close()

    @property
    def size(self) -> int:
        return self._disk.size

    def last(self, number: int) -> list[str]:
        """The last entries of this session without traffic, a line each, oldest first."""
        kept = list(self._last)[-number:] if number > 0 else []
        return [f"{entry.time:%H:%M:%S} {KINDS[entry.kind]:<2} {visible(entry.text)}" for entry in kept]

    def _head(self) -> bytes:
        text = f"{'part' if self._begun else BEGIN} of process {files.PROCESS}"
        self._begun = True
        return line_of(self._entry(self._workspace.now(), "log", text, marks=True))

    def _missing(self, number: int) -> bytes:
        text = f"{counted(number, 'entry is', 'entries are')} missing here: the disk did not take them"
        return line_of(self._entry(self._workspace.now(), "missing", text, warning=True))

    def _take(self, event: SessionEvent) -> None:
        self._put(self._entries(event))
        if (problem := self._disk.problem) is not None:
            self.close()
            self._workspace.log = None
            self._workspace.notify(f"log {self.path}: {problem.strerror}; the log is off now", warning=True)
            self._workspace.changed()

    def _put(self, entries: Iterator[LogEntry]) -> None:
        made = list(entries)
        self._last.extend(entry for entry in made if entry.kind not in TRAFFIC)
        if data := b"".join(map(line_of, made)):
            self._disk.put(data, len(made))

    def _entry(self, at: float, kind: str, text: str, bus: str = "", drive: str = "", **more: object) -> LogEntry:
        return LogEntry(self._workspace.wall(at), kind, text, bus, drive, **more)  # type: ignore[arg-type]

    def _entries(self, event: SessionEvent) -> Iterator[LogEntry]:
        if self._stops != self._workspace.stops:  # a stop came since the last entry
            self._stops = self._workspace.stops
            yield self._entry(self._workspace.stopped_at, "stop", "stop of every drive")
        if isinstance(event, OnBus):
            yield from self._on_bus(event.bus, event.event)
        elif isinstance(event, StateChanged):
            yield from self._changes(event.at)
        elif isinstance(event, Entered):
            yield self._entry(
                event.at,
                "typed",
                event.line,
                event.bus,
                event.address,
                by=event.by.value,
                raw=event.bus in self._workspace.raw,
            )
        elif (kind := _KINDS.get(type(event))) is not None:
            assert isinstance(event, Printed | Output | Notified | Failed)
            bus, drive = getattr(event, "bus", ""), getattr(event, "address", "")
            warning = isinstance(event, Notified) and event.warning
            yield self._entry(event.at, kind, event.text, bus, drive, warning=warning)

    def _changes(self, at: float) -> Iterator[LogEntry]:
        now = {name: _described(bus) for name, bus in self._workspace.buses.items()}
        for name in self._buses.keys() - now.keys():
            yield self._entry(at, "bus", "closed", name)
        for name, text in now.items():
            if self._buses.get(name) != text:
                yield self._entry(at, "bus", text, name)
        self._buses = now

    def _on_bus(self, bus: str, event: BusEvent | TwinEvent) -> Iterator[LogEntry]:
        if isinstance(event, Traffic):
            yield self._traffic(bus, event)
        elif isinstance(event, Sent):
            self._departing[bus] = self._in_flight[bus] = event.request
        elif isinstance(event, Ended):
            self._departing.pop(bus, None)
            self._in_flight.pop(bus, None)
        elif isinstance(event, Unsolicited):
            wall = self._workspace.wall(event.at)
            for text in event.lines:
                yield LogEntry(wall, "unsolicited", text, bus)

    def _traffic(self, bus: str, event: Traffic) -> LogEntry:
        """The bytes, with the drive of the request that they are, or that is in flight."""
        request = self._departing.pop(bus, None) if event.outgoing else self._in_flight.get(bus)
        drive = request.address if request is not None else ""
        poll = request is not None and request.priority is Priority.POLL
        kind, command = "sent" if event.outgoing else "received", ""
        if request is not None and event.outgoing and not poll and (request.kind in COMMANDS or drive in EVERYONE):
            command = request.text
        text = event.data.decode("latin-1")
        return self._entry(event.at, kind, text, bus, drive, poll=poll, command=command, stop=event.stop)


def _described(bus: Bus) -> str:
    """The port of a bus and its drives, in a line."""
    drives = ", ".join(f"{address} {model(drive)}".strip() for address, drive in bus.drives.items())
    return f"{bus.link.transport.name}: {drives or 'no drive yet'}"


WRITE_TIMEOUT = 0.05
"""The longest wait for a write, s."""
MOST_HELD_BYTES = 1024 * 1024
"""The largest number of bytes that wait for a slow disk."""
CLOSE_TIMEOUT = 1.0
"""The longest wait for the rest at the end, s."""
if sys.platform == "win32":
    import _winapi
    import msvcrt

_FLAGS = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def _opened(path: Path) -> int:
    """Open a file to append to it, so that another session can rename it. Raises OSError, ValueError."""
    if sys.platform == "win32":
        append, share_all, open_or_make, normal = 0x100084, 0x7, 0x4, 0x80  # FILE_APPEND_DATA, to look and to wait
        handle = _winapi.CreateFile(str(path), append, share_all, 0, open_or_make, normal, 0)
        return msvcrt.open_osfhandle(handle, os.O_APPEND)
    return os.open(path, _FLAGS, 0o666)


class Disk:
    """A file that is appended to by a thread, rotated at a size, bounded in memory.

    Theory of operation. `put` queues bytes and waits for the thread to write them, so that a crash of this program
    loses nothing that was put. A disk that takes longer than WRITE_TIMEOUT is not waited for again until it has caught
    up. Meanwhile the queue is bounded; what has no room is counted, and the file says so. Another session may write the
    same file: each write begins at its end, and a session follows the other's rotation. The index of a file ends with
    that.

    `head` makes the first bytes of each part, `missing` the bytes in place of so many dropped entries.
    """

    def __init__(
        self, path: Path, size: int, files: int, head: Callable[[], bytes], missing: Callable[[int], bytes]
    ) -> None:
        """Open the file. Raises OSError, ValueError."""
        self.size = 0
        """Bytes in the file after the last write."""
        self._path, self._size, self._files, self._head = path, size, files, head
        self._slow = False
        self._index: IndexKeeper | None = None
        """None before the first write, and once another session writes the file."""
        self._descriptor = _opened(path)
        self._regular = stat.S_ISREG(os.fstat(self._descriptor).st_mode)
        self._writer = BoundedWriter(
            self._write,
            lambda loss: missing(loss.count),
            lambda problem: self._close(),
            MOST_HELD_BYTES,
            MOST_HELD_BYTES,
            "log",
        )
        self._writer.put(self._gap() + head())

    @property
    def problem(self) -> OSError | None:
        """The reason why the file can no longer be written."""
        return self._writer.problem

    def put(self, data: bytes, count: int = 1) -> None:
        """Write `count` entries, which are whole lines. Waits for WRITE_TIMEOUT at most; does nothing after a
        problem.
        """
        caught_up = self._writer.idle
        if self._writer.put(data, count=count) and (caught_up or not self._slow):
            self._slow = not self._writer.wait(WRITE_TIMEOUT)

    def close(self) -> None:
        """Write the rest, for CLOSE_TIMEOUT at most. May be called again."""
        self._writer.close(CLOSE_TIMEOUT)

    def _write(self, data: bytes) -> int:
        rest = self._placed(data) if self._regular else data
        while rest:
            try:
                rest = rest[os.write(self._descriptor, rest) :]
            except BlockingIOError:
                raise OSError(errno.EAGAIN, "its reader does not take it") from None
        return len(data)

    def _placed(self, data: bytes) -> bytes:
        """Find or begin the part that takes these bytes; return them with the head of a new part, and their index."""
        # Another session may have rotated it: then open the path again.
        try:
            found = os.stat(self._path)
        except FileNotFoundError:
            raise FileNotFoundError(errno.ENOENT, "the file is gone") from None
        ours = os.fstat(self._descriptor)
        alone = (found.st_dev, found.st_ino) == (ours.st_dev, ours.st_ino)
        if not alone:
            self._close()
            self._descriptor = _opened(self._path)
        now = os.fstat(self._descriptor).st_size
        if not self.size:
            self._index = IndexKeeper(now)
        elif not alone or now != self.size:
            self._index = None
        if now and now + len(data) > self._size:
            data = self._rotate() + data
            now = os.fstat(self._descriptor).st_size
            if self._index is not None and not now:
                self._index.begin_part()
        if self._index is not None:
            data += self._index.take(data)
        self.size = now + len(data)
        return data

    def _rotate(self) -> bytes:
        """Begin a new part; return its first bytes. A part that cannot be renamed now is so at a later write."""
        self._close()  # Windows renames no open file
        head = b""
        try:
            if self._files == 1:
                os.truncate(self._path, 0)
            for number in range(self._files - 1, 0, -1):
                if (older := files.part(self._path, number - 1)).exists():
                    older.replace(files.part(self._path, number))
            head = self._head()
        except PermissionError:  # Windows: another program reads it
            if self._path.stat().st_size > 2 * self._size:
                raise
        self._descriptor = _opened(self._path)
        return head

    def _close(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor != -1:
            os.close(descriptor)

    def _gap(self) -> bytes:
        """The end of a last line that a full disk or a power failure cut off."""
        if not self._regular:
            return b""
        with self._path.open("rb") as file:
            if not file.seek(0, os.SEEK_END):
                return b""
            file.seek(-1, os.SEEK_END)
            return b"" if file.read(1) == b"\n" else b"\n"
