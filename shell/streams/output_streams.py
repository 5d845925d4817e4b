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
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import TextIO

LIMIT = 64 * 1024
"""The largest number of bytes that wait for a reader, except replies to a pipe, and all lines to a file."""
MOST = 64 * 1024 * 1024
"""The largest number of bytes that wait for a pipe or a file; automation waits long before that."""
CHUNK = 16 * 1024
"""The number of bytes in one write."""
PIPE_TIMEOUT = 60.0
"""The time without progress, s, after which a pipe's reader is given up at the end."""
SHORT_TIMEOUT = 1.0
"""That time for a terminal, and for every reader after a stop or a signal."""


as_json = False
"""Standard output is a stream of JSON objects, and a loss is an object in it."""


@dataclass
class Loss:
    """Lines that were dropped, and between which times of day, s."""

    since: float
    until: float
    count: int = 0

    def fact(self) -> dict[str, object]:
        """The loss as an object for programs."""
        since, until = (datetime.fromtimestamp(at).astimezone() for at in (self.since, self.until))
        return {"lost": self.count, "from": since.isoformat(timespec="milliseconds")} | {
            "to": until.isoformat(timespec="milliseconds")
        }

    def __str__(self) -> str:
        """The loss in words; its times are local."""
        since, until = (datetime.fromtimestamp(at).strftime("%H:%M:%S.%f")[:-3] for at in (self.since, self.until))
        return f"{self.count} {'line' if self.count == 1 else 'lines'} lost, {since} to {until}"


class Lane:
    """A descriptor and the thread that writes to it. `put` never waits; bytes leave in the order of `put`.

    Where items were dropped, the thread calls `notice` once all before them are written, and writes the result in their
    place. It calls `failed` when the descriptor can no longer be written.
    """

    def __init__(
        self, descriptor: int, notice: Callable[[Loss], bytes], failed: Callable[[OSError], None], limit: int = LIMIT
    ) -> None:
        self.notice = notice
        self.written = 0
        """The number of bytes written so far."""
        self.closed = False
        """True after a failure, or when the reader was given up: nothing more is written."""
        self._descriptor, self._failed, self._limit = descriptor, failed, limit
        self._queue: deque[bytes | Loss] = deque()
        self._held = 0
        self._loss: Loss | None = None
        """The loss in the queue, which grows until the thread comes to it."""
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    @property
    def idle(self) -> bool:
        """Whether everything is written."""
        return self.closed or not (self._held or self._loss)

    @property
    def behind(self) -> bool:
        """Whether the reader is slower than the writer."""
        return not self.closed and (self._loss is not None or self._held > self._limit // 2)

    def put(self, data: bytes, keep: bool = False, count: int = 1) -> bool:
        """Queue `count` lines; False if they were dropped for lack of room. `keep`: drop them only beyond MOST."""
        with self._changed:
            if self.closed:
                return False
            if self._held > MOST or (not keep and self._is_full(len(data))):
                self._lose(count, time.time())
                return False
            self._add(data)
        return True

    def _lose(self, count: int, now: float) -> None:
        if self._loss is None:
            self._loss = Loss(now, now)
            self._queue.append(self._loss)
        self._loss.count += count
        self._loss.until = now

    def _is_full(self, size: int) -> bool:
        """Whether an item of this size has no room. After a loss there is no room until the reader catches up."""
        return self._loss is not None or (self._held > 0 and self._held + size > self._limit)

    def _add(self, data: bytes) -> None:
        self._queue.append(data)
        self._held += len(data)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, daemon=True, name="output")
            self._thread.start()
        self._changed.notify_all()

    def give_up(self) -> None:
        """Drop what waits and write nothing more. The thread may wait for its reader forever; nothing waits for it."""
        with self._changed:
            self.closed = True
            self._queue.clear()
            self._changed.notify_all()

    def _run(self) -> None:
        while (data := self._next()) is not None:
            try:
                written = 0 if not data else os.write(self._descriptor, data[:CHUNK])
            except BlockingIOError:  # another process that shares the descriptor made it non-blocking
                select.select([], [self._descriptor], [])
                written = 0
            except OSError as problem:
                self.give_up()
                self._failed(problem)
                return
            self._took(data[written:], written)

    def _next(self) -> bytes | None:
        """The bytes of the next write; None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self.closed)
            if self.closed:
                return None
            data = b""
            while self._queue and (not data or len(data) + self._size(self._queue[0]) <= CHUNK):
                item = self._queue.popleft()
                if isinstance(item, Loss):
                    item = self._notice(item)
                data += item
            return data

    def _size(self, item: bytes | Loss) -> int:
        """The size of an item; a loss waits until all before it is written."""
        return CHUNK if isinstance(item, Loss) else len(item)

    def _notice(self, loss: Loss) -> bytes:
        self._loss = None
        notice = self.notice(loss)
        self._held += len(notice)
        return notice

    def _took(self, rest: bytes, written: int) -> None:
        with self._changed:
            self.written += written
            self._held -= written
            if rest:
                self._queue.appendleft(rest)


class LineStream(io.TextIOBase):
    """A text stream in place of a standard stream that takes whole lines at once."""

    def lines(self, lines: Sequence[str], spare: bool) -> None:
        """Send lines. Without room a terminal loses all but warnings; a pipe loses spare (unsolicited) lines.

        A file loses none.
        """
        raise NotImplementedError


class Outlet(LineStream):
    """A text stream over a lane. `errors`: it carries warnings."""

    def __init__(self, stream: TextIO, lane: Lane, errors: bool) -> None:
        self.stream, self.lane = stream, lane
        self.terminal, self._errors = stream.isatty(), errors
        self._file = stat.S_ISREG(os.fstat(stream.fileno()).st_mode)
        self._begun = ""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The encoding of the replaced stream."""
        return self.stream.encoding or "utf-8"

    def fileno(self) -> int:
        """The descriptor of the replaced stream."""
        return self.stream.fileno()

    def isatty(self) -> bool:
        """Whether the destination is a terminal."""
        return self.terminal

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, text: str) -> int:
        """Take text; a complete line is sent at once, the rest with `flush`."""
        self._begun += text
        if "\n" in text:
            self.flush()
        return len(text)

    def flush(self) -> None:
        """Send the text written so far."""
        text, self._begun = self._begun, ""
        if text:
            self._put(text, keep=not self.terminal)

    def lines(self, lines: Sequence[str], spare: bool) -> None:
        """Send lines."""
        text = "\n".join((*lines, ""))
        self._put(text, keep=self._errors or self._file or not (spare or self.terminal), count=len(lines))

    def _put(self, text: str, keep: bool, count: int = 1) -> None:
        self.lane.put(text.encode(self.encoding, "backslashreplace"), keep, count)


