"""Completion and history in the form that prompt_toolkit takes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Iterable

from prompt_toolkit import PromptSession
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.history import History as PromptHistory

from multidrop.shell import stop_report
from multidrop.shell.events import Progressed
from multidrop.shell.front import complete
from multidrop.shell.front.typed_lines import History, LineQueue
from multidrop.shell.openings import model
from multidrop.shell.session import Session
from multidrop.shell.workspace import Workspace

# The last line of the prompt: the stop key, what runs, and a hint for the line that is being typed.


STOP = "^X STOP ALL"


class Toolbar:
    """The toolbar of one prompt; call it for its text."""

    def __init__(self, session: Session, lines: LineQueue, prompt: PromptSession[str]) -> None:
        self._session, self._lines, self._prompt = session, lines, prompt
        self.progress: Progressed | None = None
        """The last progress of the job that runs."""

    def __call__(self) -> str:
        """Return the text."""
        session = self._session
        room = self._prompt.app.output.get_size().columns - len(f"{STOP}  ")
        parts = [
            STOP,
            f"✗ {session.selected_bus} lost" if session.selected_bus in session.reconnections.trying else "",
            stop_report.headline(session.tally(), room) if session.latched else "",
            " ".join(f"▶ {each.short}" for each in session.playing),
            f"recording {session.recording}" if session.recording else "",
            f"log {session.log.path.name}" if session.log else "",
            self._running(),
            complete.hint(session, self._prompt.default_buffer.text) or self._selection(),
        ]
        return "  ".join(part for part in parts if part)

    def _running(self) -> str:
        """The line that runs, or the progress of its job."""
        if self.progress is not None:
            return self.progress.text
        return f"running {self._lines.running}" if self._lines.running and self._session.busy else ""

    def _selection(self) -> str:
        drive = self._session.selected
        if self._session.selected_bus in self._session.raw:
            return "text goes to the port as it is; /bytes, /raw, /help /raw"
        return f"{drive.label} {model(drive)}".strip() if drive else "/open URL opens a line of drives"


PATIENCE = 2.0
"""The longest wait for the names in a drive, s."""


class SessionCompleter(Completer):
    """The completions of a session."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterable[Completion]:
        """The completions of the text before the cursor."""
        text = document.text_before_cursor
        if not text.strip():
            return
        for each in complete.complete(self._workspace, text):
            yield Completion(each.text, each.start - len(text), display_meta=each.meaning)

    async def get_completions_async(
        self, document: Document, complete_event: CompleteEvent
    ) -> AsyncGenerator[Completion, None]:
        """The same; on Tab, the labels and variables of the drive are read first where they are not known."""
        drive = complete.names_of(self._workspace, document.text_before_cursor)
        asked = complete_event.completion_requested
        reading = self._workspace.names.ask(drive) if asked and drive is not None else None
        if reading is not None:
            await asyncio.wait([reading], timeout=PATIENCE)
        for each in self.get_completions(document, complete_event):
            yield each


class SharedHistory(PromptHistory):
    """The shared history file, newest line first."""

    def __init__(self, file: History) -> None:
        super().__init__()
        self._file = file

    def load_history_strings(self) -> Iterable[str]:
        """The lines of the file."""
        return reversed(self._file.lines())

    def append_string(self, string: str) -> None:
        """Append each line of a paste by itself."""
        for line in string.splitlines():
            super().append_string(line)

    def store_string(self, string: str) -> None:
        """Write a line to the file, after what the event loop does next: the line itself is sent first."""
        asyncio.get_running_loop().call_soon(self._file.append, string)
