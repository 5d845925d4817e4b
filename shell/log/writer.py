"""The writer of a session log: the events of a session as entries, until it is closed or a write fails."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic, Priority
from multidrop.dialects.files import why
from multidrop.dialects.text import visible
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
from multidrop.shell.log import files
from multidrop.shell.log.disk import Disk
from multidrop.shell.log.entries import BEGIN, KINDS, TRAFFIC, Entry, line_of
from multidrop.shell.openings import model

if TYPE_CHECKING:
    from multidrop.dialects import Request
    from multidrop.drives.bus import Bus
    from multidrop.shell.workspace import Workspace

LAST = 50
"""Entries that are kept for a screen."""
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
        self._last: deque[Entry] = deque(maxlen=LAST)
        self._buses: dict[str, str] = {}
        """What was last written of each bus."""
        self._departing: dict[str, Request] = {}
        """By bus, the request whose bytes are written next."""
        self._in_flight: dict[str, Request] = {}
        limits = workspace.settings.log
        head, missing = partial(self._head), partial(self._missing)
        try:
            self._disk = Disk(self.path, limits.size, limits.files, head, missing)
        except (OSError, ValueError) as problem:
            raise Diagnostic(f"cannot be written: {why(problem)}", str(path)) from None
        self._put(self._changes(workspace.now()))
        self._leave = workspace.subscribe(self._take)
        files.note(workspace.settings, self.path)

    def close(self) -> None:
        """End the log. May be called again."""
        self._leave()
        self._disk.close()

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._disk.size

    def last(self, number: int) -> list[str]:
        """The last entries of this session without traffic, a line each, oldest first."""
        kept = list(self._last)[-number:] if number > 0 else []
        return [f"{each.time:%H:%M:%S} {KINDS[each.kind]:<2} {visible(each.text)}" for each in kept]

    def _head(self) -> bytes:
        text = f"{'part' if self._begun else BEGIN} of process {files.PROCESS}"
        self._begun = True
        return line_of(self._entry(self._workspace.now(), "log", text))

    def _missing(self, number: int) -> bytes:
        text = f"{number} entries are missing here: the disk did not take them"
        return line_of(self._entry(self._workspace.now(), "missing", text, warning=True))

    def _take(self, event: SessionEvent) -> None:
        self._put(self._entries(event))
        if (problem := self._disk.problem) is not None:
            self.close()
            self._workspace.log = None
            self._workspace.notify(f"log {self.path}: {problem.strerror}; the log is off now", warning=True)
            self._workspace.changed()

    def _put(self, entries: Iterator[Entry]) -> None:
        made = list(entries)
        self._last.extend(each for each in made if each.kind not in TRAFFIC)
        if data := b"".join(map(line_of, made)):
            self._disk.put(data)

    def _entry(self, at: float, kind: str, text: str, bus: str = "", drive: str = "", **more: object) -> Entry:
        return Entry(self._workspace.wall(at), kind, text, bus, drive, **more)  # type: ignore[arg-type]

    def _entries(self, event: SessionEvent) -> Iterator[Entry]:
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
            yield from self._stopped(event.at)
            yield self._entry(event.at, kind, event.text, bus, drive, warning=warning)

    def _stopped(self, at: float) -> Iterator[Entry]:
        """The stop that came since the last entry."""
        if self._stops != self._workspace.stops:
            self._stops = self._workspace.stops
            yield self._entry(at, "stop", "stop of every drive")

    def _changes(self, at: float) -> Iterator[Entry]:
        """The buses that were opened, closed, or have other drives than before."""
        now = {name: _described(bus) for name, bus in self._workspace.buses.items()}
        for name in self._buses.keys() - now.keys():
            yield self._entry(at, "bus", "closed", name)
        for name, text in now.items():
            if self._buses.get(name) != text:
                yield self._entry(at, "bus", text, name)
        self._buses = now

    def _on_bus(self, bus: str, event: BusEvent | TwinEvent) -> Iterator[Entry]:
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
                yield Entry(wall, "unsolicited", text, bus)

    def _traffic(self, bus: str, event: Traffic) -> Entry:
        """The bytes, with the drive of the request that they are, or that is in flight."""
        request = self._departing.pop(bus, None) if event.outgoing else self._in_flight.get(bus)
        drive = request.address if request is not None else ""
        poll = request is not None and request.priority is Priority.POLL
        kind = "sent" if event.outgoing else "received"
        return self._entry(event.at, kind, event.data.decode("latin-1"), bus, drive, poll=poll)


def _described(bus: Bus) -> str:
    """The port of a bus and its drives, in a line."""
    found = ", ".join(f"{address} {model(drive)}".strip() for address, drive in bus.drives.items())
    return f"{bus.link.transport.name}: {found or 'no drive yet'}"