class Streams:
    """The outlets in place of the standard streams."""

    def __init__(self, outlets: list[Outlet]) -> None:
        self.outlets = outlets

    async def ready(self) -> None:
        """Wait while the reader of a pipe or a file is behind; never for a terminal."""
        import asyncio  # only who has an event loop pays for it

        while any(each.lane.behind and not each.terminal for each in self.outlets):
            await asyncio.sleep(0.01)

    async def finish(self, hurried: Callable[[], bool]) -> list[Outlet]:
        """Wait until everything is written; give up and return the outlets that are not read.

        `hurried` returns whether the process must end now.
        """
        import asyncio

        loop, late = asyncio.get_running_loop(), []
        for each in self.outlets:
            seen, since = each.lane.written, loop.time()
            while not each.lane.idle:
                if each.lane.written != seen:
                    seen, since = each.lane.written, loop.time()
                if loop.time() - since > (SHORT_TIMEOUT if each.terminal or hurried() else PIPE_TIMEOUT):
                    each.lane.give_up()
                    late.append(each)
                    break
                await asyncio.sleep(0.002)
        return late


@contextlib.contextmanager
def outlets(failed: Callable[[TextIO, OSError], None]) -> Iterator[Streams]:
    """Replace `sys.stdout` and `sys.stderr` by outlets, with one lane if both have the same destination.

    `failed` is called, from another thread, with a stream that can no longer be written. A stream without a descriptor
    stays unchanged.
    """
    before = sys.stdout, sys.stderr
    made: dict[TextIO, Outlet] = {}
    errors: Lane | None = None
    for stream in (sys.stderr, sys.stdout):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            if errors is not None and _place(stream) == _place(before[1]):
                lane = errors
            else:
                lane = Lane(stream.fileno(), _notice(stream, errors), partial(failed, stream))
            made[stream] = Outlet(stream, lane, stream is before[1])
            errors = errors or lane
    sys.stdout, sys.stderr = (made.get(stream, stream) for stream in before)
    try:
        yield Streams(list(made.values()))
    finally:
        for each in made.values():
            each.flush()
        sys.stdout, sys.stderr = before


def _place(stream: TextIO) -> tuple[int, int, int]:
    facts = os.fstat(stream.fileno())
    if sys.platform == "win32":
        return facts.st_dev, facts.st_ino, 0
    return facts.st_dev, facts.st_ino, facts.st_rdev


def _notice(stream: TextIO, errors: Lane | None) -> Callable[[Loss], bytes]:
    """The report of dropped lines: in their place, or on standard error if that is another destination."""
    on_terminal = stream.isatty()

    def notice(loss: Loss) -> bytes:
        if on_terminal:
            are = "line is" if loss.count == 1 else "lines are"
            return f"{loss.count} {are} missing here: the terminal did not take them\n".encode()
        text = f"{loss}: the output is not read\n".encode()
        if errors is None:
            return text
        errors.put(text, keep=True)
        if not as_json:
            return b""
        import json  # a loss is rare

        return json.dumps(loss.fact()).encode() + b"\n"

    return notice
