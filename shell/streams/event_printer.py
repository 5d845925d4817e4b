"""A session's events as lines on the standard streams."""

from __future__ import annotations

import re
import sys
import textwrap
from typing import TextIO, cast

from multidrop.base.text import visible
from multidrop.drives.events import Unsolicited
from multidrop.shell.events import Bytes, Failed, Notified, OnBus, Output, Printed, Progressed, SessionEvent
from multidrop.shell.streams.output_streams import Colour, LineStream
from multidrop.shell.streams.stdout import StatusLine, write

_COLUMN = re.compile(r" *(?:\S(?:.*?\S)? {2,}(?=\S))?")
"""A label and the blanks after it, up to the text beside it; else the indent."""
LEAST_WIDTH = 20
"""The smallest width beside an indent; below it the indent is dropped."""


def laid_out(line: str, width: int) -> list[str]:
    """Break a line into rows of at most `width` cells; each row continues in the column of its text."""
    if len(line) <= width:
        return [line]
    match = _COLUMN.match(line)
    at = match.end() if match else 0
    if width - at < LEAST_WIDTH:
        at = min(len(line) - len(line.lstrip()), max(0, width - LEAST_WIDTH))
        if not line[:at].isspace():
            at = 0
    rows = textwrap.wrap(line[at:].lstrip(), max(1, width - at), break_on_hyphens=False) or [""]
    return [line[:at] + rows[0], *(" " * at + row for row in rows[1:])]


class EventPrinter:
    """Prints a session's events. Subscribe its `show`.

    `talkative`: print all notices and the failures of background lines; otherwise print warnings and outcomes only.
    The prompt, which is talkative, shows progress itself. `unsolicited`: print what drives send by themselves.
    `replies`: print replies; otherwise standard output belongs to a report.
    """

    def __init__(self, talkative: bool = False, unsolicited: bool = True, replies: bool = True) -> None:
        self._talkative = talkative
        self._replies = replies
        self._unsolicited = unsolicited
        self._last = ""
        self._progress = StatusLine()
        self._job = False
        """A job shows its own progress."""
        self._quiet = 0
        """The number of ticks since something was written."""

    def show(self, event: SessionEvent) -> None:
        if isinstance(event, Progressed):
            self._job = not event.over
            if event.over:
                self._progress.erase()
            elif not self._talkative:
                self._progress.show(event.text)
        elif isinstance(event, Bytes | Output | Printed | OnBus) and not self._replies:
            return
        elif isinstance(event, Bytes):
            head = f"{event.clock} {'>' if event.outgoing else '<'} "
            rows = (head + row for row in event.rows)
            self._write(sys.stderr if event.outgoing or event.watched else sys.stdout, *rows, spare=True)
        elif isinstance(event, Output | Printed | OnBus | Notified | Failed):
            self._print(event)

    def _print(self, event: Output | Printed | OnBus | Notified | Failed) -> None:
        if isinstance(event, Output) and event.columns and sys.stdout.isatty():
            from shutil import get_terminal_size

            for row in laid_out(visible(event.text, tabs=True), get_terminal_size().columns):
                self._write(sys.stdout, row)
        elif isinstance(event, OnBus):
            if self._unsolicited and isinstance(event.event, Unsolicited) and not event.event.greeting:
                self._write(sys.stdout, *event.event.lines, spare=True)
        elif isinstance(event, Output | Printed):
            self._write(sys.stdout, event.text)
        elif self._talkative or (isinstance(event, Notified) and (event.warning or event.outcome)):
            warning = Colour.WARNING if isinstance(event, Notified) and event.warning else None
            self.notify(event.text, Colour.FAILURE if isinstance(event, Failed) else warning)

    def notify(self, text: str, colour: Colour | None = None) -> None:
        """Write a line to standard error. The same line twice in a row is written once, unless talkative."""
        if text != self._last or self._talkative:
            self._last = text
            stream = sys.stderr
            if colour is not None and isinstance(stream, LineStream):
                stream = cast(TextIO, stream.coloured(colour))
            self._write(stream, text)

    def tick(self, under_way: str) -> None:
        """Show what is under way once nothing was written for two ticks."""
        self._quiet += 1
        if not self._job and self._quiet > 2:
            if under_way:
                self._progress.show(under_way)
            else:
                self._progress.erase()

    def _write(self, stream: TextIO, *lines: str, spare: bool = False) -> None:
        self._quiet = 0
        self._progress.erase()
        write(stream, *lines, spare=spare)
