"""Help at the input line and on the start page: completions, history, connections to open."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

from shell.drafts import Drafts

if TYPE_CHECKING:
    from shell.connect.settings import Settings
    from shell.session import Session


class CompletionView(Protocol):
    """A completion: `text` replaces what was typed from character `start` on."""

    @property
    def text(self) -> str:
        """The text to put in."""

    @property
    def meaning(self) -> str:
        """The meaning in one line."""

    @property
    def start(self) -> int:
        """Index of the first character that it replaces."""


class StartEntry(NamedTuple):
    """A connection that the start page offers: a saved one, a serial port, or the demo cell."""

    kind: str
    name: str
    url: str
    about: str = ""


class Assist:
    """No help: the base of all helpers."""

    def complete(self, text: str, learned: Callable[[], None] | None = None) -> Sequence[CompletionView]:
        """Complete the typed text. `learned`: a person asks; it is called when a drive has told more."""
        return ()

    def hint(self, text: str) -> str:
        """Usage and meaning of the typed text, in one line."""
        return ""

    def history(self) -> Sequence[str]:
        """Lines typed before, oldest first."""
        return ()

    def keep(self, line: str) -> None:
        """Keep a typed line for the history."""

    def saved(self) -> Sequence[StartEntry]:
        """Saved connections."""
        return ()

    async def ports(self) -> Sequence[StartEntry]:
        """Serial ports of this machine."""
        return ()

    def verbs(self) -> Sequence[tuple[str, str, str]]:
        """The host's commands: name, usage, meaning."""
        return ()

    def drafts(self) -> Drafts | None:
        """The copies of texts that were not saved; None: none are kept."""
        return None


class ShellAssist(Assist):
    """The help that the prompt gives, too."""

    def __init__(self, session: Session, settings: Settings) -> None:
        from shell.front.history import History

        self._session, self._settings = session, settings
        self._history = History(settings.history)

    def complete(self, text: str, learned: Callable[[], None] | None = None) -> Sequence[CompletionView]:
        """Complete the typed text. `learned`: a person asks; it is called when a drive has told its names."""
        from shell.front.complete import complete, names_of

        if learned is not None and (drive := names_of(self._session, text)) is not None:
            self._session.names.ask(drive, learned)
        return complete(self._session, text)

    def hint(self, text: str) -> str:
        """Usage and meaning of the typed text, in one line."""
        from shell.front.complete import hint

        return hint(self._session, text)

    def history(self) -> Sequence[str]:
        """Lines typed before, oldest first."""
        return self._history.lines()

    def keep(self, line: str) -> None:
        """Keep a typed line for the history."""
        self._history.append(line)

    def saved(self) -> Sequence[StartEntry]:
        """Saved connections."""
        return [StartEntry("saved", each.name, each.name, each.url) for each in self._settings.connections.values()]

    async def ports(self) -> Sequence[StartEntry]:
        """Serial ports of this machine, searched in a thread because the search may be slow."""
        from transports.listing import list_ports

        found = await asyncio.to_thread(list_ports)
        return [
            StartEntry(
                "port", port.device, port.stable_name or port.device, port.description or port.stable_name or "-"
            )
            for port in found
        ]

    def verbs(self) -> Sequence[tuple[str, str, str]]:
        """The host's commands: name, usage, meaning."""
        from shell.verbs.table import VERBS

        return [(verb.name, verb.usage, verb.meaning) for verb in VERBS.values()]

    def drafts(self) -> Drafts | None:
        """The copies in the folder of the state."""
        return Drafts(self._settings.state)
