"""The terminal under the app: where the stop is found, and where a slow link is noticed.

The stop key is looked for in the bytes as they come from the terminal, before anything is parsed and before any queue:
inside a paste that never ended, after half an escape sequence, under any dialog. The thread that reads writes the stop
itself, whatever the event loop is doing; the app is then called in the loop.
The rest of what is typed is parsed there in slices (`tui.keystream`), so no amount of it stands in front of a stop.

A frame goes out only when the terminal has swallowed the one before: `ready` is false from `ask` until the terminal
has answered a cursor query that was written behind the frame. So a link that carries ten frames a second gets ten, the
newest each time, and a key typed in between is shown after one frame, not after thirty. A terminal that does not answer
is asked no more.
"""

from __future__ import annotations

import os
import re
import select
import selectors
import time
from functools import partial
from typing import Any, Protocol, cast

from textual import events
from textual.drivers.linux_driver import LinuxDriver
from textual.message import Message

from tui.keystream import STOP, KeyStream

PATIENCE = 1.0
"""Seconds after which an unanswered cursor query no longer holds a frame back."""
CURSOR_QUERY = "\x1b[6n"
KEYBOARD_PROTOCOL = re.compile("\x1b\\[[<>][0-9]*u")


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


class Terminal(LinuxDriver):
    """A terminal on POSIX."""

    _asked_at: float | None = None
    _unanswered = 0
    _written = False

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
            self._asked_at, self._unanswered = None, 0
        else:
            super().process_message(message)

    def write(self, data: str) -> None:
        """Queue bytes for the terminal, unless its writer has died with the connection.

        The extended keyboard protocol is not asked for: it would turn the stop into an escape sequence of eight bytes,
        and those arrive late, or in pieces, over ssh and tmux.
        """
        if KEYBOARD_PROTOCOL.fullmatch(data):
            return
        if self._writer_thread is None or self._writer_thread.is_alive():
            self._written = True
            super().write(data)

    def ready(self) -> bool:
        """Whether the terminal has swallowed what it was sent."""
        if self._asked_at is None:
            return True
        if time.monotonic() - self._asked_at < PATIENCE:
            return False
        self._asked_at = None
        self._unanswered += 1
        return True

    def ask(self) -> None:
        """Ask the terminal to say when it has swallowed what was written; nothing is asked where nothing was."""
        if self._written and self._unanswered < 3 and self._asked_at is None:
            self._asked_at = time.monotonic()
            self.write(CURSOR_QUERY)
            self._written = False

    def mouse(self, on: bool) -> None:
        """Take the mouse, or leave it to the terminal's own selection."""
        if on:
            self._enable_mouse_support()
        else:
            self._disable_mouse_support()
        self.flush()
