"""The terminal under the app: where the stop is found. Its output side is `tui.screenwriter`.

The stop key is looked for in the bytes as they come from the terminal, before anything is parsed and before any queue:
inside a paste that never ended, after half an escape sequence, under any dialog. The thread that reads writes the stop
itself, whatever the event loop is doing; the app is then called in the loop.
The rest of what is typed is parsed there in slices (`tui.keystream`), so no amount of it stands in front of a stop.
"""

from __future__ import annotations

import os
import select
import selectors
from functools import partial
from typing import Any, Protocol, cast

from textual import events
from textual.message import Message

from tui.keystream import STOP, KeyStream
from tui.screenwriter import ScreenWriter


class Owner(Protocol):
    """What the terminal tells its app."""

    def stop_ahead(self) -> None:
        """Write the stop onto the wires. Called in the thread that reads; `stop_all` follows in the loop."""

    def stop_all(self) -> None:
        """The stop key was pressed."""

    def interrupted(self) -> None:
        """The terminal is gone."""

    def say(self, text: str, mark: str = ".") -> None:
        """Show a line to the person at the terminal."""


class Terminal(ScreenWriter):
    """A terminal on POSIX."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.keys = KeyStream(self.process_message, partial(cast(Owner, self._app).say, mark="!"), self._more)

    def run_input_thread(self) -> None:
        """Read until the app ends, and look for the stop. Runs in a thread of its own; the loop does the rest."""
        app = cast(Owner, self._app)
        with selectors.SelectSelector() as selector:
            selector.register(self.fileno, selectors.EVENT_READ)
            while not self.exit_event.is_set():
                if not selector.select(0.1):
                    continue
                try:
                    data = os.read(self.fileno, 4096)
                except OSError:
                    data = b""
                if not data:
                    self._loop.call_soon_threadsafe(app.interrupted)
                    return
                if STOP in data:
                    app.stop_ahead()
                    self._loop.call_soon_threadsafe(app.stop_all)
                self._loop.call_soon_threadsafe(self.keys.take, data)

    def _more(self) -> bool:
        """Whether the terminal has sent bytes that were not read yet."""
        try:
            return bool(select.select([self.fileno], [], [], 0)[0])
        except (OSError, ValueError):
            return False  # it is gone, and the thread says so

    def send_message(self, message: Message) -> None:
        """Hand a message to the app, in whose loop we are."""
        self._app.post_message(message)

    def process_message(self, message: Message) -> None:
        """Keep the answers to our cursor queries; everything else is the app's."""
        if isinstance(message, events.CursorPosition):
            self.pace.answered()
        else:
            super().process_message(message)
