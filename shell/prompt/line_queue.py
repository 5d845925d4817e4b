"""Typed lines: those that wait for their turn, and their history, which the prompt and the TUI share.

At the prompt lines run one after the other; a macro runs beside them, and the stop goes ahead of them. A failed line
holds back the rest of its burst, and a stop drops everything before it: those lines are shown, and never sent.

The history is a text file, kept between runs. Several processes may write it at once. A line is appended in one write,
under a lock where one is free; on Windows that is of a file beside. To cut the file, a process replaces it by a new
one; another process that waited for the lock then opens the new file.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from multidrop.base.atomic import open_private, private_folder, read_private, write_atomically
from multidrop.base.errors import Diagnostic
from multidrop.base.files import lines_of
from multidrop.base.text import counted, visible
from multidrop.shell.events import FAILURES
from multidrop.shell.line_syntax import NOWHERE, DriveLine, Place, TypedLine, VerbLine, parse

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

from multidrop.shell.origin import LastLine, Origin
from multidrop.shell.quitting import ENDING
from multidrop.shell.session import BARE_WORDS, Session

MOST_HISTORY_LINES = 5000
"""The number of lines read back; a file of twice as many is cut to that number."""
PRIVATE = 0o600
WRITE_TRIES = 3
MOMENT = 0.2
"""The longest wait for another process that writes, s."""
TORN = "\0"
"""The last character of a line of which only a part was written: it is not offered again."""


class History:
    """A history file, which need not exist. A disk that cannot be written loses the history, never the typed line."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def lines(self) -> list[str]:
        """The lines of the file, oldest first."""
        try:
            entered = read_private(self.path).decode("utf-8", "replace").replace("\r\n", "\n").split("\n")
        except OSError:
            return []
        lines = [line for line in entered[:-1] if _whole(line)]
        if len(lines) > 2 * MOST_HISTORY_LINES:
            self._cut()
        return lines[-MOST_HISTORY_LINES:]

    def append(self, line: str) -> None:
        """Append a line; empty lines and texts of several lines are left out."""
        if not line.strip() or "\n" in line or "\r" in line:
            return
        with contextlib.suppress(OSError):
            private_folder(self.path.parent)
            with self._opened() as (descriptor, _):
                os.write(descriptor, f"{_gap(descriptor)}{line}\n".encode("utf-8", "replace"))

    def _cut(self) -> None:
        """Cut the file to its last lines, unless another process writes it now."""

        def write_last(data: bytes) -> None:
            lines = [line for line in data.split(b"\n")[:-1] if _whole(line.decode("utf-8", "replace"))]
            write_atomically(
                self.path, b"".join(line + b"\n" for line in lines[-MOST_HISTORY_LINES:]), PRIVATE, private=True
            )

        if sys.platform == "win32":  # where an open file is not replaced
            with contextlib.suppress(OSError), self._alone() as locked:
                if locked:
                    write_last(read_private(self.path))
            return
        with contextlib.suppress(OSError), self._opened() as (descriptor, locked):
            if not locked:
                return
            with open(descriptor, "rb", closefd=False) as old:
                write_last(old.read())
                late = old.read()  # from a process that had the file open, and no lock
            with open(open_private(self.path, os.O_WRONLY | os.O_APPEND), "ab") as new:
                new.write(late)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[tuple[int, bool]]:
        """The file to append to, and whether this process has locked it. Raises OSError."""
        if sys.platform == "win32":
            with self._alone() as locked:
                descriptor = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_BINARY, PRIVATE)
                try:
                    yield descriptor, locked
                finally:
                    os.close(descriptor)
            return
        for tried in range(WRITE_TRIES):
            descriptor = open_private(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, PRIVATE)
            try:
                locked = _lock(descriptor)
                if tried + 1 == WRITE_TRIES or _is_at(descriptor, self.path):
                    yield descriptor, locked
                    return
            finally:
                os.close(descriptor)

    if sys.platform == "win32":

        @contextlib.contextmanager
        def _alone(self) -> Iterator[bool]:
            """Lock a file beside, for the processes that write, append and cut; whether it is locked. Raises OSError.

            An append is not one step there. So a process waits a moment for another one.
            """
            lock = os.open(f"{self.path}.lock", os.O_RDWR | os.O_CREAT, PRIVATE)
            until, locked = time.monotonic() + MOMENT, False
            try:
                while not locked and time.monotonic() < until:
                    try:
                        msvcrt.locking(lock, msvcrt.LK_NBLCK, 1)
                        locked = True
                    except OSError:
                        time.sleep(0.002)
                yield locked
                if locked:
                    msvcrt.locking(lock, msvcrt.LK_UNLCK, 1)
            finally:
                os.close(lock)


