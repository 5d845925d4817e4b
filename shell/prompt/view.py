"""The view of the prompt: lines above it, the toolbar below it, completions and history.

Lines above the prompt are collected, bounded in number, and shown at most ten times a second. They replace standard
output and standard error while the prompt runs. They are written in chunks, as fast as the terminal takes them, and
the prompt is drawn again at least every 50 ms. A terminal that is not read loses the oldest lines; once it is read
again, it shows how many in their place. The prompt is then drawn again, since parts of it were lost, too.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import sys
from collections import deque
from collections.abc import AsyncGenerator, Iterable, Iterator, Sequence
from itertools import accumulate
from typing import Any, TextIO, cast

from prompt_toolkit import PromptSession
from prompt_toolkit.application import Application, in_terminal
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.history import History as PromptHistory
from prompt_toolkit.output import ColorDepth, DummyOutput

from multidrop.base.text import counted
from multidrop.shell import stop_report
from multidrop.shell.events import Progressed
from multidrop.shell.openings import model
from multidrop.shell.prompt import complete
from multidrop.shell.prompt.line_queue import History, LineQueue
from multidrop.shell.session import Session
from multidrop.shell.streams.event_printer import laid_out
from multidrop.shell.streams.output_streams import Colour, LineStream, OutputStream
from multidrop.shell.threads import Loss
from multidrop.shell.workspace import Workspace

MOST_HELD_LINES = 1000
"""The largest number of lines that wait for a terminal that takes none."""
BURST = 50_000
"""The largest number of lines between two updates of a terminal that takes them."""
STUCK_AFTER = 0.1
"""The time, s, after which a terminal that does not keep up counts as one that takes none."""
UPDATE_PAUSE = 0.1
"""The time between two updates, s."""
MANY = 10
"""The number of lines in one update that are too many to read."""
LONG_PAUSE = 0.2
"""The time after an update of as many, s: each one draws the prompt again."""
BREATH = 0.01
"""The time between two updates while lines wait, s."""
LONGEST_UPDATE = 0.05
"""The longest time, s, for which an update hides the prompt."""
BELOW = 4
"""The rows that a page of help leaves free: the prompt, its toolbar, the line about more, a row of the page before."""
ESCAPES = re.compile("\x1b\\[[0-9;]*[A-Za-z]")
CHUNK = 16 * 1024
"""The number of characters after which the terminal is asked whether it keeps up; less than a writer's limit."""


class PromptStream(LineStream):
    """A text stream whose lines appear above the prompt. `keep`: never drop a line (warnings and failures)."""

    def __init__(self, lines: LinesAbove, keep: bool, colour: str = "") -> None:
        self._lines, self._keep, self._colour = lines, keep, colour
        self._begun = ""

    def coloured(self, colour: Colour) -> LineStream:
        return PromptStream(self._lines, self._keep, colour.value) if self._lines.coloured else self

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self._lines.app.output.encoding()

    def isatty(self) -> bool:
        return self._lines.on_terminal

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        """Take text; each complete line is shown."""
        *whole, self._begun = (self._begun + text).split("\n")
        self._lines.add(whole, self._keep)
        return len(text)

    def lines(self, lines: Sequence[str], spare: bool) -> None:
        """Show lines, after what was begun."""
        if self._begun:
            self.write("\n")
        self._lines.add([f"{self._colour}{line}\x1b[m" for line in lines] if self._colour else lines, self._keep)


