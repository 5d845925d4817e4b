"""The row in which a transcript is searched, or lines of it are picked and copied; it is there only meanwhile.

The typed line stays as it is below. A stop closes the row, as it closes dialogs.
"""

from __future__ import annotations

import os
from collections.abc import Callable

from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.geometry import Size
from textual.reactive import Reactive
from textual.widgets import Input

from multidrop.base.text import counted
from multidrop.tui.key_table import Keyed, hint
from multidrop.tui.widgets.lines import Lines, Row, spread, width_of
from multidrop.tui.widgets.transcript import Transcript
from multidrop.tui.widgets.viewport import Picked, RecordSearch

LONGEST_SEARCH_TEXT = 200
"""Characters of a searched text."""
MOST_COPIED = 50_000
"""Characters that terminals take into their clipboard."""
FIND = " find ▸ "
COUNTS_WIDTH = 17
"""Width of `50000 of 50000`."""
LEAST_ENTRY_WIDTH = 22
"""Width of the searched text and its label at least."""
PICK_KEYS = (f"{hint('pick')} ", "Enter copy   Esc close ", "Enter ")
KEYS = (f"   {hint('find')} ", "   Esc close ", "")


class FindField(Keyed, Input):
    """The searched text. `edited` takes each change, `act` the keys."""

    SHEET = "find"
    virtual_size = Reactive(Size(0, 0))
    """As of the input line: a longer text changes no layout."""

    def __init__(self, edited: Callable[[str], None], act: Callable[[str], None]) -> None:
        super().__init__(id="find", compact=True, max_length=LONGEST_SEARCH_TEXT, select_on_focus=False)
        self.cursor_blink = False
        self._edited, self._act = edited, act

    def watch_value(self, value: str) -> None:
        self._edited(value)

    def action_act(self, what: str) -> None:
        self._act(what)


class PickBar(Keyed, Lines, can_focus=True):
    """The keys while lines are picked. `move` takes lines and whether to extend, `act` the other keys."""

    SHEET = "pick"

    def __init__(self, move: Callable[[int, bool], None], act: Callable[[str], None]) -> None:
        super().__init__(id="pick")
        self._move, self._act = move, act

    def action_move(self, by: int, extend: bool) -> None:
        self._move(by, extend)

    def action_act(self, what: str) -> None:
        self._act(what)


class SearchBar(Horizontal):
    """The row. `leave` gives the keys back to the input line."""

    def __init__(self, leave: Callable[[], None], *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._leave = leave
        self._label, self._words = Lines(id="find-label"), Lines(id="find-words")
        self._field = FindField(self._edited, self._act)
        self._bar = PickBar(self._move, self._act)
        self._transcript: Transcript | None = None
        self._extends = False

    def compose(self) -> ComposeResult:
        yield self._label
        yield self._field
        yield self._words
        yield self._bar

    @property
    def open(self) -> bool:
        return self._transcript is not None

    def find(self, transcript: Transcript) -> None:
        """Search a transcript; again: the next older record."""
        if transcript.search is not None:
            self._act("older")
            return
        self.close()
        transcript.search = RecordSearch(transcript.sight)
        self._begin(transcript, picking=False)
        self._label.put([((FIND, "accent"),)])
        self._field.value = ""
        self.screen.set_focus(self._field)

    def pick(self, transcript: Transcript, by: int = 0) -> None:
        """Pick lines of a transcript; again: move by lines, and pick those between."""
        if transcript.picked is not None:
            self._move(by, True)
            return
        self.close()
        transcript.picked, self._extends = Picked(transcript.sight), False
        self._begin(transcript, picking=True)
        transcript.changed()
        self.screen.set_focus(self._bar)

    def _begin(self, transcript: Transcript, picking: bool) -> None:
        self._transcript = transcript
        self.display, self._bar.display = True, picking
        self._field.display = self._label.display = self._words.display = not picking
        self.tell()

    def close(self) -> None:
        """End what is going on; the view stays where it is, or follows again where nothing was found."""
        transcript, self._transcript = self._transcript, None
        self.display = False
        if transcript is None:
            return
        for ending in (transcript.search, transcript.picked):
            if ending is not None:
                ending.end()
        transcript.search = transcript.picked = None
        transcript.changed()
        self._leave()

    # Keys

    def _edited(self, text: str) -> None:
        transcript = self._transcript
        if transcript is not None and transcript.search is not None:
            transcript.search.find(text)
            self._reveal(transcript, transcript.search.at)

    def _move(self, by: int, extend: bool) -> None:
        transcript = self._transcript
        if transcript is not None and transcript.picked is not None:
            transcript.picked.move(by, extend or self._extends)
            self._reveal(transcript, transcript.picked.cursor)

    def _reveal(self, transcript: Transcript, number: int | None) -> None:
        transcript.reveal(number)
        self.tell()

    def _act(self, what: str) -> None:
        transcript = self._transcript
        if transcript is None or what == "close":
            self.close()
        elif what == "only" and transcript.search is not None:
            # Show only the records that hold the text.
            text = transcript.search.text
            self.close()
            if text:
                transcript.choose(transcript.sight.filter._replace(text=text), typed=True)
                transcript.look_end(newest=True)
        elif what == "copy" and transcript.picked is not None:
            self._copy(transcript.picked)
        elif what == "extend":
            self._extends = not self._extends
            self.tell()
        elif transcript.search is not None:
            transcript.search.step(-1 if what == "older" else 1)
            self._reveal(transcript, transcript.search.at)

    def _copy(self, picked: Picked) -> None:
        """Send the picked lines to the clipboard of the terminal, which says nothing about it."""
        lines = (line for record in picked.records for line in (record.text, *record.details))
        text, said = "\n".join(lines), size_of(picked)
        if len(text) > MOST_COPIED:
            self.app.notify(f"{said}: too much for a terminal's clipboard; /save FILE writes a file", timeout=6)
            return
        self.app.copy_to_clipboard(text)
        multiplexed = "; tmux takes it after: set -s set-clipboard on" if "TMUX" in os.environ else ""
        self.app.notify(f"Sent {said} to the terminal's clipboard{multiplexed}", timeout=6)
        self.close()

    # Words

    def tell(self) -> None:
        """Show the place among the records that were found, or the lines that are picked."""
        transcript = self._transcript
        if transcript is None:
            return
        if transcript.search is not None:
            self._words.put([self._found(transcript.search)])
        elif transcript.picked is not None:
            left = ((" copy ▸ ", "accent"), (size_of(transcript.picked), "strong"))
            room = self.size.width - width_of(left)
            keys = next((key for key in PICK_KEYS if len(key) + 1 < room), "")
            self._bar.put([spread(left, ((keys, "dim"),), self.size.width)])

    def _found(self, search: RecordSearch) -> Row:
        place, count = search.place
        counts = f"{place} of {count}" if count else "nothing" if search.text else ""
        keys = next(key for key in KEYS if not key or len(key) + COUNTS_WIDTH + LEAST_ENTRY_WIDTH <= self.size.width)
        room = len(keys) + COUNTS_WIDTH
        self._words.styles.width = room
        return spread((), ((counts, "strong" if count or not search.text else "error"), (keys, "dim")), room)


def size_of(picked: Picked) -> str:
    """`3 lines, 42 characters`."""
    records = picked.records
    characters = sum(len(record.text) for record in records) + max(0, len(records) - 1)
    return f"{counted(len(records), 'line')}, {counted(characters, 'character')}"
