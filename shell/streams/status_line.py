"""The last line of a terminal that is written again and again: the progress of what runs."""

from __future__ import annotations

import contextlib
import sys
from shutil import get_terminal_size

from multidrop.dialects.text import visible
from multidrop.shell.streams.output_streams import Outlet


class StatusLine:
    """A line on standard error, where that is a terminal; elsewhere it shows nothing. Erase it before other lines."""

    def __init__(self) -> None:
        self._shown = 0
        """The number of characters that are on the screen."""

    def show(self, text: str) -> None:
        """Show a text in place of the last one; a terminal that does not keep up is spared."""
        if not sys.stderr.isatty() or (isinstance(sys.stderr, Outlet) and sys.stderr.lane.behind):
            return
        line = visible(text)[: max(1, get_terminal_size().columns - 1)]
        self._put(f"\r{line.ljust(self._shown)}")
        self._shown = len(line)

    def erase(self) -> None:
        """Leave an empty line, with the cursor at its beginning."""
        if self._shown:
            self._put(f"\r{' ' * self._shown}\r")
            self._shown = 0

    @staticmethod
    def _put(text: str) -> None:
        with contextlib.suppress(OSError, ValueError):  # a reader that went away; the next line reports it
            sys.stderr.write(text)
            sys.stderr.flush()
