"""Standard output and standard error that never make the event loop wait for a reader.

Theory of operation. A thread writes to each destination, from a bounded queue. A terminal that is not read loses lines;
once it is read again, it shows how many. Warnings and failures are kept for it. A pipe loses no reply: automation
awaits `ready` before its next line. Only unsolicited lines are dropped there; standard error, or an object of a JSON
stream, reports how many and when. A file loses none of them either, up to MOST: a disk that hangs blocks no loop.
"""

from __future__ import annotations

import contextlib
import io
import os
import select
import stat
import sys
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from functools import partial
from typing import TextIO

from multidrop.base.text import counted
from multidrop.shell.threads import CHUNK, QUEUE_BYTES, BoundedWriter, Loss

if sys.platform == "win32":
    from multidrop.shell.console import writer as console_writer

PIPE_TIMEOUT = 60.0
"""The time without progress, s, after which a pipe's reader is given up at the end."""
SHORT_TIMEOUT = 1.0
"""That time for a terminal, and for every reader after a stop or a signal."""


as_json = False
"""Standard output is a stream of JSON objects, and a loss is an object in it."""


def descriptor_writer(
    descriptor: int, notice: Callable[[Loss], bytes], failed: Callable[[OSError], None], limit: int = QUEUE_BYTES
) -> BoundedWriter:
    """Make the writer of a descriptor. `failed` is called, from its thread, once that can no longer be written."""

    def ended(problem: OSError | None) -> None:
        if problem is not None:
            failed(problem)

    if sys.platform == "win32" and (console := console_writer(descriptor, CHUNK)) is not None:
        return BoundedWriter(console, notice, ended, limit)

    def write(data: bytes) -> int:
        try:
            return os.write(descriptor, data[:CHUNK])
        except BlockingIOError:  # another process that shares the descriptor made it non-blocking
            select.select([], [descriptor], [])
            return 0

    return BoundedWriter(write, notice, ended, limit)


class Colour(Enum):
    """The colours of lines at a prompt, as a terminal takes them."""

    FAILURE = "\x1b[31m"
    WARNING = "\x1b[33m"


class LineStream(io.TextIOBase):
    """A text stream in place of a standard stream that takes whole lines at once."""

    @abstractmethod
    def lines(self, lines: Sequence[str], spare: bool) -> None:
        """Send lines. Without room a terminal loses all but warnings; a pipe loses spare (unsolicited) lines.

        A file loses none.
        """

    def coloured(self, colour: Colour) -> LineStream:
        """The same stream with its lines in a colour, where it shows colours."""
        return self


class OutputStream(LineStream):
    """A text stream over a writer. `errors`: it carries warnings."""

    def __init__(self, stream: TextIO, writer: BoundedWriter, errors: bool) -> None:
        self.stream, self.writer = stream, writer
        self.terminal, self._errors = stream.isatty(), errors
        self._file = stat.S_ISREG(os.fstat(stream.fileno()).st_mode)
        self._begun = ""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self.stream.encoding or "utf-8"

    def fileno(self) -> int:
        return self.stream.fileno()

    def isatty(self) -> bool:
        return self.terminal

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        """Take text; a complete line is sent at once, the rest with `flush`."""
        self._begun += text
        if "\n" in text:
            self.flush()
        return len(text)

    def flush(self) -> None:
        text, self._begun = self._begun, ""
        if text:
            self._put(text, keep=not self.terminal)

    def lines(self, lines: Sequence[str], spare: bool) -> None:
        text = "\n".join((*lines, ""))
        self._put(text, keep=self._errors or self._file or not (spare or self.terminal), count=len(lines))

    def _put(self, text: str, keep: bool, count: int = 1) -> None:
        self.writer.put(text.encode(self.encoding, "backslashreplace"), keep, count)


class Streams:
    """The outlets in place of the standard streams."""

    def __init__(self, outlets: list[OutputStream]) -> None:
        self.outlets = outlets

    async def ready(self) -> None:
        """Wait while the reader of a pipe or a file is behind; never for a terminal."""
        import asyncio  # only who has an event loop pays for it

        while any(outlet.writer.behind and not outlet.terminal for outlet in self.outlets):
            await asyncio.sleep(0.01)

    async def finish(self, hurried: Callable[[], bool]) -> list[OutputStream]:
        """Wait until everything is written; give up and return the outlets that are not read.

        `hurried` returns whether the process must end now.
        """
        import asyncio

        loop, late = asyncio.get_running_loop(), []
        for outlet in self.outlets:
            seen, since = outlet.writer.written, loop.time()
            while not outlet.writer.idle:
                if outlet.writer.written != seen:
                    seen, since = outlet.writer.written, loop.time()
                if loop.time() - since > (SHORT_TIMEOUT if outlet.terminal or hurried() else PIPE_TIMEOUT):
                    outlet.writer.give_up()
                    late.append(outlet)
                    break
                await asyncio.sleep(0.002)
        return late


@contextlib.contextmanager
def outlets(failed: Callable[[TextIO, OSError], None]) -> Iterator[Streams]:
    """Replace `sys.stdout` and `sys.stderr` by outlets, with one writer if both have the same destination.

    `failed` is called, from another thread, with a stream that can no longer be written. A stream without a descriptor
    stays unchanged.
    """
    before = sys.stdout, sys.stderr
    made: dict[TextIO, OutputStream] = {}
    errors: BoundedWriter | None = None
    for stream in (sys.stderr, sys.stdout):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            if errors is not None and _place(stream) == _place(before[1]):
                writer = errors
            else:
                writer = descriptor_writer(stream.fileno(), _notice(stream, errors), partial(failed, stream))
            made[stream] = OutputStream(stream, writer, stream is before[1])
            errors = errors or writer
    sys.stdout, sys.stderr = (made.get(stream, stream) for stream in before)
    try:
        yield Streams(list(made.values()))
    finally:
        for outlet in made.values():
            outlet.flush()
        sys.stdout, sys.stderr = before


def _place(stream: TextIO) -> tuple[int, int, int]:
    facts = os.fstat(stream.fileno())
    if sys.platform == "win32":
        numbered = facts.st_ino or stream.isatty()  # all pipes are number 0 there
        return facts.st_dev, facts.st_ino, 0 if numbered else stream.fileno()
    return facts.st_dev, facts.st_ino, facts.st_rdev


def _notice(stream: TextIO, errors: BoundedWriter | None) -> Callable[[Loss], bytes]:
    """The report of dropped lines: in their place, or on standard error if that is another destination."""
    on_terminal = stream.isatty()

    def notice(loss: Loss) -> bytes:
        if on_terminal:
            lines = counted(loss.count, "line is", "lines are")
            return f"{lines} missing here: the terminal did not take them\n".encode()
        text = f"{loss}: the output is not read\n".encode()
        if errors is None:
            return text
        errors.put(text, keep=True)
        if not as_json:
            return b""
        import json  # a loss is rare

        return json.dumps(loss.fact()).encode() + b"\n"

    return notice
