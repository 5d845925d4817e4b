"""Output without a screen: replies to standard output, everything else to standard error.

Every line is flushed. If a reader goes away (a closed pipe, a terminal that hung up), its lines are dropped and the
work goes on: it must not leave drives half-way. The same holds for a full disk, which is reported at the end. In an
event loop only a thread waits for a slow reader (`nonblocking`).
"""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Callable
from typing import TextIO

from dialects import Diagnostic, DriveError, Stopped
from dialects.visible import visible
from shell import outlets
from transports import TransportLost

CODES: tuple[tuple[type[BaseException], int], ...] = (
    (Stopped, 4),
    (DriveError, 1),
    (Diagnostic, 2),
    (TransportLost, 3),
)
"""Exit codes by failure; the first match counts. An interruption has 130."""
INTERRUPTED = 130


def exit_code(failure: BaseException) -> int:
    """The exit code of a failure."""
    return next(code for kind, code in CODES if isinstance(failure, kind))


LONGEST = 800
"""The longest message, in characters: it may quote a typed text of any length."""


def report(failure: BaseException) -> str:
    """A failure in one line, after the places noted on it (`file:line`)."""
    places = getattr(failure, "__notes__", [])
    return shortened(": ".join([*reversed(places), " ".join(str(failure).split("\n"))]))


def shortened(text: str) -> str:
    """Shorten a long message in its middle, since its end says what to do."""
    if len(text) <= LONGEST:
        return text
    half = LONGEST // 2 - 20
    return f"{text[:half]} ... ({len(text) - 2 * half} characters) ... {text[-half:]}"


GONE = (errno.EPIPE, errno.EIO, errno.EBADF, errno.ECONNRESET)
"""The errors of a reader that went away."""
dropped: list[str] = []
"""The reasons why lines were lost although a reader waits for them, such as a full disk."""


def write(stream: TextIO, *lines: str, spare: bool = False) -> None:
    r"""Write and flush lines, their control characters as text (`\x1b`).

    A lost reader gets nothing more; a slow one gets no spare lines. What a program has printed comes before what is
    written to standard error.
    """
    if stream is sys.stderr:
        flush_printed()
    lines = tuple(visible(line, tabs=True) for line in lines)
    if isinstance(stream, outlets.LineStream):
        stream.lines(lines, spare)
        return
    encoding = getattr(stream, "encoding", None) or "utf-8"
    text = "".join(f"{line}\n" for line in lines)
    try:
        stream.write(text.encode(encoding, "backslashreplace").decode(encoding))
        stream.flush()
    except (OSError, ValueError) as problem:  # ValueError: the stream was closed
        lose(stream, problem)


def flush_printed() -> None:
    """Write what a program has printed: where standard output is no terminal, Python keeps it back."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as problem:
        lose(sys.stdout, problem)


def lose(stream: TextIO, problem: OSError | ValueError) -> None:
    """Write nothing more to a stream; keep the reason if its reader did not go away."""
    silence(stream)
    if isinstance(problem, OSError) and problem.errno not in GONE:
        dropped.append(f"the output cannot be written: {problem.strerror}")


def nonblocking() -> contextlib.AbstractContextManager[outlets.Streams]:
    """Make `sys.stdout` and `sys.stderr` never wait for their readers, around the work of an event loop."""
    return outlets.outlets(lose)


async def finish(streams: outlets.Streams, hurried: Callable[[], bool]) -> None:
    """Wait until everything is written, within limits; keep the reason for lost lines."""
    for late in await streams.finish(hurried):
        silence(late.stream)
        if not late.terminal and not hurried():
            dropped.append(f"the output was not read for {outlets.PIPE_TIMEOUT:g} s; the rest of it is lost")


def silence(stream: TextIO) -> None:
    """Discard all further writes to a stream, so that neither they nor the interpreter's end fail."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
