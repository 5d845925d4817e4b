"""The last line of the prompt: the stop key, what runs, and a hint for the line that is being typed."""

from __future__ import annotations

from prompt_toolkit import PromptSession

from shell import stops
from shell.events import Progressed
from shell.front import complete
from shell.front.line_queue import LineQueue
from shell.naming import model
from shell.session import Session

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
            stops.headline(session.tally(), room) if session.latched else "",
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
