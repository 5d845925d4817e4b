"""The transcript of one bus: lines sent, replies, failures. It paints what is in view (`sight`), and takes lines in.

Lines arrive at any rate: taking one only appends to a deque. Rows are styled and wrapped when they are painted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from textual import events
from textual.geometry import Size

from multidrop.shell.transcripts import Filter
from multidrop.tui.screen_model import Record
from multidrop.tui.widgets import gutter
from multidrop.tui.widgets.gutter import SENT, Clocks
from multidrop.tui.widgets.lines import Lines, Row, Span, spread, width_of
from multidrop.tui.widgets.records import Records
from multidrop.tui.widgets.sight import Picked, Search, Sight

SAID = frozenset({"", ".", "!"})


class Transcript(Lines, can_focus=False):
    """Shows records; see the module. `times`: the form of their times, a word of `TIMES`."""

    def __init__(self, clock: Callable[[float], str], times: str = "clock", *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.records = Records()
        self.sight = Sight(self.records)
        self.clocks = Clocks(times, clock)
        self.search: Search | None = None
        self.picked: Picked | None = None
        self._view: list[Row] | None = None
        self._made: dict[int, list[Row]] = {}
        """Rows of the records in view, by number, for what is in `_made_for`: scrolling leaves most of them."""
        self._made_for: object = None
        self._unshown = False

    def since_typed(self) -> list[str]:
        """Results, narration and warnings of the verb typed last; a line for a drive asks before it is sent."""
        found: list[str] = []
        for record in reversed(self.records):
            if record.mark in SENT:
                return found[::-1] if record.text.startswith("/") else []
            if record.mark in SAID:
                found.append(record.text)
        return []

    # Taking in

    def extend(self, records: Iterable[Record]) -> None:
        """Take in records, oldest first, and show them."""
        self.take(records)
        self.show_new()

    def take(self, records: Iterable[Record]) -> None:
        """Take in records, oldest first; `show_new` shows them."""
        new = list(records)
        self.records.take(new)
        self.clocks = self.clocks._replace(start=self.records.began)
        self._unshown = self._unshown or bool(new)

    def show_new(self) -> None:
        """Show what was taken in since the last time."""
        if self._unshown:
            self._unshown = False
            self.changed()

    def clear(self) -> None:
        """Forget all records."""
        self.records.clear()
        self.sight.look_end(newest=True)
        self.changed()

    # What is in view

    def look(self, lines: int) -> None:
        """Scroll up (negative) or down by lines; scrolling past the newest follows new lines again."""
        self.sight.look(lines)
        self.changed()

    def look_page(self, direction: int) -> None:
        """Scroll up or down by one view, less one line."""
        self._rows()
        self.sight.look_page(direction)
        self.changed()

    def look_end(self, newest: bool) -> None:
        """Go to the newest or to the oldest line."""
        self.sight.look_end(newest)
        self.changed()

    def pause(self) -> None:
        """Stop the scrolling, or let it go on."""
        self.sight.pause()
        self.changed()

    def choose(self, wanted: Filter, *, typed: bool = False) -> None:
        """Show only some records. `typed`: also what a person types from now on, with its replies."""
        self.sight.choose(wanted, typed=typed)
        self.changed()

    def set_times(self, form: str) -> None:
        """Show times in another form."""
        self.clocks = self.clocks._replace(form=form)
        self.changed()

    def reveal(self, number: int | None) -> None:
        """Make sure that a record which was brought into view is there, also below records of many rows."""
        self.changed()
        self._rows()
        if number is not None and self.sight.top > number:
            self.sight.show_last(number)
            self.changed()

    def changed(self) -> None:
        """Paint again."""
        self._view = None
        self.refresh()

    # Painting

    def notify_style_update(self) -> None:
        """Repaint under another theme."""
        super().notify_style_update()
        self._view = None

    def on_resize(self, event: events.Resize) -> None:
        """Wrap again for the new width."""
        self.changed()

    def shown(self) -> list[Row]:
        """The rows in view."""
        return self._rows()

    @property
    def plain(self) -> str:
        """The text in view, without styles."""
        return "\n".join("".join(text for text, _ in row).rstrip() for row in self._rows())

    def _rows(self) -> list[Row]:
        if self._view is None:
            self._view = self._make(self.size)
        return self._view

    def _make(self, size: Size) -> list[Row]:
        sight = self.sight
        sight.height = size.height
        foot = self._foot(size.width)
        height = size.height - len(foot)
        numbers, place = sight.numbers, sight.end
        valid = (size.width, self.clocks.form, sight.filter)
        before, self._made = self._made if self._made_for == valid else {}, {}
        self._made_for = valid
        rows: list[Row] = []
        while place > 0 and len(rows) < height:
            place -= 1
            number = numbers[place]
            above = self.records[numbers[place - 1]] if place else None
            made = before.get(number) or self.rows_of(self.records[number], above, size.width)
            self._made[number] = made
            rows.extend(reversed(self._decorated(number, made)))
        sight.top = numbers[min(place, len(numbers) - 1)] if len(numbers) else 0  # a view without rows shows none
        rows.reverse()
        rows = rows[max(0, len(rows) - height) :]
        blank: list[Row] = [()] * (height - len(rows)) if foot else []
        return rows + blank + foot

    def rows_of(self, record: Record, before: Record | None, width: int) -> list[Row]:
        """A record as rows of the view; `before` is the one above it."""
        return gutter.rows_of(record, before, self.clocks, width)

    def _decorated(self, number: int, rows: list[Row]) -> list[Row]:
        """The rows of a record with the marks of a search or a selection."""
        if self.picked is not None and number in self.picked:
            return [gutter.chosen(row) for row in rows]
        text = self.search.text if self.search is not None else ""
        if not text or text.casefold() not in self.records[number].text.casefold():
            return rows
        here = self.search is not None and self.search.at == number
        role = "focus" if here else "found"
        found = [gutter.found_in(row, text, self.clocks.gutter, role) for row in rows]
        return [gutter.marked(found[0], "►" if here else "•", "accent"), *found[1:]]

    def _foot(self, width: int) -> list[Row]:
        """The last row, while the view shows less than everything up to the newest line."""
        sight = self.sight
        left: list[Span] = []
        if sight.filter:
            counted = f"{len(sight.numbers)} of {len(self.records)} lines"
            left = [(f" {sight.filter.words} ", "focus"), (f" {counted}   /filter off shows all", "dim")]
        elif sight.at_oldest and self.records.dropped:
            left = [(f" {self.records.dropped} older lines were dropped", "dim")]
        right: list[Span] = []
        if sight.paused:
            right = [(f" PAUSED   {sight.below} new below   Ctrl+S: go on ", "focus")]
        elif not sight.following and sight.below:
            right = [(f" ▼ {sight.below} more below   Ctrl+End: follow ", "focus")]
        if not left and not right:
            return []
        if width_of(left) + width_of(right) + 1 > width:
            left = left[:1] if right else left
        return [_ends(left, right, width)]

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Scroll up three lines."""
        self.look(-3)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Scroll down three lines."""
        self.look(3)


def _ends(left: list[Span], right: list[Span], width: int) -> Row:
    """Two texts at the ends of a row; the right one alone where both have no room."""
    return spread(left, right, width) if width_of(left) + width_of(right) <= width else spread(right, (), width)
