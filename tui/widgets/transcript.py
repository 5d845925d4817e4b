"""The transcript of one bus: lines sent, replies, failures. It paints what is in view (`sight`), and takes lines in.

Lines arrive at any rate: taking one only appends to a deque. Rows are styled and wrapped when they are painted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import NamedTuple

from rich.cells import cell_len, chop_cells
from textual import events

from multidrop.base.text import counted
from multidrop.shell.raw import ByteForm
from multidrop.shell.roles import Filter
from multidrop.shell.streams.event_printer import laid_out
from multidrop.tui.screen_model import Record
from multidrop.tui.text import at_words, fit, visible
from multidrop.tui.widgets.lines import Lines, Row, Span, spread, width_of
from multidrop.tui.widgets.viewport import Picked, Records, RecordSearch, VisibleRecords

MARKS = {
    ">": ("›", "strong"),
    "»": ("»", "strong"),
    "": (" ", "text"),
    "<": ("«", "text"),
    "↑": ("↑", "strong"),
    "↓": ("↓", "text"),
    "x": ("✗", "error"),
    ".": ("·", "dim"),
    "!": ("!", "strong"),
    "■": ("■", "text"),
}
"""Typed by a person, sent by automation, reply, unsolicited, bytes out, bytes in, failure, narration, warning, stop."""
SENT = frozenset(">»")
VERBATIM = frozenset({">", "»", "<", "", "↑", "↓"})
"""Marks of records in a drive's own language, where every space counts."""
DATED = frozenset(">»<↑↓.!■")
"""Marks of records that show the time of day; a reply follows the line that it answers."""
ADDRESS, WIDEST_LINE_NAME = 3, 12
"""Least and greatest width of the name of a drive in cells."""
CLOCK = 8
"""Width of a time in cells."""
BYTES = "↑↓"
"""Marks of bytes, which have no address: their time takes its place, and has milliseconds."""
HEX = re.compile(r"(?:[0-9A-F]{2} )*[0-9A-F]{2}")
HEX_AT = ByteForm.BOTH.value[2] + 1
"""The column of the hex beside its text."""


class Clocks(NamedTuple):
    """The sources of a shown time: its form (a word of `TIMES`), the clock for the time of day, the time of `start`."""

    form: str
    clock: Callable[[float], str]
    start: float = 0.0
    names: int = ADDRESS
    """The width of the longest name of a drive so far."""

    @property
    def gutter(self) -> int:
        """Width before the text in cells: time, name, sign."""
        return self.names + 4 + (0 if self.form == "off" else CLOCK + 2)

    def text(self, record: Record, before: Record | None) -> str:
        """The time of a record; `before` is the one shown above it."""
        if self.form == "last":
            return seconds(record.at - before.at, "+") if before is not None else ""
        if self.form == "off" or record.mark not in DATED:
            return ""
        if self.form == "clock":
            return self.clock(record.at)[: None if record.mark in BYTES else CLOCK]
        return seconds(record.at - self.start)


