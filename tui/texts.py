"""The texts under editing in this session: they stay while no page shows them, and a copy survives a crash."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from multidrop.base.errors import Diagnostic
from multidrop.shell.programs.edited_file import EditedFile, real_text
from multidrop.shell.state.backups import Copy, Drafts


@dataclass
class OpenText:
    """A file and its text as edited."""

    file: EditedFile
    text: str
    cursor: tuple[int, int] = (0, 0)
    kept: str | None = None
    """The text of which a copy is kept; None: there is no copy."""
    kept_over: bytes | None = None
    """The content on the disk over which a person decided to keep this text; None: there was no such question."""

    def take(self, now: EditedFile) -> None:
        """Show the file as it is on the disk now."""
        self.file, self.text, self.kept_over = now, now.text, None

    @property
    def name(self) -> str:
        return str(self.file.path)

    @property
    def changed(self) -> bool:
        return self.text != self.file.text


class Texts:
    """The open texts by absolute path. `drafts`: None keeps no copies."""

    def __init__(self, drafts: Drafts | None) -> None:
        self._drafts = drafts
        self._open: dict[str, OpenText] = {}
        self.current: OpenText | None = None
        """The text that was shown last."""
        self.take: Callable[[], None] | None = None
        """Takes the text from the editor that shows it; None: no editor does."""

    def open(self, path: str) -> OpenText:
        """Show a file; one that is open already has its text. Raises Diagnostic."""
        place = str(Path(path).absolute())
        if place not in self._open:
            file = EditedFile(path)
            self._open[place] = OpenText(file, file.text)
        self.current = self._open[place]
        return self.current

    def open_at(self, where: str) -> OpenText:
        """Show a file at a line, as an error names its place: `FILE:LINE`, or `FILE` alone. Raises Diagnostic."""
        path, _, line = where.rpartition(":")
        text = self.open(path if path and line.isdecimal() else where)
        text.cursor = (int(line) - 1 if path and line.isdecimal() else 0, 0)
        return text

    def draft(self, text: OpenText) -> Copy | None:
        """A copy of an earlier session that differs from the file; None without one."""
        if self._drafts is None or text.changed or text.kept is not None:
            return None
        draft = self._drafts.find(text.name)
        return draft if draft is not None and draft.text != real_text(text.text) else None

    def overtaken(self, text: OpenText, draft: Copy) -> bool:
        """True if the file has changed since the copy was made of it."""
        return draft.base not in ("", text.file.digest)

    def unsaved(self) -> list[OpenText]:
        if self.take is not None:
            self.take()
        return [text for text in self._open.values() if text.changed]

    def due(self, text: OpenText) -> bool:
        """True if the copy of a text is not the text."""
        return self._drafts is not None and (text.kept is not None if not text.changed else text.kept != text.text)

    def keep(self, text: OpenText) -> None:
        """Make the copy of a text agree with it. Raises Diagnostic. For a thread: it syncs."""
        if self._drafts is None:
            return
        now = text.text
        if text.changed:
            at = f"{datetime.now():%Y-%m-%d %H:%M}"
            self._drafts.keep(Copy(text.name, real_text(now), at, text.file.digest))
            text.kept = now
        else:
            self.drop_draft(text)

    def drop_draft(self, text: OpenText) -> None:
        """Delete the copy of a text: it is saved, or given up."""
        if self._drafts is not None:
            self._drafts.forget(text.name)
        text.kept = None

    def close(self, text: OpenText) -> None:
        self.drop_draft(text)
        self._open = {place: open_text for place, open_text in self._open.items() if open_text is not text}
        self.current = None if self.current is text else self.current

    def flush(self) -> list[str]:
        """Keep a copy of every text that is not saved; return what could not be kept, a line each."""
        failures = []
        for text in self.unsaved():
            try:
                if self.due(text):
                    self.keep(text)
            except Diagnostic as problem:
                failures.append(str(problem))
        return failures


def unsaved_of(texts: Texts) -> list[str]:
    """The names of the files with a text that was not saved."""
    return [text.name for text in texts.unsaved()]
