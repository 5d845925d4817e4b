"""Output without a screen: replies to standard output, everything else to standard error.

Every line is flushed. The reader of standard output may go away (a closed pipe): that interrupts the process like a
signal (`ReaderWatch`). A full disk interrupts nothing and is reported at the end. In an event loop only a thread waits
for a slow reader (`nonblocking`).
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable
from shutil import get_terminal_size
from typing import TextIO

from multidrop.base.text import visible
from multidrop.shell.exit_codes import INTERRUPTED, READER_GONE, exit_code
from multidrop.shell.streams import output_streams
from multidrop.shell.streams.output_streams import OutputStream

if sys.platform == "win32":
    from multidrop.shell.console import reader_gone

LONGEST_PROBLEM_TEXT = 800
"""The longest message, in characters: it may quote a typed text of any length."""


def report(failure: BaseException) -> str:
    """A failure in one line, after the places noted on it (`file:line`)."""
    places = getattr(failure, "__notes__", [])
    return shortened(": ".join([*reversed(places), " ".join(str(failure).split("\n"))]))


def shortened(text: str) -> str:
    """Shorten a long message in its middle, since its end says what to do."""
    if len(text) <= LONGEST_PROBLEM_TEXT:
        return text
    half = LONGEST_PROBLEM_TEXT // 2 - 20
    return f"{text[:half]} ... ({len(text) - 2 * half} characters) ... {text[-half:]}"


GONE = (errno.EPIPE, errno.EIO, errno.EBADF, errno.ECONNRESET, *((errno.EINVAL,) if sys.platform == "win32" else ()))
"""The errors of a reader that went away; Windows gives EINVAL for a pipe."""
dropped: list[str] = []
"""The reasons why lines were lost although a reader waits for them, such as a full disk."""


def write(stream: TextIO, *lines: str, spare: bool = False, styled: bool = False) -> None:
    r"""Write and flush lines, their control characters as text (`\x1b`) unless they are `styled` already.

    A lost reader gets nothing more; a slow one gets no spare lines. What a program has printed comes before what is
    written to standard error.
    """
    if stream is sys.stderr:
        flush_printed()
    lines = lines if styled else tuple(visible(line, tabs=True) for line in lines)
    if isinstance(stream, output_streams.LineStream):
        stream.lines(lines, spare)
        return
    encoding = getattr(stream, "encoding", None) or "utf-8"
    text = "".join(f"{line}\n" for line in lines)
    try:
        stream.write(text.encode(encoding, "backslashreplace").decode(encoding))
        stream.flush()
    except (OSError, ValueError) as problem:  # ValueError: the stream was closed
        lose(stream, problem)


def fail(failure: BaseException) -> int:
    """Print one line about a failure, or about each of its problems; return its exit code."""
    write(sys.stderr, *map(report, getattr(failure, "problems", (failure,))))
    return exit_code(failure)


def flush_printed() -> None:
    """Write what a program has printed: where standard output is no terminal, Python keeps it back."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as problem:
        lose(sys.stdout, problem)


def lose(stream: TextIO, problem: OSError | ValueError) -> None:
    """Write nothing more to a stream; keep the reason if its reader did not go away."""
    left = isinstance(problem, OSError) and problem.errno in GONE
    if left and watch is not None and watch.watches(stream):
        watch.gone()
    silence(stream)
    if isinstance(problem, OSError) and not left:
        dropped.append(f"the output cannot be written: {problem.strerror}")


def nonblocking() -> contextlib.AbstractContextManager[output_streams.Streams]:
    return output_streams.outlets(lose)


async def finish(streams: output_streams.Streams, hurried: Callable[[], bool]) -> None:
    """Wait until everything is written, within limits; keep the reason for lost lines."""
    for late in await streams.finish(hurried):
        silence(late.stream)
        if not late.terminal and not hurried():
            dropped.append(f"the output was not read for {output_streams.PIPE_TIMEOUT:g} s; the rest of it is lost")


