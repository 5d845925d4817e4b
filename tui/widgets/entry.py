"""The input line: the typed text, its completions above it, its meaning beside it, and the lines typed before.

Enter always sends the line. Tab steps through the completions, Up and Down through history (lines that begin with the
typed text), and Escape closes the list. Several pasted lines are not typed: they are handed on as a whole.

The meaning of a key depends only on the line, never on work in progress: completions and history are matched to the
line by the text that they put into it.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Protocol

from textual import events
from textual.binding import Binding, BindingType
from textual.geometry import Size
from textual.message import Message
from textual.reactive import Reactive
from textual.widgets import Input
from textual.widgets.input import Selection

from multidrop.base.errors import Diagnostic
from multidrop.base.files import lines_of
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row

if TYPE_CHECKING:
    from multidrop.shell.prompt.complete import Completion

LISTED = 8
"""Number of completions in view."""
LONGEST_COMPLETED_LINE = 200
"""Length in characters from which no line is looked up: no command is that long."""


class Complete(Protocol):
    """Completes a text."""

    def __call__(self, text: str, learned: Callable[[], None] | None = None) -> Sequence[Completion]:
        """Return the completions. `learned`: a person asks for them; it is called when there are more."""


Typed = Callable[[str, Callable[[], object]], Awaitable[None]]
"""Takes a submitted line, and calls the function, which empties the input line, once the line is on its way."""


class Recall:
    """A walk through earlier lines that begin with the typed text."""

    def __init__(self, lines: Callable[[], Sequence[str]]) -> None:
        self._lines = lines
        self._typed = ""
        self._found: list[str] = []
        self._at = -1
        self._shown: str | None = None
        """The line that the last step put in; an edited line starts a new walk."""

    def older(self, text: str) -> str | None:
        """Return the next older line; None if there is none."""
        if text != self._shown:
            matching = [line for line in self._lines() if line.startswith(text) and line != text]
            self._typed, self._found, self._at = text, list(dict.fromkeys(reversed(matching))), -1
        if self._at + 1 >= len(self._found):
            return None
        self._at += 1
        self._shown = self._found[self._at]
        return self._shown

    def newer(self, text: str) -> str | None:
        """Return the next newer line, at the end the typed text; None at the newest line."""
        if text != self._shown or self._at < 0:
            return None
        self._at -= 1
        self._shown = self._found[self._at] if self._at >= 0 else self._typed
        return self._shown


@dataclass
class CompletionListing:
    """The completions of the typed text, and the one that is in the line."""

    typed: str = ""
    found: Sequence[Completion] = ()
    chosen: int = -1

    @property
    def open(self) -> bool:
        return bool(self.found)

    @property
    def line(self) -> str:
        """The line as the list has put it, until a person edits it."""
        if self.chosen < 0:
            return self.typed
        choice = self.found[self.chosen]
        return self.typed[: choice.start] + choice.text

    def step(self, by: int) -> str:
        """Choose the next completion, or the one before; return the line with it."""
        self.chosen = (self.chosen + by) % len(self.found) if self.chosen >= 0 or by > 0 else len(self.found) - 1
        return self.line

    def rows(self, width: int) -> list[Row]:
        """The part of the list around the chosen one, `width` cells wide."""
        first = max(0, min(self.chosen - LISTED // 2, len(self.found) - LISTED))
        rows: list[Row] = []
        for number in range(first, min(first + LISTED, len(self.found))):
            completion = self.found[number]
            word = fit(f" {completion.text}", 14) + " "
            more = f" {number + 1}/{len(self.found)}" if number == first + LISTED - 1 else ""
            meaning = fit(completion.meaning, width - 15 - len(more) - 1) + more + " "
            chosen = number == self.chosen
            rows.append(((word, "focus" if chosen else "strong"), (meaning, "focus" if chosen else "dim")))
        return rows


@dataclass
class LineDraft:
    """A line that is being edited: its text, its cursor, its completions, its place in history."""

    recall: Recall
    text: str = ""
    selection: Selection = field(default_factory=lambda: Selection.cursor(0))
    listing: CompletionListing = field(default_factory=CompletionListing)


class Entry(Input):
    """The input line. It awaits `typed` with each line, an empty one too, and with the function that empties it.

    It awaits `pasted` with several pasted lines.
    It posts `Edited` when its list or its text changes.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "recall(1)", show=False),
        Binding("down", "recall(-1)", show=False),
        Binding("tab", "complete(1)", show=False),
        Binding("shift+tab", "complete(-1)", show=False),
        Binding("escape", "fold", show=False),
    ]

    virtual_size = Reactive(Size(0, 0))
    """The size of the text; unlike that of other widgets, it changes no layout: the line is as wide as it is."""

    class Edited(Message):
        """The text or the list of completions changed."""

    def __init__(
        self,
        complete: Complete,
        lines: Callable[[], Sequence[str]],
        typed: Typed,
        pasted: Callable[[list[str]], Awaitable[None]],
        *,
        id: str | None = None,
    ) -> None:
        super().__init__(id=id, compact=True, select_on_focus=False)
        self.cursor_blink = False
        self.listing = CompletionListing()
        self._complete, self._lines = complete, lines
        self._typed, self._pasted = typed, pasted
        self._recall = Recall(lines)
        self._submitted = False
        """The text was handed on, and is still in the line."""

    def put(self, text: str) -> None:
        """Put text into the line without looking up completions for it."""
        self.listing = CompletionListing(text)
        self._show(text)

    def _show(self, text: str) -> None:
        self.value = text
        self.cursor_position = len(text)
        self.post_message(self.Edited())

    @property
    def unsent(self) -> str:
        return "" if self._submitted else self.value

    def exchange(self, draft: LineDraft | None = None) -> LineDraft:
        """Take up another line, an empty one by default, and return the current one."""
        before = LineDraft(self._recall, self.unsent, self.selection, self.listing)
        draft = draft or LineDraft(Recall(self._lines))
        self._recall, self.listing = draft.recall, draft.listing
        self.value, self.selection = draft.text, draft.selection
        self._submitted = False
        self.post_message(self.Edited())
        return before

    def take_in(self, draft: LineDraft) -> None:
        """Insert another line at the cursor, with its own cursor."""
        start = min(self.selection)
        self.replace(draft.text, *self.selection)
        self.cursor_position = start + draft.selection.end

    def on_input_changed(self, event: Input.Changed) -> None:
        """Look up completions for typed text, but not for text that we put in."""
        event.stop()
        if event.value != self.value:
            return  # of a burst of keys, look up only the last one
        if self.value != self.listing.line:
            self.listing = self._look_up(self.value)
        self.post_message(self.Edited())

    def _look_up(self, text: str) -> CompletionListing:
        if not text.strip() or not self.cursor_at_end or len(text) > LONGEST_COMPLETED_LINE:
            return CompletionListing(text)
        completions = list(self._complete(text))
        if len(completions) == 1 and text[: completions[0].start] + completions[0].text == text:
            completions = []
        return CompletionListing(text, completions)

    async def action_submit(self) -> None:
        self._submitted = True
        await self._typed(self.value, self.exchange)

    def action_recall(self, direction: int) -> None:
        """Step through history on Up and Down; in the list while one of it is chosen."""
        if self.listing.chosen >= 0 and self.value == self.listing.line:
            self.action_complete(-direction)
            return
        text = self._recall.older(self.value) if direction > 0 else self._recall.newer(self.value)
        if text is not None:
            self.put(text)

    def action_complete(self, direction: int) -> None:
        """Put the next completion into the line on Tab; on an empty line, list all words."""
        text = self.value
        if (text != self.listing.line or not self.listing.open) and len(text) <= LONGEST_COMPLETED_LINE:
            self.listing = CompletionListing(text, list(self._complete(text, self._learned)))
        if self.listing.open:
            self._show(self.listing.step(direction))

    def _learned(self) -> None:
        """List more completions, unless one of them is in the line already."""
        if self.listing.chosen < 0 and self.value == self.listing.line and self.is_attached:
            self.listing = self._look_up(self.value)
            self.post_message(self.Edited())

    def action_fold(self) -> None:
        self.listing = CompletionListing(self.value)
        self.post_message(self.Edited())

    async def on_paste(self, event: events.Paste) -> None:
        """Insert one pasted line; hand on several."""
        event.stop()
        event.prevent_default()
        try:
            lines = [line.rstrip(" \t") for line in lines_of(event.text) if line.strip()]
        except Diagnostic as problem:
            self.notify(f"{problem}; nothing was pasted")
            return
        if len(lines) > 1:
            await self._pasted(lines)
        elif lines:
            self.replace(lines[0].replace("\t", " "), *self.selection)