class LinesAbove:
    """The lines above the prompt of an application. Belongs to the event loop's thread."""

    def __init__(self, app: Application[Any]) -> None:
        self.app = app
        self._loop = asyncio.get_running_loop()
        self._lines: deque[tuple[str, bool]] = deque()
        """The lines that wait, and whether they are kept in any case."""
        self._missing = 0
        """Number of lines that were dropped before those that wait."""
        self._saved: list[str] = []
        """Lines before those, which were kept."""
        self._stuck = False
        self._something = asyncio.Event()
        self._damaged = False
        """Parts of the prompt were lost on their way to the terminal."""
        stdout = getattr(app.output, "stdout", None)
        self._writer = stdout.writer if isinstance(stdout, OutputStream) else None
        self.on_terminal = stdout is not None and stdout.isatty()
        self.coloured = self.on_terminal and app.color_depth is not ColorDepth.DEPTH_1_BIT

    def add(self, lines: Sequence[str], keep: bool) -> None:
        """Queue lines; the oldest give way."""
        self._lines.extend([(line, keep) for line in lines])
        self._make_way(MOST_HELD_LINES if self._stuck else BURST)
        self._something.set()

    def _make_way(self, most: int) -> None:
        """Drop and count the oldest lines, until so many wait."""
        for _ in range(len(self._lines) - most):
            line, keep = self._lines.popleft()
            if keep:
                self._saved.append(line)
            else:
                self._missing += 1

    @property
    def _behind(self) -> bool:
        return self._writer is not None and self._writer.behind

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Replace the standard streams; standard output stays if it is not a terminal."""
        before, task = (sys.stdout, sys.stderr), self._loop.create_task(self._show())
        notice = self._writer.notice if self._writer else None
        if self._writer:
            self._writer.notice = self._lost
        sys.stderr = cast(TextIO, PromptStream(self, keep=True))
        if sys.stdout.isatty():
            sys.stdout = cast(TextIO, PromptStream(self, keep=False))
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before
            task.cancel()
            if self._writer and notice:
                self._writer.notice = notice
            self._write_rest()

    def _lost(self, loss: Loss) -> bytes:
        """Draw the prompt again after a loss. Called from the writer's thread."""
        self._damaged = True
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._something.set)
        return b""

    async def _show(self) -> None:
        while True:
            await self._something.wait()
            # Wait until the terminal has taken what was written, and the prompt may be hidden.
            since = self._loop.time()
            while self._behind or (self.app.is_running and self.app.is_done):
                self._stuck = self._behind and self._loop.time() > since + STUCK_AFTER
                await asyncio.sleep(0.01)
            self._stuck = False
            self._something.clear()
            if self._damaged and self.app.is_running:
                self._damaged = False
                self.app.output.write_raw("\x1b[0m\r\n\x1b[J")
                self.app.renderer.reset()
            many = len(self._lines) >= MANY
            async with in_terminal():
                # Write chunks until nothing waits, or the prompt must be drawn again.
                until = self._loop.time() + LONGEST_UPDATE
                while self._waits and self._loop.time() < until:
                    if self._behind:
                        await asyncio.sleep(0.001)
                    else:
                        self._write(self._next())
                        await asyncio.sleep(0)
                if self._waits:
                    self._something.set()
            await asyncio.sleep(BREATH if self._lines else LONG_PAUSE if many else UPDATE_PAUSE)

    @property
    def _waits(self) -> bool:
        return bool(self._lines or self._missing or self._saved)

    def _write(self, text: str) -> None:
        output = self.app.output
        output.enable_autowrap()
        output.write_raw(text)
        output.flush()

    def _next(self) -> str:
        """The next chunk of what waits; the number of missing lines is in their place."""
        lines, self._saved = self._saved, []
        if self._missing:
            count = counted(self._missing, "line is", "lines are")
            lines.append(f"{count} missing here: the terminal did not take them")
            self._missing = 0
        size = 0
        while self._lines and size < CHUNK:
            lines.append(self._lines.popleft()[0])
            size += len(lines[-1])
        return "\n".join((*lines, "")) if lines else ""

    def _write_rest(self) -> None:
        """Pass on what waits at the end: warnings, and as many of the last lines as a terminal takes at once."""
        sizes = accumulate(len(line) for line, _ in reversed(self._lines))
        self._make_way(sum(size <= CHUNK for size in sizes))
        while text := self._next():
            if self._writer:
                self._writer.put(text.encode(self.app.output.encoding(), "backslashreplace"), keep=True)
            else:
                self._write(text)


class PlainOutput(DummyOutput):
    """The output of a dumb terminal: lines, and an echo of the prompt and what is typed. Nothing is drawn over."""

    stdout: TextIO

    def __init__(self) -> None:
        self.stdout = sys.stdout if sys.stdout.isatty() else sys.stderr
        self._echoed = ""
        """The prompt and the text that the last row shows."""

    def encoding(self) -> str:
        return self.stdout.encoding or "utf-8"

    def get_default_color_depth(self) -> ColorDepth:
        return ColorDepth.DEPTH_1_BIT

    def write_raw(self, data: str) -> None:
        self.stdout.write("\n" * bool(self._echoed) + ESCAPES.sub("", data))
        self._echoed = ""

    def flush(self) -> None:
        self.stdout.flush()

    def echo(self, message: str, typed: str) -> None:
        """Show the prompt and what is typed: what is new, or all of it in a new row."""
        now, before = message + typed, self._echoed
        if now != before:
            self.stdout.write(now.removeprefix(before) if now.startswith(before) else f"\n{now}")
            self.flush()
            self._echoed = now


_KEYS = re.compile(r"\S|([qjkbfdugn])\1*", re.IGNORECASE)
"""What people type to a pager: one character, or one of its keys several times."""
_NEXT, _LEAVE = frozenset("fjd"), frozenset("qQ")


