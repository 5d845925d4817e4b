"""The input line: what is typed, its completions above it, its meaning beside it, and the lines typed before.

Enter sends what stands in the line, always. Tab goes through the completions, Up and Down through history (of the lines
that begin with what was typed), Escape closes the list. Several pasted lines are not typed: they are handed on whole.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

from textual import events
from textual.binding import Binding, BindingType
from textual.message import Message
from textual.widgets import Input

from tui.lines import Lines, Row
from tui.text import fit

LISTED = 8
"""Completions in view."""
MENU_WIDTH = 64


class CompletionView(Protocol):
    """A completion: `text` goes in place of what was typed from character `start` on."""

    @property
    def text(self) -> str:
        """What is put in."""

    @property
    def meaning(self) -> str:
        """One line."""

    @property
    def start(self) -> int:
        """Index of the first character that it replaces."""


Complete = Callable[[str], Sequence[CompletionView]]


class Recall:
    """Going through earlier lines that begin with what was typed."""

    def __init__(self, lines: Callable[[], Sequence[str]]) -> None:
        self._lines = lines
        self._typed: str | None = None
        self._found: list[str] = []
        self._at = 0

    def reset(self) -> None:
        """Somebody typed: begin anew."""
        self._typed = None

    def older(self, text: str) -> str | None:
        """The next older line, or None where there is none."""
        if self._typed is None:
            self._typed = text
            matching = [line for line in self._lines() if line.startswith(text) and line != text]
            self._found = list(dict.fromkeys(reversed(matching)))
            self._at = -1
        if self._at + 1 >= len(self._found):
            return None
        self._at += 1
        return self._found[self._at]

    def newer(self) -> str | None:
        """The next newer line; at the end what was typed; None where nobody went back."""
        if self._typed is None or self._at < 0:
            return None
        self._at -= 1
        return self._found[self._at] if self._at >= 0 else self._typed


@dataclass
class Listing:
    """The completions of what was typed, and which of them stands in the line."""

    typed: str = ""
    found: Sequence[CompletionView] = ()
    chosen: int = -1

    @property
    def open(self) -> bool:
        """Whether there is anything to show."""
        return bool(self.found)

    def step(self, by: int) -> str:
        """Choose the next (or the one before); the line as it reads then."""
        self.chosen = (self.chosen + by) % len(self.found) if self.chosen >= 0 or by > 0 else len(self.found) - 1
        choice = self.found[self.chosen]
        return self.typed[: choice.start] + choice.text

    def rows(self, width: int) -> list[Row]:
        """The part of the list around the chosen one, `width` cells wide."""
        first = max(0, min(self.chosen - LISTED // 2, len(self.found) - LISTED))
        rows: list[Row] = []
        for number in range(first, min(first + LISTED, len(self.found))):
            each = self.found[number]
            word = fit(f" {each.text}", 14) + " "
            more = f" {number + 1}/{len(self.found)}" if number == first + LISTED - 1 else ""
            meaning = fit(each.meaning, width - 15 - len(more) - 1) + more + " "
            chosen = number == self.chosen
            rows.append(((word, "focus" if chosen else "strong"), (meaning, "focus" if chosen else "dim")))
        return rows


class Entry(Input):
    """The input line. It posts `Typed`, `Pasted` and, when its list or its text changes, `Edited`."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "recall(1)", show=False),
        Binding("down", "recall(-1)", show=False),
        Binding("tab", "complete(1)", show=False),
        Binding("shift+tab", "complete(-1)", show=False),
        Binding("escape", "fold", show=False),
    ]

    class Typed(Message):
        """Enter was pressed on a line."""

        def __init__(self, line: str) -> None:
            super().__init__()
            self.line = line

    class Pasted(Message):
        """Several lines were pasted."""

        def __init__(self, lines: list[str]) -> None:
            super().__init__()
            self.lines = lines

    class Edited(Message):
        """The text or the list of completions changed."""

    def __init__(self, complete: Complete, lines: Callable[[], Sequence[str]], *, id: str | None = None) -> None:
        super().__init__(id=id, compact=True, select_on_focus=False)
        self.cursor_blink = False
        self.listing = Listing()
        self._complete = complete
        self._recall = Recall(lines)
        self._putting: str | None = None
        """What we put in ourselves, and of which we are about to be told."""

    def put(self, text: str) -> None:
        """Put text into the line, as if it had stood there: no completions are looked up for it."""
        if text != self.value:
            self._putting = text
            self.value = text
        self.cursor_position = len(text)

    def on_input_changed(self, event: Input.Changed) -> None:
        """Look up completions for what is typed, not for what we put in."""
        event.stop()
        if event.value != self._putting:
            self._recall.reset()
            self.listing = self._look_up(event.value)
        self._putting = None
        self.post_message(self.Edited())

    def _look_up(self, text: str) -> Listing:
        if not text.strip() or not self.cursor_at_end:
            return Listing()
        found = list(self._complete(text))
        if len(found) == 1 and text[: found[0].start] + found[0].text == text:
            found = []
        return Listing(text, found)

    async def action_submit(self) -> None:
        """Send the line; an empty one says nothing."""
        line = self.value.strip()
        self.listing = Listing()
        self._recall.reset()
        self.put("")
        self.post_message(self.Edited())
        if line:
            self.post_message(self.Typed(line))

    def action_recall(self, direction: int) -> None:
        """Up and Down: in the list while one of it is chosen, else through history."""
        if self.listing.open and self.listing.chosen >= 0:
            self.action_complete(-direction)
            return
        text = self._recall.older(self.value) if direction > 0 else self._recall.newer()
        if text is not None:
            self.listing = Listing()
            self.put(text)
            self.post_message(self.Edited())

    def action_complete(self, direction: int) -> None:
        """Tab: the next completion into the line; on an empty line, all that can be said."""
        if not self.listing.open:
            self.listing = Listing(self.value, list(self._complete(self.value)))
        if self.listing.open:
            self.put(self.listing.step(direction))
        self.post_message(self.Edited())

    def action_fold(self) -> None:
        """Escape: close the list."""
        self.listing = Listing()
        self.post_message(self.Edited())

    def _on_paste(self, event: events.Paste) -> None:
        lines = [line.rstrip() for line in event.text.splitlines() if line.strip()]
        event.stop()
        event.prevent_default()
        if len(lines) > 1:
            self.post_message(self.Pasted(lines))
        elif lines:
            self.insert_text_at_cursor(lines[0].replace("\t", " "))


class Menu(Lines):
    """The list of completions, above the line."""

    def show(self, listing: Listing, left: int, below: int) -> None:
        """Show it with its text at column `left` and `below` lines under it, or hide."""
        self.display = listing.open
        if listing.open:
            width = min(MENU_WIDTH, self.screen.size.width - left - 1)
            rows = listing.rows(width)
            self.styles.width, self.styles.height = width, len(rows)
            self.styles.margin = (0, 0, below, max(0, left - 1))
            self.put(rows)
