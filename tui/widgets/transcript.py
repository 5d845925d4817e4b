"""The transcript of one bus: lines sent, replies, failures; it keeps fifty thousand lines and shows the last.

Lines arrive at any rate: taking one only appends to a deque. Rows are styled and wrapped when they are painted. The
view is anchored at its bottom line, which is the newest one unless the reader has gone up. Then the view stays on that
line, however much arrives, until the deque drops it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from itertools import islice

from rich.cells import chop_cells
from textual import events
from textual.geometry import Size
from textual.strip import Strip

from shell.layout import laid_out
from tui.screen_model import KEPT, Record
from tui.text import at_words, fit, visible
from tui.widgets.lines import Lines, Row

GUTTER = 17
"""Width before the text in cells: time, address, mark."""


MARKS = {
    ">": ("›", "strong"),
    "»": ("»", "strong"),
    "": (" ", "text"),
    "<": ("«", "text"),
    "x": ("✗", "error"),
    ".": ("·", "dim"),
    "!": ("!", "strong"),
}
"""Typed by a person, sent by automation, reply, unsolicited, failure, narration, warning."""
SENT = frozenset(">»")
SAID = frozenset({"", ".", "!"})
VERBATIM = frozenset({">", "»", "<", ""})
"""Marks of records in a drive's own language, where every space counts."""
DATED = frozenset(">»<.!")
"""Marks of records that show their time; a reply follows the line that it answers."""


class Transcript(Lines, can_focus=False):
    """Stores records, and shows the last ones; see the module."""

    def __init__(self, clock: Callable[[float], str], *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.clock = clock
        self.records: deque[Record] = deque(maxlen=KEPT)
        self.taken = 0
        self._bottom: int | None = None
        self._view: list[Row] | None = None
        self._top = 0
        self._made: dict[int, list[Row]] = {}
        """Rows of the records in view, by number, for the width in `_made_for`: scrolling leaves most of them."""
        self._made_for = 0
        self._unshown = False

    def since_typed(self) -> list[str]:
        """Results, narration and warnings since the last typed line."""
        found: list[str] = []
        for record in reversed(self.records):
            if record.mark in SENT:
                break
            if record.mark in SAID:
                found.append(record.text)
        return found[::-1]

    # Taking in

    def extend(self, records: Iterable[Record]) -> None:
        """Take in records, oldest first, and show them."""
        self.take(records)
        self.show_new()

    def take(self, records: Iterable[Record]) -> None:
        """Take in records, oldest first; `show_new` shows them."""
        new = list(records)
        self.records.extend(new)
        self.taken += len(new)
        self._unshown = self._unshown or bool(new)
        if self._bottom is not None:
            self._bottom = max(self._bottom, self._top_most)

    def show_new(self) -> None:
        """Show what was taken in since the last time."""
        if self._unshown:
            self._unshown = False
            self._changed()

    def clear(self) -> None:
        """Forget all records."""
        self.records.clear()
        self._made.clear()
        self._bottom = None
        self._changed()

    @property
    def first(self) -> int:
        """The number of the oldest stored record."""
        return self.taken - len(self.records)

    @property
    def _top_most(self) -> int:
        """The bottom line of a view whose top is the oldest record."""
        return min(self.first + max(1, self.size.height - 1), self.taken) - 1

    # Looking back

    @property
    def following(self) -> bool:
        """True if the newest line is in view and new ones scroll."""
        return self._bottom is None

    def look(self, lines: int) -> None:
        """Scroll up (negative) or down by lines; scrolling past the newest follows new lines again."""
        bottom = (self.taken - 1 if self._bottom is None else self._bottom) + lines
        self._bottom = None if bottom >= self.taken - 1 else max(bottom, self._top_most)
        self._changed()

    def look_page(self, direction: int) -> None:
        """Scroll up or down by one view, less one line."""
        self._rows()
        shown = max(1, (self.taken - 1 if self._bottom is None else self._bottom) - self._top)
        self.look(direction * shown)

    def look_end(self, newest: bool) -> None:
        """Go to the newest or to the oldest line."""
        self._bottom = None
        if newest:
            self._changed()
        else:
            self.look(-self.taken)

    def _changed(self) -> None:
        self._view = None
        self.refresh()

    # Painting

    def notify_style_update(self) -> None:
        """Repaint under another theme."""
        super().notify_style_update()
        self._view = None

    def on_resize(self, event: events.Resize) -> None:
        """Wrap again for the new width."""
        self._changed()

    def render_line(self, y: int) -> Strip:
        """Render one line of the view."""
        rows = self._rows()
        return self.strip(rows[y] if y < len(rows) else (), self.size.width)

    @property
    def plain(self) -> str:
        """The text in view, without styles."""
        return "\n".join("".join(text for text, _ in row).rstrip() for row in self._rows())

    def _rows(self) -> list[Row]:
        if self._view is None:
            self._view = self._make(self.size)
        return self._view

    def _make(self, size: Size) -> list[Row]:
        last = self.taken - 1 if self._bottom is None else self._bottom
        height = size.height if self._bottom is None else size.height - 1
        before, self._made = self._made if self._made_for == size.width else {}, {}
        self._made_for = size.width
        rows: list[Row] = []
        number = last
        for record in islice(reversed(self.records), self.taken - 1 - last, None):
            self._made[number] = before.get(number) or self.rows_of(record, size.width)
            rows.extend(reversed(self._made[number]))
            number -= 1
            if len(rows) >= height:
                break
        self._top = number + 1
        rows.reverse()
        rows = rows[max(0, len(rows) - height) :]
        if self._bottom is not None:
            rows.append(self._more(size.width, self.taken - 1 - self._bottom))
        return rows

    def _more(self, width: int, count: int) -> Row:
        text = f" ▼ {count:,} more below   Ctrl+End: follow "
        pad = max(0, width - len(text))
        return (("─" * pad, "rule"), (text[:width], "focus"))

    def rows_of(self, record: Record, width: int) -> list[Row]:
        """A record as rows of the view: time, address and mark, and the text wrapped beside them."""
        sign, role = MARKS[record.mark]
        text = visible(record.text)
        room = max(1, width - GUTTER - 1)
        time = self.clock(record.at) if record.mark in DATED else ""
        broken = laid_out if record.columns else chop_cells if record.mark in VERBATIM else at_words
        pieces = [text] if len(text) <= room // 2 else broken(text, room) or [""]
        head: Row = (
            (f" {time:8}  ", "dim"),
            (f"{fit(record.address, 3)} ", "accent" if record.mark in SENT else "dim"),
            (f"{sign} ", role),
        )
        rows: list[Row] = [(*head, (pieces[0], role))]
        rows.extend(((" " * GUTTER, "text"), (piece, role)) for piece in pieces[1:])
        return rows

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Scroll up three lines."""
        self.look(-3)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Scroll down three lines."""
        self.look(3)