def _lock(descriptor: int) -> bool:
    """Try to lock the file without waiting. Closing it unlocks it."""
    if sys.platform != "win32":
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
    return True


def _is_at(descriptor: int, path: Path) -> bool:
    """True if the path still names the open file: another process may have cut it."""
    with contextlib.suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    return False


def _whole(line: str) -> bool:
    """Whether a line of the file was typed as it is there."""
    return bool(line.strip()) and not line.endswith(TORN)


def _gap(descriptor: int) -> str:
    """The mark of a torn line and its end if the last line has none, as after a full disk."""
    size = os.fstat(descriptor).st_size
    if not size:
        return ""
    os.lseek(descriptor, size - 1, os.SEEK_SET)
    return "" if os.read(descriptor, 1) == b"\n" else f"{TORN}\n"


BURST = 0.5
"""The time between two Enters, s, below which no person can have read the reply to the first."""
MOST_SHOWN_UNSENT = 10
"""The number of unsent lines that are shown one by one."""
LEAVING = ("/quit", "/exit")
"""The verbs of a quit: they run at once, as `/stop` does, whatever waits or failed."""


@dataclass(frozen=True)
class EnteredLine:
    """A line at its Enter: parsed once, with the count of stops and the drive that was selected."""

    text: str
    since: int
    place: Place = NOWHERE
    """The selected drive; empty where none was."""
    parsed: TypedLine | None = None
    """None: it cannot be parsed, which the session reports at its turn."""

    @classmethod
    def entered(cls, text: str, since: int, place: Place = NOWHERE) -> EnteredLine:
        try:
            return cls(text, since, place, parse(text))
        except Diagnostic:
            return cls(text, since, place)

    @property
    def verb(self) -> str:
        """The verb's name; empty for text."""
        return self.parsed.name if isinstance(self.parsed, VerbLine) else ""

    @property
    def bus(self) -> str:
        """The bus that the text is for; empty for a verb."""
        return (self.parsed.bus or self.place.bus) if isinstance(self.parsed, DriveLine) else ""

    @property
    def sent(self) -> str | TypedLine:
        """The line in the form that the session takes."""
        return self.parsed or self.text

    def leaves(self, session: Session) -> bool:
        """True if it asks for the end: the verb, or the bare word where no drive would store it and no port take it."""
        if BARE_WORDS.get(self.text.strip().lower()) not in LEAVING:
            return self.verb in LEAVING
        storing = session.selected is not None and session.selected.programming
        return not storing and session.selected_bus not in session.raw