class Pager:
    """Long help, a screenful at a time: Enter on an empty line shows the next one, `q` leaves it.

    It waits for no key: a command that is typed is a command, and leaves it too. `rest`: the lines not shown yet.
    """

    def __init__(self, session: Session, app: Application[Any]) -> None:
        self._session, self._app = session, app
        self.rest: list[str] = []

    def show(self, lines: Sequence[str]) -> None:
        self.rest = list(lines)
        self.more()

    def takes(self, text: str) -> bool:
        """Take a line that is for a pager, while there is more to show: it must not reach a drive."""
        typed = text.strip()
        if not self.rest or (typed and _KEYS.fullmatch(typed) is None):
            return False
        if not typed or set(typed) <= _NEXT:
            return self.more()
        left = set(typed) <= _LEAVE
        if left:
            self.rest.clear()
        keys = "the help is closed" if left else "Enter shows more help, q closes it"
        self._session.notify(f"'{typed}' was not sent: {keys}")
        return True

    def more(self) -> bool:
        """Show the next lines; False where there are none. In raw mode, where Enter sends a byte, show all of them."""
        size, rows, shown = self._app.output.get_size(), 0, 0
        for shown, line in enumerate(self.rest):
            rows += len(laid_out(line, size.columns))
            if rows > max(1, size.rows - BELOW) and shown and self._session.selected_bus not in self._session.raw:
                break
        else:
            shown = len(self.rest)
        for line in self.rest[:shown]:
            self._session.output(line, columns=True)
        del self.rest[:shown]
        if self.rest:
            self._session.notify(f"Enter shows the next of {counted(len(self.rest), 'more line')}, q closes the help")
        return shown > 0


# The last line of the prompt: the stop key, what runs, and a hint for the line that is being typed.


STOP = "^X STOP ALL"


class Toolbar:
    """The toolbar of one prompt; call it for its text."""

    def __init__(self, session: Session, lines: LineQueue, prompt: PromptSession[str]) -> None:
        self._session, self._lines, self._prompt = session, lines, prompt
        self.progress: Progressed | None = None
        """The last progress of the job that runs."""

    def __call__(self) -> StyleAndTextTuples:
        session = self._session
        room = self._prompt.app.output.get_size().columns - len(f"{STOP}  ")
        parts = [
            f"✗ {session.selected_bus} lost" if session.selected_bus in session.reconnections.trying else "",
            stop_report.headline(session.tally(), room) if session.latched else "",
            " ".join(f"▶ {macro.short}" for macro in session.playing),
            f"recording {session.recording}" if session.recording else "",
            f"log {session.log.path.name}" if session.log else "",
            self._running(),
            complete.hint(session, self._prompt.default_buffer.text) or self._selection(),
        ]
        return [("class:stop", STOP), ("", "".join(f"  {part}" for part in parts if part))]

    def _running(self) -> str:
        """The line that runs, or the progress of its job."""
        if self.progress is not None:
            return self.progress.text
        running = f"running {self._lines.running}" if self._lines.running and self._session.busy else ""
        return self._session.under_way.text or running

    def _selection(self) -> str:
        drive = self._session.selected
        if self._session.selected_bus in self._session.raw:
            return "text goes to the port as it is; /bytes, /raw, /help /raw"
        return f"{drive.label} {model(drive)}".strip() if drive else "/open URL opens a line of drives"


NAMES_WAIT = 2.0
"""The longest wait for the names in a drive, s."""


class SessionCompleter(Completer):
    """The completions of a session."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterable[Completion]:
        text = document.text_before_cursor
        if not text.strip():
            return
        for completion in complete.complete(self._workspace, text):
            yield Completion(completion.text, completion.start - len(text), display_meta=completion.meaning)

    async def get_completions_async(
        self, document: Document, complete_event: CompleteEvent
    ) -> AsyncGenerator[Completion, None]:
        """The same; on Tab, the labels and variables of the drive are read first where they are not known."""
        drive = complete.names_of(self._workspace, document.text_before_cursor)
        asked = complete_event.completion_requested
        reading = self._workspace.names.ask(drive) if asked and drive is not None else None
        if reading is not None:
            await asyncio.wait([reading], timeout=NAMES_WAIT)
        for completion in self.get_completions(document, complete_event):
            yield completion


class SharedHistory(PromptHistory):
    """The shared history file, newest line first."""

    def __init__(self, file: History) -> None:
        super().__init__()
        self._file = file

    def load_history_strings(self) -> Iterable[str]:
        return reversed(self._file.lines())

    def append_string(self, string: str) -> None:
        """Append each line of a paste by itself."""
        for line in string.splitlines():
            super().append_string(line)

    def store_string(self, string: str) -> None:
        """Write a line to the file, after what the event loop does next: the line itself is sent first."""
        asyncio.get_running_loop().call_soon(self._file.append, string)
