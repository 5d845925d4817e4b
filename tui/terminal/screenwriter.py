"""The terminal's output side: a thread writes to the terminal, and no frame waits in a queue for it.

A frame goes out only when the terminal has swallowed the one before (`tui.terminal.pace`). So a link that carries ten
frames a second gets ten, the newest each time, and a key typed in between is shown after one frame, not after thirty.
If Textual paints while the terminal accepts nothing, the writer drops frames, and repaints the whole screen once the
terminal accepts output again. The event loop never waits for the terminal.
"""

from __future__ import annotations

import contextlib
import re
import struct
import sys
import time

from rich.color import ColorSystem
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.drivers.linux_driver import LinuxDriver
from textual.geometry import Offset, Size

from multidrop.shell.outlets import Lane, Loss
from multidrop.tui.terminal.canvas import Canvas, pieces_of
from multidrop.tui.terminal.pace import Pace

CURSOR_QUERY = "\x1b[6n"
KEYBOARD_PROTOCOL = re.compile("\x1b\\[[<>][0-9]*u")
HIDDEN_CURSOR = "\x1b[?25l"
COLOURS = {"standard": ColorSystem.STANDARD, "256": ColorSystem.EIGHT_BIT, "truecolor": ColorSystem.TRUECOLOR}
"""Ranges of colours, by the name that rich gives a terminal's."""
AT_THE_END = 1.0
"""Seconds that the terminal gets at the end to take its output."""


class ScreenWriter(LinuxDriver):
    """A Textual driver whose `write` never waits. `pace` gets the terminal's replies."""

    def start_application_mode(self) -> None:
        """Start writing."""
        stream = sys.__stdout__
        assert stream is not None, "there is a terminal"
        self._encoding, self._descriptor = stream.encoding, stream.fileno()
        self._out = Lane(self._descriptor, self._takes_again, lambda problem: None)
        self.pace = Pace(time.monotonic, self._handed_over)
        self._leaving = False
        self._mouse_on = True
        self._canvas = Canvas(COLOURS.get(self._app.console.color_system or ""))
        super().start_application_mode()  # type: ignore[no-untyped-call]

    def stop_application_mode(self) -> None:
        """Restore the terminal."""
        self._leaving = True
        super().stop_application_mode()

    def close(self) -> None:
        """Give the output a moment to leave."""
        super().close()
        until = time.monotonic() + AT_THE_END
        while not self._out.idle and time.monotonic() < until:
            time.sleep(0.005)
        self._out.give_up()

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
        return self._out.idle and not _unsent(self._descriptor)

    def _takes_again(self, loss: Loss) -> bytes:
        """Repaint when there is room again after dropped frames. Called in the writing thread."""
        with contextlib.suppress(RuntimeError):  # the loop has ended
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


def _unsent(descriptor: int) -> int:
    """Number of bytes that a serial terminal has not sent yet; 0 if unknown."""
    if sys.platform == "win32":
        return 0
    import fcntl
    import termios

    with contextlib.suppress(OSError):
        return int(struct.unpack("i", fcntl.ioctl(descriptor, termios.TIOCOUTQ, b"\0" * 4))[0])
    return 0