class LineQueue:
    """The lines that wait for their turn in one session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._origin = Origin(last=LastLine())
        self._waiting: asyncio.Queue[tuple[int, EnteredLine]] = asyncio.Queue()
        """Lines with their numbers."""
        self._entered_lines = 0
        self._entered = 0.0
        """The time of the last Enter."""
        self._follows = False
        """The next Enter had been typed before the last one was taken."""
        self._held = ""
        """The reason why the rest of this burst is not sent; empty: it is sent."""
        self._queued = False
        """A line of this burst runs or waits: the rest of the burst waits for its end, macros, too."""
        self._closed = False
        self.opening = False
        """Buses are being opened: every line waits, and `run` is not called yet."""
        self.running = ""
        """The line that runs now."""
        self.count = 0
        """The number of lines entered, without those that end it."""
        self._typed_after: list[str] | None = None
        """The lines entered since a quit that is not decided yet; None: there is none."""
        self._free = asyncio.Event()
        self._free.set()
        """No quit is being decided: the next line may be sent."""
        self._meant = (0, NOWHERE)
        """After a `/use`: the number of lines entered by then, which are for the drive that it selected."""

    def enter(self, text: str, followed: bool = False) -> None:
        """Take the lines of one Enter. They count as typed now, whenever their turn comes.

        `followed`: another Enter was typed already. However long it takes this program to come to it, nobody has read a
        reply in between.
        """
        now = self._session.now()
        if now - self._entered > BURST and not self._follows:
            self._held, self._queued = "", False
        self._entered, self._follows = now, followed
        try:
            lines = lines_of(text)
        except Diagnostic as problem:
            self._session.notify(f"{problem}; nothing was sent", warning=True)
            return
        for line in lines:
            self._take(EnteredLine.entered(line, self._session.stops, self._session.place), alone=len(lines) == 1)

    def _take(self, line: EnteredLine, alone: bool) -> None:
        """Take a line. A quit goes ahead, unless it is one of several lines that were entered together (a paste)."""
        concurrent, leaves = _concurrent(line), line.leaves(self._session)
        if line.verb == "/stop":
            self.count += 1
            self._session.start(line.sent, since=line.since)
            return
        if self._typed_after is not None:
            self._typed_after.append(line.text)
            return
        if self._session.quitting:
            self.show_unsent(ENDING, [line.text])
            return
        self.count += bool(line.text.strip()) and not leaves
        if leaves and alone:
            self._session.start(line.sent, since=line.since)
        elif self._held:
            self.show_unsent(self._held, [line.text])
        elif concurrent and not self.opening and not self._queued:
            self._session.start(line.sent, since=line.since)
        elif line.text.strip():
            self._queued = True
            self._entered_lines += 1
            self._waiting.put_nowait((self._entered_lines, line))

    async def run(self) -> None:
        """Run the lines in turn, until `close` and a cancellation."""
        while not self._closed:
            self.running = ""
            self._queued = self._queued and not self._waiting.empty()
            number, line = await self._waiting.get()
            await self._free.wait()
            if why := self._not_now(number, line):
                self.show_unsent(why, [line.text])
                continue
            if _concurrent(line):
                self._session.start(line.sent, since=line.since)
                continue
            self.running = line.text
            try:
                await self._session.run(line.sent, self._origin, since=line.since)
            except FAILURES:
                if line.since == self._session.stops:  # else the waiting lines were typed after the stop of this one
                    self._held = f"'{self.running.strip()}' failed"
                    self.drop(self._held)
            if line.verb in ("/use", "/rename"):
                self._meant = self._entered_lines, self._session.place

    def _not_now(self, number: int, line: EnteredLine) -> str:
        """Why a line is not sent at its turn; empty: it is. After `/close` nothing goes to another bus by itself."""
        if line.since != self._session.stops:
            return ""  # the session says so
        if self._session.quitting:
            return ENDING
        entered, place = self._meant
        bus = (place if number <= entered else line.place).bus
        plain = isinstance(line.parsed, DriveLine) and not line.parsed.bus
        return f"{bus} was closed" if plain and bus and bus not in self._session.buses else ""

    @contextlib.contextmanager
    def deciding(self) -> Iterator[None]:
        """Send nothing while a quit is being decided; what is entered meanwhile was typed after it, and never sent."""
        self._typed_after = []
        self._free.clear()
        try:
            yield
        finally:
            typed, self._typed_after = self._typed_after, None
            self.show_unsent("it was typed after a quit", typed)
            self._free.set()

    def stopped(self) -> None:
        """Drop the waiting lines after a stop; take new ones."""
        self._held = ""
        self.drop("a stop came")

    def drop(self, why: str) -> None:
        self.show_unsent(why, [self._waiting.get_nowait()[1].text for _ in range(self._waiting.qsize())])

    def close(self) -> None:
        """Run no further line: a stop may have replaced the cancellation of `run`."""
        self._closed = True

    def show_unsent(self, why: str, lines: Sequence[str]) -> None:
        lines = [shown(line) for line in lines if line.strip()]
        for line in lines[:MOST_SHOWN_UNSENT]:
            self._session.notify(f"not sent, as {why}: {line}", warning=True)
        if len(lines) > MOST_SHOWN_UNSENT:
            self._session.notify(
                f"{counted(len(lines) - MOST_SHOWN_UNSENT, 'more line was', 'more lines were')} not sent", warning=True
            )


def shown(line: str) -> str:
    """A line as it was typed, without the marks of a paste and with other control characters written out."""
    return visible(re.sub("\x1b\\[20[01]~", "", line), tabs=True).strip()


def _concurrent(line: EnteredLine) -> bool:
    """True if a line runs beside those that are typed after it."""
    if not line.verb:
        return False
    from multidrop.shell.operations.table import VERBS  # late: the first frame of the screen needs no verb

    return line.verb in VERBS and VERBS[line.verb].concurrent
