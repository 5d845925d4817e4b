"""The file of a log: appended to by a thread, rotated at a size, bounded in memory.

Theory of operation. `put` queues bytes and waits for the thread to write them, so that a crash of this program loses
nothing that was put. A disk that takes longer than PATIENCE is not waited for again until it has caught up. Meanwhile
the queue is bounded; what has no room is counted, and the file says so. Another session may write the same file: each
write begins at its end, and a session follows the other's rotation.
"""

from __future__ import annotations

import errno
import os
import stat
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path

PATIENCE = 0.05
"""The longest wait for a write, s."""
HELD = 1024 * 1024
"""The largest number of bytes that wait for a slow disk."""
ENDING = 1.0
"""The longest wait for the rest at the end, s."""
_FLAGS = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def part(path: Path, number: int) -> Path:
    """The path of a rotated part; the highest number is the oldest, and 0 is the file itself."""
    return path.with_name(f"{path.name}.{number}") if number else path


class Disk:
    """A file that is appended to. `problem` is set once it can no longer be written.

    `head` makes the first bytes of each part, `missing` the bytes in place of so many dropped ones.
    """

    def __init__(
        self, path: Path, size: int, files: int, head: Callable[[], bytes], missing: Callable[[int], bytes]
    ) -> None:
        """Open the file. Raises OSError, ValueError."""
        self.problem: OSError | None = None
        self.size = 0
        """Bytes in the file after the last write."""
        self._path, self._size, self._files, self._head, self._missing = path, size, files, head, missing
        self._descriptor = os.open(path, _FLAGS, 0o666)
        self._regular = stat.S_ISREG(os.fstat(self._descriptor).st_mode)
        self._queue: deque[bytes] = deque()
        self._held = self._dropped = 0
        self._slow = self._closed = False
        lock = threading.Lock()
        self._more, self._done = threading.Condition(lock), threading.Condition(lock)
        self._queue.append(self._gap() + head())
        self._held = len(self._queue[0])
        self._thread = threading.Thread(target=self._run, daemon=True, name="log")
        self._thread.start()

    def put(self, data: bytes) -> None:
        """Write bytes, which are whole lines. Waits for PATIENCE at most; does nothing after a problem."""
        with self._more:
            if self.problem or self._closed:
                return
            if self._held + len(data) > HELD:
                self._dropped += 1
                return
            self._queue.append(data)
            self._held += len(data)
            self._more.notify()
            if self._slow and self._held > len(data):
                return
            self._slow = not self._done.wait_for(self._idle, PATIENCE)

    def close(self) -> None:
        """Write the rest, for ENDING at most. May be called again."""
        with self._more:
            self._closed = True
            self._more.notify()
        self._thread.join(ENDING)

    def _idle(self) -> bool:
        return not self._held or self.problem is not None

    def _run(self) -> None:
        try:
            while (data := self._next()) is not None:
                self._write(data)
                self._wrote(len(data))
        except OSError as problem:
            with self._done:
                self.problem = problem
                self._queue.clear()
                self._done.notify()
        self._close()

    def _next(self) -> bytes | None:
        """The bytes of the next write; None at the end."""
        with self._more:
            self._more.wait_for(lambda: self._queue or self._closed)
            if not self._queue and not self._dropped:
                return None
            data = b"".join(self._queue)
            self._queue.clear()
            if self._dropped:
                dropped, self._dropped = self._dropped, 0
                data += (notice := self._missing(dropped))
                self._held += len(notice)
            return data

    def _wrote(self, size: int) -> None:
        with self._done:
            self._held -= size
            self._done.notify()

    def _write(self, data: bytes) -> None:
        if self._regular:
            self._follow()
            now = os.fstat(self._descriptor).st_size
            if now and now + len(data) > self._size:
                data, now = self._rotate() + data, 0
            self.size = now + len(data)
        while data:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:
                raise OSError(errno.EAGAIN, "its reader does not take it") from None

    def _follow(self) -> None:
        """Open the path again where another session has rotated it. Raises FileNotFoundError where it is gone."""
        try:
            found = os.stat(self._path)
        except FileNotFoundError:
            raise FileNotFoundError(errno.ENOENT, "the file is gone") from None
        ours = os.fstat(self._descriptor)
        if (found.st_dev, found.st_ino) != (ours.st_dev, ours.st_ino):
            self._close()
            self._descriptor = os.open(self._path, _FLAGS, 0o666)

    def _rotate(self) -> bytes:
        """Begin a new part; return its first bytes. A part that cannot be renamed now is so at a later write."""
        self._close()  # Windows renames no open file
        head = b""
        try:
            if self._files == 1:
                os.truncate(self._path, 0)
            for number in range(self._files - 1, 0, -1):
                if (older := part(self._path, number - 1)).exists():
                    older.replace(part(self._path, number))
            head = self._head()
        except PermissionError:  # Windows: another program reads it
            if self._path.stat().st_size > 2 * self._size:
                raise
        self._descriptor = os.open(self._path, _FLAGS, 0o666)
        return head

    def _close(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor != -1:
            os.close(descriptor)

    def _gap(self) -> bytes:
        """The end of a last line that a full disk or a power failure cut off."""
        if not self._regular:
            return b""
        with self._path.open("rb") as file:
            if not file.seek(0, os.SEEK_END):
                return b""
            file.seek(-1, os.SEEK_END)
            return b"" if file.read(1) == b"\n" else b"\n"
