"""Help at the input line and on the start page: completions, history, connections to open."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from multidrop.shell.state.backups import Drafts
from multidrop.tui.text import ago

if TYPE_CHECKING:
    from multidrop.shell.configuration import Settings
    from multidrop.shell.prompt.complete import Completion
    from multidrop.shell.session import Session


ANY_LETTER = "P"
"""A text to complete and to explain, which imports what that needs."""
EDIT = "edit"
"""The place of an offer that leads to the editor."""
LATELY = 5
"""Number of URLs opened lately that are offered."""


class StartEntry(NamedTuple):
    """An offer of the start page: a saved connection, one opened lately, a serial port, the demo cell."""

    kind: str
    name: str
    url: str
    about: str = ""


class Assist:
    """The help that the prompt gives, too."""

    def __init__(self, session: Session, settings: Settings) -> None:
        from multidrop.shell.prompt.line_queue import History

        self._session, self._settings = session, settings
        self._history = History(settings.history)

    def complete(self, text: str, learned: Callable[[], None] | None = None) -> Sequence[Completion]:
        """Complete the typed text. `learned`: a person asks; it is called when a drive has reported its names."""
        from multidrop.shell.prompt.complete import complete, names_of

        if learned is not None and (drive := names_of(self._session, text)) is not None:
            self._session.names.ask(drive, learned)
        return complete(self._session, text)

    def hint(self, text: str) -> str:
        """Usage and meaning of the typed text, in one line."""
        from multidrop.shell.prompt.complete import hint

        return hint(self._session, text)

    def history(self) -> Sequence[str]:
        """Lines typed before, oldest first."""
        return self._history.lines()

    def keep(self, line: str) -> None:
        """Keep a typed line for the history."""
        self._history.append(line)

    def saved(self) -> Sequence[StartEntry]:
        return [
            StartEntry("saved", connection.name, connection.name, connection.url)
            for connection in self._settings.connections.values()
        ]

    def wrong(self) -> Sequence[StartEntry]:
        """The first error of the configuration; opening it edits the file at its line."""
        problems = self._settings.problems[:1]
        return [
            StartEntry("wrong", Path(problem.where).name, EDIT, f"{problem.message}; Enter edits it")
            for problem in problems
        ]

    async def ports(self) -> Sequence[StartEntry]:
        """Serial ports of this machine: who holds each, or which drives replied there last. The search may be slow."""
        return await asyncio.to_thread(_ports, self._settings.state)

    def lately(self) -> Sequence[StartEntry]:
        """URLs opened lately, the newest first; saved connections are listed themselves."""
        from multidrop.shell.state.opened import lately

        now, saved = time.time(), self._settings.connections
        openings = [recent for recent in lately(self._settings.state) if recent.url not in saved]
        return [
            StartEntry("lately", recent.url, recent.url, f"opened {ago(now - recent.at)}")
            for recent in openings[:LATELY]
        ]

    async def opened(self, url: str) -> None:
        """Keep a URL that was opened."""
        from multidrop.shell.state.opened import note

        await asyncio.to_thread(note, self._settings.state, url)

    async def scan(self, url: str, found: Callable[[str], None]) -> str:
        """Search a port for drives, without a question: at its own baud rate, then at the others. Raises Diagnostic.

        `found` gets each. Return the URL of those found.
        """
        from multidrop.shell.connect.opening import open_buses
        from multidrop.shell.connect.urls import parse
        from multidrop.shell.finding.scanning import Scanning, url_of

        opener = partial(open_buses, state=self._settings.state)
        connection = parse(url, self._settings.connections)
        scanning = Scanning(self._session, opener, connection, lambda drive: found(drive.words()))
        await scanning.run([], False)

        return url_of(scanning.found) if scanning.found else url

    def verbs(self) -> Sequence[tuple[str, str, str]]:
        from multidrop.shell.operations.table import VERBS

        return [(verb.name, verb.usage, verb.lines[0]) for verb in VERBS.values()]

    def drafts(self) -> Drafts | None:
        """The copies of texts that were not saved; None: none are kept."""
        return Drafts(self._settings.state)

    async def prepare(self) -> None:
        """Import what the first typed letter needs, in a thread; the rest depends on the drive and is less."""
        for load in (_load_completion, _load_work, _load_verbs):
            await asyncio.to_thread(load)
        self.hint(ANY_LETTER)
        self.complete(ANY_LETTER)


def _load_completion() -> None:
    from multidrop.shell.prompt import complete  # noqa: F401


def _load_work() -> None:
    from multidrop.shell.verbs import work  # noqa: F401


def _load_verbs() -> None:
    from multidrop.shell.operations.table import VERBS

    list(VERBS)


def _ports(state: Path) -> list[StartEntry]:
    from multidrop.shell.connect.schemes import local_ports
    from multidrop.shell.state.port_state import memory_of
    from multidrop.transports.port_users import holder

    entries = []
    for port in local_ports():
        memory, at = memory_of(state, port.stable_name or port.device)
        names = " ".join(filter(None, (drive.address for drive in memory.drives))) or "a drive"
        answered = f"{names} answered {ago(time.time() - at)}" if memory.drives else ""
        held = holder(port.device)
        parts = [f"✗ in use by {held}" if held else "", answered, port.description or "-", port.stable_name]
        entries.append(
            StartEntry("port", port.device, port.stable_name or port.device, "   ".join(filter(None, parts)))
        )
    return entries