def seconds(value: float, sign: str = "") -> str:
    """Format a time in eight cells: `+0.012`, `87.412`, `1:02:13`."""
    if value < 1000:
        return f"{sign}{max(value, 0.0):.3f}".rjust(CLOCK)
    minutes, whole = divmod(int(value), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{sign}{hours}:{minutes:02}:{whole:02}"[:CLOCK].rjust(CLOCK)


def rows_of(record: Record, before: Record | None, clocks: Clocks, width: int) -> list[Row]:
    """A record as rows of the view; the first cell of each is free for a mark."""
    sign, role = MARKS[record.mark]
    text = visible(record.text)
    room = max(1, width - clocks.gutter - 1)
    if record.details:
        text = fit(text, min(len(text), room))
    broken = laid_out if record.columns else chop_cells if record.mark in VERBATIM else at_words
    pieces = [text] if len(text) <= room // 2 else broken(text, room) or [""]
    time = "" if clocks.form == "off" else f"{fit(clocks.text(record, before), CLOCK)}  "
    where = fit(record.name or record.address, clocks.names)
    if record.mark in BYTES:
        time, where = fit(clocks.text(record, before), len(time + where)), ""
    head: Row = (
        (f" {time}", "dim"),
        (f"{where} ", "accent" if record.mark in SENT else "dim"),
        (f"{sign} ", role),
    )
    if record.mark in BYTES and len(text) <= room and HEX.fullmatch(text, HEX_AT):
        return [(*head, (text[:HEX_AT], role), (text[HEX_AT:], "dim"))]
    rows: list[Row] = [(*head, (pieces[0], role), *_aside(record.help, room - cell_len(pieces[0])))]
    rows.extend(((" " * clocks.gutter, "text"), (piece, role)) for piece in pieces[1:])
    return rows


def _aside(text: str, room: int) -> tuple[Span, ...]:
    """A word at the right end of a row, if there is room for it."""
    gap = room - cell_len(text)
    return ((" " * gap, "text"), (text, "dim")) if text and gap >= 2 else ()


def marked(row: Row, sign: str, role: str) -> Row:
    (text, plain), *rest = row
    return ((sign, role), (text[1:], plain), *rest)


def found_in(row: Row, text: str, gutter: int, role: str) -> Row:
    """A row with each occurrence of a text in another role; the gutter is left as it is."""
    spans: list[Span] = []
    at = 0
    for part, plain in row:
        spans += [(part, plain)] if at < gutter else _split(part, plain, text.casefold(), role)
        at += cell_len(part)
    return tuple(spans)


def _split(part: str, plain: str, text: str, role: str) -> list[Span]:
    folded, at, spans = part.casefold(), 0, list[Span]()
    if len(folded) != len(part):
        return [(part, plain)]  # a letter that folds to two
    while (cut := folded.find(text, at)) >= 0:
        spans += [(part[at:cut], plain), (part[cut : cut + len(text)], role)]
        at = cut + len(text)
    return [span for span in [*spans, (part[at:], plain)] if span[0]]


def chosen(row: Row) -> Row:
    return marked(tuple((text, "focus") for text, _ in row), "▌", "focus")


class Transcript(Lines, can_focus=False):
    """Shows records; see the module. `times`: the form of their times, a word of `TIMES`."""

    def __init__(self, clock: Callable[[float], str], times: str = "clock", *, foot: bool = True) -> None:
        super().__init__()
        self._has_foot = foot
        self.records = Records()
        self.sight = VisibleRecords(self.records)
        self.clocks = Clocks(times, clock)
        self.search: RecordSearch | None = None
        self.picked: Picked | None = None
        self._view: list[Row] | None = None
        self._made: dict[int, list[Row]] = {}
        """Rows of the records in view, by number, for what is in `_made_for`: scrolling leaves most of them."""
        self._made_for: object = None
        self._unshown = False

    # Taking in

    def extend(self, records: Iterable[Record]) -> None:
        self.take(records)
        self.show_new()

    def take(self, records: Iterable[Record]) -> None:
        """Take in records, oldest first; `show_new` shows them."""
        new = list(records)
        for number in self.records.take(new):
            self._made.pop(number, None)
        names = max((len(record.name) for record in new), default=0)
        self.clocks = self.clocks._replace(
            start=self.records.began, names=max(self.clocks.names, min(names, WIDEST_LINE_NAME))
        )
        self._unshown = self._unshown or bool(new)

    def show_new(self) -> None:
        if self._unshown:
            self._unshown = False
            self.changed()

    def clear(self) -> None:
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
        self.sight.look_end(newest)
        self.changed()

    def pause(self) -> None:
        self.sight.pause()
        self.changed()

    def choose(self, wanted: Filter, *, typed: bool = False) -> None:
        """Show only some records. `typed`: also what a person types from now on, with its replies."""
        self.sight.choose(wanted, typed=typed)
        self.changed()

    def set_times(self, form: str) -> None:
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
        self._view = None
        self.refresh()

    # Painting

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._view = None

    def on_resize(self, event: events.Resize) -> None:
        self.changed()

    def shown(self) -> list[Row]:
        return self._rows()

    @property
    def plain(self) -> str:
        return "\n".join("".join(text for text, _ in row).rstrip() for row in self._rows())

    def _rows(self) -> list[Row]:
        if self._view is None:
            sight = self.sight
            sight.height = self.size.height
            foot = self._foot(self.size.width) if self._has_foot else []
            height = self.size.height - len(foot)
            numbers, place = sight.numbers, sight.end
            valid = (self.size.width, self.clocks.form, self.clocks.names, sight.filter)
            before, self._made = self._made if self._made_for == valid else {}, {}
            self._made_for = valid
            rows: list[Row] = []
            while place > 0 and len(rows) < height:
                place -= 1
                number = numbers[place]
                above = self.records[numbers[place - 1]] if place else None
                made = before.get(number) or self.rows_of(self.records[number], above, self.size.width)
                self._made[number] = made
                rows.extend(reversed(self._decorated(number, made)))
            sight.top = numbers[min(place, len(numbers) - 1)] if len(numbers) else 0  # a view without rows shows none
            rows.reverse()
            rows = rows[max(0, len(rows) - height) :]
            blank: list[Row] = [()] * (height - len(rows)) if foot else []
            self._view = rows + blank + foot
        return self._view

    def rows_of(self, record: Record, before: Record | None, width: int) -> list[Row]:
        """A record as rows of the view; `before` is the one above it."""
        return rows_of(record, before, self.clocks, width)

    def _decorated(self, number: int, rows: list[Row]) -> list[Row]:
        """The rows of a record with the marks of a search or a selection."""
        if self.picked is not None and number in self.picked:
            blank = " " * self.clocks.gutter
            details: list[Row] = [((f"{blank}{visible(text)}", "text"),) for text in self.records[number].details]
            return [chosen(row) for row in (*rows, *details)]
        text = self.search.text if self.search is not None else ""
        if not text or text.casefold() not in self.records[number].text.casefold():
            return rows
        here = self.search is not None and self.search.at == number
        role = "focus" if here else "found"
        decorated = [found_in(row, text, self.clocks.gutter, role) for row in rows]
        return [marked(decorated[0], "►" if here else "•", "accent"), *decorated[1:]]

    def _foot(self, width: int) -> list[Row]:
        """The last row, while the view shows less than everything up to the newest line."""
        sight = self.sight
        left: list[Span] = []
        if sight.filter:
            total = f"{len(sight.numbers)} of {counted(len(self.records), 'line')}"
            left = [(f" {sight.filter.words} ", "focus"), (f" {total}   /filter off shows all", "dim")]
        elif sight.at_oldest and self.records.dropped:
            left = [(f" {counted(self.records.dropped, 'older line was', 'older lines were')} dropped", "dim")]
        right: list[Span] = []
        if sight.paused:
            right = [(f" PAUSED   {sight.below} new below   Ctrl+B: go on ", "focus")]
        elif not sight.following and sight.below:
            right = [(f" ▼ {sight.below} more below   Ctrl+End: follow ", "focus")]
        if not left and not right:
            return []
        if width_of(left) + width_of(right) + 1 > width:
            left = left[:1] if right else left
        fits = width_of(left) + width_of(right) <= width
        return [spread(left, right, width) if fits else spread(right, (), width)]

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        self.look(-3)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        self.look(3)
