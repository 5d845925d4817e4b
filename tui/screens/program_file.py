"""The file whose text is on the screen: opened, saved, and compared with the disk, where other programs may write it.

The text on the screen is what a download sends. A file that another program has changed is read again if its text was
not edited here; else a person is asked. Files are read in threads: a slow disk holds up only the keys.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from enum import Enum, auto
from typing import Any, NamedTuple, Protocol

from textual.app import App

from multidrop.base.errors import Diagnostic
from multidrop.shell.programs.edited_file import ChangedMeanwhile, Outside
from multidrop.tui.editor import ConfigurationGrammar, Grammar
from multidrop.tui.screens.dialogs import Confirm
from multidrop.tui.screens.page import PageHost
from multidrop.tui.screens.program_rows import refusal
from multidrop.tui.text import visible
from multidrop.tui.texts import OpenText

LOOK_PERIOD = 2.0
"""Seconds between two looks at the disk while a text is shown."""
WIDEST = 40
"""Characters of a line that a note quotes."""


class FileOnDisk(Enum):
    """What a look at the disk came to."""

    SAME = auto()
    READ = auto()
    """The file had changed, and its new text is on the screen."""
    ASKED = auto()
    """The file has changed, and so has the text: a question is open."""
    KEPT = auto()
    """The disk has no other text to show, or a person has decided to keep the text on the screen."""


class FirstDifference(NamedTuple):
    """The first line that differs, from 0, and its text now."""

    row: int = 0
    now: str = ""

    @property
    def words(self) -> str:
        """The line in words, as much of it as a box has room for."""
        return f"Line {self.row + 1} is now '{visible(self.now.strip())[:WIDEST]}'"


def first_difference(before: str, now: str) -> FirstDifference:
    """Find the first line in which two texts differ; past the end of the new one it is empty."""
    old, new = before.split("\n"), now.split("\n")
    row = next(
        (n for n, (one, other) in enumerate(zip(old, new, strict=False)) if one != other), min(len(old), len(new))
    )
    return FirstDifference(row, new[row] if row < len(new) else "")


class EditorSheet(Protocol):
    """The parts of a page with an editor that its file uses."""

    host: PageHost
    text: OpenText | None
    grammar: Grammar | None

    @property
    def app(self) -> App[Any]:
        """The app that shows it."""

    @property
    def in_front(self) -> bool:
        """Whether it is shown, without a box in front of it."""

    def take_text(self) -> None:
        """Take the text from the editor."""

    def show_text(self, text: OpenText) -> None:
        """Show a text in the editor."""

    def notify(self, message: str, *, timeout: float | None = None) -> None:
        """Show a line for a while."""

    def run_worker(self, work: Coroutine[Any, Any, Any]) -> object:
        """Run work in the background."""


class FileOnScreen:
    """The file of the text that a page shows."""

    def __init__(self, page: EditorSheet) -> None:
        self._page, self._host = page, page.host
        self.outside = ""
        """What another program did to it, as was last seen and not taken in yet; empty: nothing."""
        self.news = FirstDifference()
        """Where the text that was read again last differs from the one before it."""
        self._looking = False
        self._looked_at = 0.0

    # Opening

    async def open(self, name: str) -> None:
        """Show a file; offer the copy of an earlier session, if there is one."""
        texts, page = self._host.texts, self._page
        self._host.keyboard.hold(page)
        try:
            text = await asyncio.to_thread(texts.open, name)
            draft = await asyncio.to_thread(texts.draft, text)
            page.take_text()
            self.outside = ""
            page.show_text(text)
            await self.catch_up()  # it may have been open already
        except Diagnostic as problem:
            self._fail(problem)
            return
        finally:
            self._host.keyboard.release(page)
        if draft is not None and page.text is text:
            self._offer(text, draft.text, draft.at, texts.overtaken(text, draft))

    def _offer(self, text: OpenText, copy: str, at: str, overtaken: bool) -> None:
        answers = [("take", "Go on with the copy"), ("file", "Use the file, and delete the copy")]
        lines = [f"{text.name} was edited and not saved; its copy is of {at}."]
        if overtaken:
            lines.append("! The file has changed since then: it holds another text now, which the copy lacks.")

        def answered(answer: str | None) -> None:
            if answer == "take":
                text.text, text.kept = copy, copy
                if overtaken:
                    text.file.outdated()  # a save asks
                self._page.show_text(text)
            elif answer == "file":
                self._host.texts.drop_draft(text)

        self._page.app.push_screen(Confirm("A text that was not saved", lines, answers), answered)

    # What other programs write

    def look_is_due(self, now: float) -> bool:
        """Whether it is time for a look at the disk; a look that the disk holds up is the only one."""
        if self._page.text is None or self._looking or now - self._looked_at < LOOK_PERIOD:
            return False
        self._looking, self._looked_at = True, now
        return True

    async def look(self) -> None:
        """Look at the disk, so that the heading is true; nothing is read into the editor."""
        text = self._page.text
        try:
            if text is None:
                return
            file = text.file
            seen = await asyncio.to_thread(file.look)
            if self._page.text is text and text.file is file:
                self.outside = seen.said
        finally:
            self._looking = False

    def come_back(self) -> None:
        """Look at the disk when the page is shown again; keys wait meanwhile."""
        self._host.keyboard.hold(self._page)
        self._page.run_worker(self._come_back())

    async def _come_back(self) -> None:
        try:
            await self.catch_up()
        finally:
            self._host.keyboard.release(self._page)

    async def catch_up(self) -> FileOnDisk:
        """Look at the disk; read a file again that has changed, or ask where the text here has changed, too."""
        page, text = self._page, self._page.text
        if text is None:
            return FileOnDisk.SAME
        file = text.file
        seen = await asyncio.to_thread(file.look)
        if page.text is not text or text.file is not file or not page.in_front:
            return FileOnDisk.SAME
        page.take_text()
        self.outside = seen.said
        return self._caught_up(text, seen) if seen.said else FileOnDisk.SAME

    def _caught_up(self, text: OpenText, seen: Outside) -> FileOnDisk:
        page, now = self._page, seen.now
        if now is None:
            if seen.gone:
                text.file.lost()
                self.outside = ""
            self._note(f"{text.name} {seen.said}. Its text stays here{'; ^S saves it' if seen.gone else ''}")
            return FileOnDisk.KEPT
        if now.text == text.text:  # another program has saved just this text
            text.take(now)
            self._host.texts.drop_draft(text)
            self.outside = ""
            return FileOnDisk.SAME
        if text.changed:
            if text.kept_over == now.data:
                return FileOnDisk.KEPT
            self._ask_which(text, seen)
            return FileOnDisk.ASKED
        self.news = first_difference(text.text, now.text)
        text.take(now)
        text.cursor = (self.news.row, 0)
        self.outside = ""
        page.show_text(text)
        self._host.keyboard.turn_deaf()  # keys that were typed before were meant for the text that was shown
        self._note(f"{text.name} {seen.said}: it was read again. {self.news.words}")
        return FileOnDisk.READ

    def _ask_which(self, text: OpenText, seen: Outside) -> None:
        answers = [("keep", "Keep this text"), ("read", "Give up this text, read the file")]
        lines = [f"{text.name} {seen.said}.", "Another program has written it, and the text here is not saved."]

        def answered(answer: str | None) -> None:
            if seen.now is None:
                return
            if answer == "read":
                text.take(seen.now)
                self._host.texts.drop_draft(text)
                self.outside = ""
                self._page.show_text(text)
            elif answer == "keep":
                text.kept_over = seen.now.data

        self._host.keyboard.turn_deaf()
        self._page.app.push_screen(Confirm("Which text?", lines, answers), answered)

    def _note(self, line: str) -> None:
        self._host.show_line(line, "!")
        self._page.notify(line, timeout=6)

    def _fail(self, problem: Diagnostic | str) -> None:
        self._host.show_line(str(problem), "x")
        self._page.notify(str(problem), timeout=6)

    # Saving

    async def save(self, shown: str | None = None, over: ChangedMeanwhile | None = None) -> bool:
        """Save the text on the screen; return whether that was done. Ask where another program has written the file.

        `shown`: the text that a person has agreed to save.
        """
        page = self._page
        page.take_text()
        text = page.text
        if text is None:
            return False
        if why := refusal(page.grammar, text):
            self._fail(why)
            return False
        try:
            await asyncio.to_thread(text.file.save, text.text if shown is None else shown, over)
        except ChangedMeanwhile as problem:
            self._ask_over(problem)
            return False
        except Diagnostic as problem:
            self._fail(problem)
            return False
        text.kept_over, self.outside = None, ""
        self._host.texts.drop_draft(text)
        configuration = isinstance(page.grammar, ConfigurationGrammar)
        later = "; multidrop reads it when it is started next" if configuration else ""
        self._host.show_line(f"saved {text.name}{later}", ".")
        self._host.model.changed = True  # it may be a macro
        return True

    def _ask_over(self, problem: ChangedMeanwhile) -> None:
        answers = [
            ("no", "Save nothing"),
            ("over", "Save this text over it"),
            ("read", "Give up this text, read the file"),
        ]

        def answered(answer: str | None) -> None:
            text = self._page.text
            if answer == "over":
                self._page.run_worker(self.save(over=problem))
            elif answer == "read" and text is not None:
                name = text.name
                self._host.texts.close(text)
                self._page.text = None
                self._page.run_worker(self.open(name))

        lines = [f"{problem.where} {problem.message}.", "Another program has written it. Nothing was saved or sent."]
        self._page.app.push_screen(Confirm("Save?", lines, answers), answered)
