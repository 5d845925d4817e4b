"""Threads beside the event loop: a writer for each destination, and blocking calls that may be abandoned.

Nothing waits for a reader, a terminal or a disk that hangs: not the loop, not a stop, not the end of the process
(docs/decisions/0013). `BoundedWriter` has the thread and the queue of a terminal, a pipe, a file or a log.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import TypeVar

from multidrop.base.text import counted

QUEUE_BYTES = 64 * 1024
"""The largest number of bytes that wait for a reader, except those to keep."""
MOST_HELD_BYTES = 64 * 1024 * 1024
"""The largest number of bytes that wait at all."""
CHUNK = 16 * 1024
"""The number of bytes in one write."""
T = TypeVar("T")


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
        return f"{counted(self.count, 'line')} lost, {since} to {until}"


class BoundedWriter:
    """A destination: its thread, and the bounded queue before it. `put` never waits; bytes leave in the order of `put`.

    `write` takes the first of the bytes that it is given and returns how many; it may block. Where items were dropped,
    the thread calls `notice` once all before them are written, and writes the result in their place. At its end it
    calls `ended`, with the problem if the destination can no longer be written.
    """

    def __init__(
        self,
        write: Callable[[bytes], int],
        notice: Callable[[Loss], bytes],
        ended: Callable[[OSError | None], None],
        limit: int = QUEUE_BYTES,
        chunk: int = CHUNK,
        name: str = "output",
    ) -> None:
        self.notice = notice
        self.written = 0
        """The number of bytes written so far."""
        self.closed = False
        """True after a problem, or when the reader was given up: nothing more is written."""
        self.problem: OSError | None = None
        self._write, self._ended, self._limit, self._chunk = write, ended, limit, chunk
        self._queue: deque[bytes | Loss] = deque()
        self._held = 0
        self._loss: Loss | None = None
        """The loss in the queue, which grows until the thread comes to it."""
        self._closing = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, daemon=True, name=name)

    @property
    def idle(self) -> bool:
        """Whether everything is written."""
        return self.closed or not (self._held or self._loss)

    @property
    def behind(self) -> bool:
        """Whether the reader is slower than the writer."""
        return not self.closed and (self._loss is not None or self._held > self._limit // 2)

    def put(self, data: bytes, keep: bool = False, count: int = 1) -> bool:
        """Queue `count` lines; False if they were dropped for lack of room. `keep`: drop them only beyond
        MOST_HELD_BYTES.

        After a loss there is no room until the reader catches up.
        """
        with self._changed:
            if self.closed or self._closing:
                return False
            full = self._loss is not None or (self._held > 0 and self._held + len(data) > self._limit)
            if self._held > MOST_HELD_BYTES or (full and not keep):
                now = time.time()
                if self._loss is None:
                    self._loss = Loss(now, now)
                    self._queue.append(self._loss)
                self._loss.count += count
                self._loss.until = now
                return False
            self._queue.append(data)
            self._held += len(data)
            if self._thread.ident is None:
                self._thread.start()
            self._changed.notify_all()
        return True

    def wait(self, seconds: float) -> bool:
        """Wait until everything is written, for so long at most; return whether it is."""
        with self._changed:
            return self._changed.wait_for(lambda: self.idle, seconds)

    def close(self, seconds: float) -> None:
        """Take nothing more, and write the rest, for so long at most. May be called again."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join(seconds)

    def give_up(self) -> None:
        """Drop what waits and write nothing more. The thread may wait for its reader forever; nothing waits for it."""
        with self._changed:
            self.closed = True
            self._queue.clear()
            self._changed.notify_all()

    def _run(self) -> None:
        while self.turn():
            pass

    @property
    def due(self) -> bool:
        """Whether `turn` has something to do now."""
        return bool(self._queue or self.closed or self._closing)

    def turn(self) -> bool:
        """Wait until something is due, and write once; False at the end. For the thread alone."""
        try:
            if (data := self._next()) is not None:
                written = self._write(data) if data else 0
                with self._changed:
                    self.written += written
                    self._held -= written
                    if data[written:]:
                        self._queue.appendleft(data[written:])
                    self._changed.notify_all()
                return True
        except OSError as problem:
            self.problem = problem
            self.give_up()
        self._ended(self.problem)
        return False

    def _next(self) -> bytes | None:
        """The bytes of the next write; None at the end. A loss waits until all before it is written."""
        with self._changed:
            self._changed.wait_for(lambda: self.due)
            if self.closed or not self._queue:
                return None
            data = b""
            while self._queue:
                item = self._queue[0]
                if data and (isinstance(item, Loss) or len(data) + len(item) > self._chunk):
                    break
                self._queue.popleft()
                if isinstance(item, Loss):
                    self._loss = None
                    item = self.notice(item)
                    self._held += len(item)
                data += item
            return data


async def in_thread(work: Callable[[], T], timeout: float, name: str = "blocking work") -> T:
    """Run blocking work in a thread that the process does not wait for. Raises TimeoutError, and abandons the thread.

    Not `to_thread`: the interpreter joins its threads at the end, and a thread that waits for a frozen program never
    ends.
    """
    import asyncio  # only who has an event loop pays for it

    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()

    def settle(result: T | None, error: BaseException | None) -> None:
        if future.done():
            return
        if error is not None:
            future.set_exception(error)
        else:
            future.set_result(result)  # type: ignore[arg-type]

    def thread() -> None:
        result: T | None = None
        failure: BaseException | None = None
        try:
            result = work()
        except BaseException as error:  # raised again by the future
            failure = error
        with contextlib.suppress(RuntimeError):  # the loop was closed meanwhile
            loop.call_soon_threadsafe(settle, result, failure)

    threading.Thread(target=thread, name=name, daemon=True).start()
    return await asyncio.wait_for(future, timeout)
