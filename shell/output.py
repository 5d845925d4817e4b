"""Where a session's events go when nobody sits at a screen: replies to standard output, everything else to the other.

Lines are flushed one by one. A reader that went away (a closed pipe, a terminal that hung up) is no reason to leave
drives half-way through something: what cannot be written is dropped. So it is on a full disk, which is told at the end.
In the event loop a slow reader is waited for by a thread only (`nonblocking`).
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import sys
from collections.abc import Callable
from typing import TextIO

from dialects import Diagnostic, DriveError, Stopped
from shell import outlets
from shell.events import Failed, Notified, Output, Printed, SessionEvent
from shell.layout import laid_out
from transports import TransportLost

CODES: tuple[tuple[type[BaseException], int], ...] = (
    (Stopped, 4),
    (DriveError, 1),
    (Diagnostic, 2),
    (TransportLost, 3),
)
"""Exit codes of what a person meets, the first that fits; 130 is an interruption."""
INTERRUPTED = 130


def exit_code(failure: BaseException) -> int:
    """The exit code that tells of a failure."""
    return next(code for kind, code in CODES if isinstance(failure, kind))


LONGEST = 800
"""Characters of a message: what somebody typed may stand in it, and be of any length."""


def report(failure: BaseException) -> str:
    """A failure as one line, behind the places that were noted on it (`file:line`)."""
    places = getattr(failure, "__notes__", [])
    return shortened(": ".join([*reversed(places), " ".join(str(failure).split("\n"))]))


def shortened(text: str) -> str:
    """A message with its middle left out where it is too long to be read; what to do stands at its end."""
    if len(text) <= LONGEST:
        return text
    half = LONGEST // 2 - 20
    return f"{text[:half]} ... ({len(text) - 2 * half} characters) ... {text[-half:]}"


CONTROLS = {code: f"\\x{code:02x}" for code in (*range(0x09), *range(0x0A, 0x20), *range(0x7F, 0xA0))}
GONE = (errno.EPIPE, errno.EIO, errno.EBADF, errno.ECONNRESET)
"""Errors of a reader that went away."""
dropped: list[str] = []
"""Why lines could not be written although somebody waits for them: a full disk."""


def write(stream: TextIO, text: str, spare: bool = False) -> None:
    """Write a line and flush it; a reader that is gone hears nothing more, and a slow one no spare lines."""
    if isinstance(stream, outlets.Outlet):
        stream.line(text, spare)
        return
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        stream.write(text.encode(encoding, "backslashreplace").decode(encoding) + "\n")
        stream.flush()
    except (OSError, ValueError) as problem:  # ValueError: the stream was closed
        lose(stream, problem)


def lose(stream: TextIO, problem: OSError | ValueError) -> None:
    """Write nothing more to a stream; where somebody waits for it all the same, keep why."""
    silence(stream)
    if isinstance(problem, OSError) and problem.errno not in GONE:
        dropped.append(f"the output cannot be written: {problem.strerror}")


def nonblocking() -> contextlib.AbstractContextManager[outlets.Streams]:
    """Have `sys.stdout` and `sys.stderr` never wait for who reads them; for use around an event loop's work."""
    return outlets.outlets(lose)


async def finish(streams: outlets.Streams, hurried: Callable[[], bool]) -> None:
    """Wait until everything is written, within limits; what a reader did not take is told at the end."""
    for late in await streams.finish(hurried):
        silence(late.stream)
        if not late.terminal and not hurried():
            dropped.append(f"the output was not read for {outlets.PATIENCE:g} s; the rest of it is lost")


def visible(text: str) -> str:
    r"""A drive's line with control characters written out (`\x1b`), so that none acts on the terminal."""
    return text.translate(CONTROLS)


def silence(stream: TextIO) -> None:
    """Send what else is written to a stream nowhere, so that neither it nor the interpreter's end fails on it."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


class Printer:
    """Prints a session's events. Subscribe its `show`.

    `talkative`: what goes on is told too, and failures of lines that run in the background; otherwise warnings only.
    """

    def __init__(self, talkative: bool = False) -> None:
        self._talkative = talkative
        self._last = ""

    def show(self, event: SessionEvent) -> None:
        """Print an event, or leave it."""
        if isinstance(event, Output) and event.columns and sys.stdout.isatty():
            for row in laid_out(visible(event.text), shutil.get_terminal_size().columns):
                write(sys.stdout, row)
        elif isinstance(event, Output | Printed):
            write(sys.stdout, visible(event.text), spare=not getattr(event, "solicited", True))
        elif isinstance(event, Notified | Failed) and (self._talkative or getattr(event, "warning", False)):
            self.notify(event.text)

    def notify(self, text: str) -> None:
        """A line on standard error, unless it was the last one there: what broke is told once."""
        if text != self._last or self._talkative:
            self._last = text
            write(sys.stderr, text)
