"""The terminal: its input side finds the stop, and its output side never waits.

The input side looks for the stop key in the bytes as they arrive, before any parser and any queue: inside an endless
paste, after half an escape sequence, under any dialog. The reading thread itself writes the stop, whatever the event
loop is doing; then the app is called in the loop. `tui.terminal.keystream` parses all other input there in slices, so
no amount of it delays a stop.

A thread writes to the terminal, and no frame waits in a queue for it. A frame goes out only when the terminal has
swallowed the one before (`tui.frame_scheduler`). So a link that carries ten frames a second gets ten, the newest each
time, and a key typed in between is shown after one frame, not after thirty. If Textual paints while the terminal
accepts nothing, the writer drops frames, and repaints the whole screen once the terminal accepts output again. The
event loop never waits for the terminal.
"""

from __future__ import annotations

import os
import re
import select
import selectors
import shutil
import signal
import struct
import sys
import time
from contextlib import suppress
from functools import partial
from typing import Any, Protocol, cast

from rich.color import ColorSystem
from textual import events
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.geometry import Offset, Size
from textual.message import Message

from multidrop.base.isolation import isolated
from multidrop.shell.streams.output_streams import descriptor_writer
from multidrop.shell.threads import Loss
from multidrop.tui.frame_scheduler import TerminalPace
from multidrop.tui.terminal.canvas import Canvas, pieces_of
from multidrop.tui.terminal.keystream import STOP, KeyStream

if sys.platform == "win32":
    from textual.drivers.windows_driver import WindowsDriver as PlatformDriver

    from multidrop.shell.console import Console
else:
    import fcntl
    import termios
    import tty

    from textual.drivers.linux_driver import LinuxDriver as PlatformDriver

    from multidrop.shell.prompt import raw_terminal

CURSOR_QUERY = "\x1b[6n"
KEYBOARD_PROTOCOL = re.compile("\x1b\\[[<>][0-9]*u")
HIDDEN_CURSOR = "\x1b[?25l"
COLOURS = {"standard": ColorSystem.STANDARD, "256": ColorSystem.EIGHT_BIT, "truecolor": ColorSystem.TRUECOLOR}
"""Ranges of colours, by the name that rich gives a terminal's."""
AT_THE_END = 1.0
"""Seconds that the terminal gets at the end to take its output."""
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


