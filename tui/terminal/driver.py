"""The input side of the terminal: it finds the stop. The output side is `tui.terminal.screenwriter`.

It looks for the stop key in the bytes as they arrive, before any parser and any queue: inside an endless paste, after
half an escape sequence, under any dialog. The reading thread itself writes the stop, whatever the event loop is doing;
then the app is called in the loop. `tui.terminal.keystream` parses all other input there in slices, so no amount of it
delays a stop.
"""

from __future__ import annotations

import os
import select
import selectors
import sys
import termios
import tty
from contextlib import suppress
from functools import partial
from typing import Any, Protocol, cast

from textual import events
from textual.message import Message

from multidrop.shell.front import raw_terminal
from multidrop.tui.terminal.keystream import STOP, KeyStream
from multidrop.tui.terminal.screenwriter import ScreenWriter

assert sys.platform != "win32"

FULL_SCREEN = "\x1b[?1049h\x1b[?1004h"
"""Switch to the alternate screen, and report changes of the focus."""


class Owner(Protocol):
    """The functions of the app that the terminal calls."""

    def stop_ahead(self) -> None:
        """Write the stop to the wires. Called in the reading thread; `stop_all` follows in the loop."""

    def stop_all(self) -> None:
        """Handle the stop key."""

    def interrupted(self) -> None:
        """Handle the loss of the terminal."""

    def dropped(self, text: str) -> None:
        """Report a text that was typed before a stop and not parsed; a NUL in it is a key that is not text."""

    def show_line(self, text: str, mark: str = ".") -> None:
        """Show a line to the person at the terminal."""

    def terminal_ready(self) -> None:
        """Paint what waits for the terminal, which has swallowed the last frame."""


class Terminal(ScreenWriter):
    """A terminal on POSIX."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        app = cast(Owner, self._app)
        self.keys = KeyStream(self.process_message, partial(app.show_line, mark="!"), app.dropped, self._more)

    def _sigcont_application(self, *_: object) -> None:
        """Handle SIGCONT in the loop: a signal handler may run while the writer's lock is held."""
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._continued)

    def _continued(self) -> None:
        """Take the terminal back from the shell, whose settings would delay the stop key until Enter.

        Reader and writer still run, unless this driver has released the terminal before. Textual would start them
        again: then two threads would read by turns, and keys would overtake each other.
        """
        if not self._auto_restart:
            return
        if self._must_signal_resume:
            self.resume_application_mode()
        elif raw_terminal.in_foreground(self.fileno):
            self._take_again()

    def _take_again(self) -> None:
        with suppress(termios.error):  # it has hung up, which the reader reports
            held = termios.tcgetattr(self.fileno)
            held[tty.LFLAG] = self._patch_lflag(held[tty.LFLAG])
            held[tty.IFLAG] = self._patch_iflag(held[tty.IFLAG])
            held[tty.CC][termios.VMIN] = 1
            termios.tcsetattr(self.fileno, termios.TCSANOW, held)
        self.write(FULL_SCREEN)
        self._disable_line_wrap()
        self.repaint()

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
                self._loop.call_soon_threadsafe(self._take, data)

    def _take(self, data: bytes) -> None:
        """Take bytes that were read: first a stop in them, then the rest."""
        if STOP in data:
            cast(Owner, self._app).stop_all()
        self.keys.take(data)

    def _more(self) -> bool:
        """True if the terminal has sent bytes that were not read yet."""
        try:
            return bool(select.select([self.fileno], [], [], 0)[0])
        except (OSError, ValueError):
            return False  # it is gone, which the reader reports

    def send_message(self, message: Message) -> None:
        """Hand a message to the app, whose loop runs this."""
        self._app.post_message(message)

    def process_message(self, message: Message) -> None:
        """Keep the answers to our cursor queries; hand all other messages to the app."""
        if isinstance(message, events.CursorPosition):
            self.pace.answered()
            cast(Owner, self._app).terminal_ready()
        else:
            super().process_message(message)