def silence(stream: TextIO) -> None:
    """Discard all further writes to a stream, so that neither they nor the interpreter's end fail."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


class ReaderWatch:
    """Interrupts this process once the reader of its standard output is gone, whether or not anything is printed.

    A thread polls the descriptor. A pipe and a socket have a reader, and so has a terminal beside another standard
    input; one that is standard input, too, sends SIGHUP. A file and the null device have none. On Windows pipes
    say it; a console sends SIGBREAK, and of a socket the next line that is printed says it.
    """

    LOOK = 250
    """The longest time between two looks for the end of the work, ms."""
    GRACE = 0.2
    """The time that work which ends by itself still has, s: `| head -1` leaves once it has its line."""

    def __init__(self, number: signal.Signals) -> None:
        """`number`: the signal that the main thread gets; where it is ignored, SIGTERM."""
        self.left = False
        """The reader left before the work, or the output of it, was at its end."""
        self.over = False
        """The work is done: nothing is interrupted any more."""
        self._number = number
        self._descriptor = -1
        with contextlib.suppress(OSError, ValueError, AttributeError):
            self._descriptor = sys.stdout.fileno()

    def begin(self) -> None:
        if self._has_reader():
            threading.Thread(target=self._run, daemon=True, name=WATCHER).start()

    def _has_reader(self) -> bool:
        if self._descriptor < 0:
            return False
        mode = os.fstat(self._descriptor).st_mode
        is_terminal = os.isatty(self._descriptor) and not os.isatty(0)
        return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or is_terminal

    def watches(self, stream: TextIO) -> bool:
        with contextlib.suppress(OSError, ValueError):
            return stream.fileno() == self._descriptor and self._has_reader()
        return False

    def _run(self) -> None:
        if sys.platform != "win32":  # the signals of the process are for other threads
            signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        while not self.over:
            if self.is_gone(self.LOOK):
                time.sleep(self.GRACE)
                if not self.over:
                    self.gone()
                return

    def is_gone(self, wait: int = 0) -> bool:
        """Whether the reader is gone, or goes within `wait` ms."""
        if sys.platform == "win32":
            time.sleep(wait / 1000)
            return reader_gone(self._descriptor)
        poll = select.poll()
        poll.register(self._descriptor, 0)
        return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(wait))

    def gone(self) -> None:
        """Interrupt the main thread, once, while it works."""
        before, self.left = self.left, True
        if before or self.over:
            return
        number = signal.SIGTERM if signal.getsignal(self._number) is signal.SIG_IGN else self._number
        if sys.platform == "win32":
            signal.raise_signal(number)
        elif (main := threading.main_thread().ident) is not None:
            signal.pthread_kill(main, number)


WATCHER = "reader of standard output"
"""The name of the thread that watches. It holds no lock, so that the process may be forked beside it."""
watch: ReaderWatch | None = None
"""The watch of this process; None: a reader that leaves interrupts nothing."""


def watch_reader(number: signal.Signals) -> ReaderWatch:
    """Watch the reader of standard output from here on; its end is this signal to the main thread."""
    global watch
    watch = ReaderWatch(number)
    watch.begin()
    return watch


def work_done() -> None:
    """Note that all work is done: from here on only lost output counts."""
    if watch is not None:
        watch.over = True


def reader_left() -> bool:
    return watch is not None and watch.left


def lost_reader(end: BaseException) -> bool:
    """Whether a program ended because it printed to a reader that is gone."""
    if isinstance(end, BrokenPipeError) and watch is not None and watch.is_gone():
        watch.gone()
    return isinstance(end, BrokenPipeError) and reader_left()


def why_interrupted() -> str:
    return "the reader of standard output is gone" if reader_left() else "interrupted"


def final(code: int) -> int:
    """The exit code of the process: READER_GONE in place of a good end or an interruption whose cause that was."""
    return READER_GONE if reader_left() and code in (0, INTERRUPTED) else code


class StatusLine:
    """A line on standard error, where that is a terminal; elsewhere it shows nothing. Erase it before other lines."""

    def __init__(self) -> None:
        self._shown = 0
        """The number of characters that are on the screen."""

    def show(self, text: str) -> None:
        """Show a text in place of the last one; a terminal that does not keep up is spared."""
        if not sys.stderr.isatty() or (isinstance(sys.stderr, OutputStream) and sys.stderr.writer.behind):
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