class Terminal(PlatformDriver):
    """A terminal, or a console of Windows. Its `write` never waits; `pace` gets the terminal's replies."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        app = cast(Owner, self._app)
        self.keys = KeyStream(self.process_message, partial(app.show_line, mark="!"), app.dropped, self._more)

    # Output

    def start_application_mode(self) -> None:
        stream = sys.__stdout__
        assert stream is not None, "there is a terminal"
        self._encoding, self._descriptor = stream.encoding, stream.fileno()
        self._out = descriptor_writer(self._descriptor, self._takes_again, lambda problem: None)
        self.pace = TerminalPace(time.monotonic, self._handed_over)
        self._leaving = False
        self._mouse_on = True
        self._canvas = Canvas(COLOURS.get(self._app.console.color_system or ""))
        if sys.platform == "win32":
            self._console = Console(sys.__stdin__.fileno(), self._came, self._sized, signals=False)  # type: ignore[union-attr]
            self._console.__enter__()
            self.write(f"{FULL_SCREEN}{HIDDEN_CURSOR}")
            self._disable_line_wrap()
            self._enable_mouse_support()
            self._enable_bracketed_paste()
            self._sized()
        else:
            super().start_application_mode()  # type: ignore[no-untyped-call]

    @property
    def _reads_on(self) -> bool:
        """The app has ended, and the keys are read until `release`."""
        return bool(getattr(self._app, "stops_to_the_end", False)) and self._app._exit

    def stop_application_mode(self) -> None:
        self._leaving = True
        if sys.platform != "win32" and self._reads_on:
            self._attributes, self.attrs_before = self.attrs_before, None
        super().stop_application_mode()

    def release(self) -> None:
        """End the reading, once nothing is left that a stop could stop, and give the terminal back."""
        if not self._reads_on:
            return
        if sys.platform == "win32":
            self._console.end()
            self._console.__exit__(None, None, None)
        else:
            self.exit_event.set()
            if self._key_thread is not None:
                self._key_thread.join()
            while self._more() and (data := self._read()):
                self._take(data)
            self.keys.finish()
            if self._attributes is not None:
                with suppress(termios.error):  # it has hung up
                    termios.tcsetattr(self.fileno, termios.TCSANOW, self._attributes)

    def close(self) -> None:
        super().close()
        until = time.monotonic() + AT_THE_END
        while not self._out.idle and time.monotonic() < until:
            time.sleep(0.005)
        self._out.give_up()
        if sys.platform == "win32" and not self._reads_on:
            self._console.__exit__(None, None, None)

    def write(self, data: str) -> None:
        """Queue output, or drop it if the terminal takes none.

        The extended keyboard protocol is not requested: it would turn the stop into an escape sequence of eight bytes,
        which may arrive late, or in pieces, over ssh and tmux.
        """
        if not KEYBOARD_PROTOCOL.fullmatch(data):
            self._out.put(data.encode(self._encoding, "replace"), keep=self._leaving)

    def show(self, update: ChopsUpdate | LayoutUpdate, size: Size, cursor: Offset) -> str:
        """Return what shows a picture of the compositor, with the cursor at its place; empty if it is shown already.

        At its end the terminal is asked to reply, which it does once it has processed the picture.
        """
        drawn = self._canvas.draw(pieces_of(update), size.width, size.height)
        if not drawn:
            return ""
        query = CURSOR_QUERY if self.pace.ask() else ""
        return f"{drawn}\x1b[{cursor.y + 1};{cursor.x + 1}H{query}"

    def ready(self) -> bool:
        """True if the terminal has swallowed what it was sent."""
        return self.pace.ready()

    def resized(self) -> None:
        """Paint all: a terminal that is resized cuts its lines or wraps them, even if it has its old size again."""
        self._canvas.forget()
        self._app.refresh(layout=True)

    def mouse(self, on: bool) -> None:
        """Take the mouse, or leave it to the terminal's own selection."""
        self._mouse_on = on
        if on:
            self._enable_mouse_support()
        else:
            self._disable_mouse_support()
        self.flush()

    def _handed_over(self) -> bool:
        """True if the system has taken all output, and a serial line has sent it."""
        if not self._out.idle:
            return False
        if sys.platform != "win32":
            with suppress(OSError):  # else it is not a serial terminal
                return not struct.unpack("i", fcntl.ioctl(self._descriptor, termios.TIOCOUTQ, b"\0" * 4))[0]
        return True

    def _takes_again(self, loss: Loss) -> bytes:
        """Repaint when there is room again after dropped frames. Called in the writing thread."""
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self.repaint)
        return b""

    def repaint(self) -> None:
        """Paint everything: what the terminal shows is not known."""
        if not self._leaving:
            self._canvas.forget()
            self.write(HIDDEN_CURSOR)
            self._enable_bracketed_paste()
            self.mouse(self._mouse_on)
            self._app.refresh(layout=True)

    # Input

    if sys.platform == "win32":

        def disable_input(self) -> None:
            """End the reading thread."""
            self._disable_mouse_support()
            self._enable_line_wrap()
            if not self._reads_on:
                self._console.end()

        def _enable_line_wrap(self) -> None:
            self.write("\x1b[?7h")

        def _disable_line_wrap(self) -> None:
            self.write("\x1b[?7l")

        def _came(self, data: bytes) -> None:
            """Take what the console's reading thread has read; the loop does the rest."""
            app = cast(Owner, self._app)
            if STOP in data:
                with isolated("the stop key"):  # the loop stops all the same
                    app.stop_ahead()
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(*((self._take, data) if data else (app.interrupted,)))

        def _sized(self) -> None:
            size = Size(*shutil.get_terminal_size())
            with suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._app.post_message, events.Resize(size, size))

        def _more(self) -> bool:
            """True if the console has keys that were not read yet."""
            return self._console.more()

    else:
        _attributes: list[Any] | None = None
        """The terminal's own settings, while the keys are read after the end of the app."""

        def disable_input(self) -> None:
            """End the reading thread, unless it reads on."""
            if self._reads_on:
                signal.signal(signal.SIGWINCH, signal.SIG_DFL)
                self._disable_mouse_support()
            else:
                super().disable_input()

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
                    data = self._read()
                    if STOP in data:
                        with isolated("the stop key"):  # the loop stops all the same, and later keys are read
                            app.stop_ahead()
                    self._loop.call_soon_threadsafe(*((self._take, data) if data else (app.interrupted,)))
                    if not data:
                        return

        def _read(self) -> bytes:
            """Read what the terminal has sent; nothing if it is gone."""
            try:
                return os.read(self.fileno, 4096)
            except OSError:
                return b""

        def _more(self) -> bool:
            """True if the terminal has sent bytes that were not read yet."""
            try:
                return bool(select.select([self.fileno], [], [], 0)[0])
            except (OSError, ValueError):
                return False  # it is gone, which the reader reports

    def _take(self, data: bytes) -> None:
        """Take bytes that were read: first a stop in them, then the rest."""
        if STOP in data:
            cast(Owner, self._app).stop_all()
        self.keys.take(data)

    def send_message(self, message: Message) -> None:
        """Hand a message to the app, whose loop runs this."""
        self._app.post_message(message)

    def process_message(self, message: Message) -> None:
        """Keep the answers to our cursor queries; hand all other messages to the app."""
        if isinstance(message, events.CursorPosition):
            if self._reads_on:
                return
            self.pace.answered()
            cast(Owner, self._app).terminal_ready()
        else:
            super().process_message(message)
