"""A record as rows: the time in the form that is set, address and sign, and the text wrapped beside them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from rich.cells import cell_len, chop_cells

from multidrop.shell.layout import laid_out
from multidrop.tui.screen_model import Record
from multidrop.tui.text import at_words, fit, visible
from multidrop.tui.widgets.lines import Row, Span

MARKS = {
    ">": ("›", "strong"),
    "»": ("»", "strong"),
    "": (" ", "text"),
    "<": ("«", "text"),
    "↑": ("↑", "dim"),
    "↓": ("↓", "dim"),
    "x": ("✗", "error"),
    ".": ("·", "dim"),
    "!": ("!", "strong"),
}
"""Typed by a person, sent by automation, reply, unsolicited, bytes out, bytes in, failure, narration, warning."""
SENT = frozenset(">»")
VERBATIM = frozenset({">", "»", "<", "", "↑", "↓"})
"""Marks of records in a drive's own language, where every space counts."""
DATED = frozenset(">»<↑↓.!")
"""Marks of records that show the time of day; a reply follows the line that it answers."""
ADDRESS = 3
CLOCK = 8
"""Width of a time in cells."""


class Clocks(NamedTuple):
    """The sources of a shown time: its form (a word of `TIMES`), the clock for the time of day, the time of `start`."""

    form: str
    clock: Callable[[float], str]
    start: float = 0.0

    @property
    def gutter(self) -> int:
        """Width before the text in cells: time, address, sign."""
        return ADDRESS + 4 + (0 if self.form == "off" else CLOCK + 2)

    def text(self, record: Record, before: Record | None) -> str:
        """The time of a record; `before` is the one shown above it."""
        if self.form == "last":
            return seconds(record.at - before.at, "+") if before is not None else ""
        if self.form == "off" or record.mark not in DATED:
            return ""
        return self.clock(record.at) if self.form == "clock" else seconds(record.at - self.start)


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
    broken = laid_out if record.columns else chop_cells if record.mark in VERBATIM else at_words
    pieces = [text] if len(text) <= room // 2 else broken(text, room) or [""]
    time = "" if clocks.form == "off" else f"{fit(clocks.text(record, before), CLOCK)}  "
    head: Row = (
        (f" {time}", "dim"),
        (f"{fit(record.address, ADDRESS)} ", "accent" if record.mark in SENT else "dim"),
        (f"{sign} ", role),
    )
    rows: list[Row] = [(*head, (pieces[0], role), *_aside(record.help, room - cell_len(pieces[0])))]
    rows.extend(((" " * clocks.gutter, "text"), (piece, role)) for piece in pieces[1:])
    return rows


def _aside(text: str, room: int) -> tuple[Span, ...]:
    """A word at the right end of a row, if there is room for it."""
    gap = room - cell_len(text)
    return ((" " * gap, "text"), (text, "dim")) if text and gap >= 2 else ()


def marked(row: Row, sign: str, role: str) -> Row:
    """A row with a mark in its first cell."""
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
    while (found := folded.find(text, at)) >= 0:
        spans += [(part[at:found], plain), (part[found : found + len(text)], role)]
        at = found + len(text)
    return [span for span in [*spans, (part[at:], plain)] if span[0]]


def chosen(row: Row) -> Row:
    """A row as part of a selection."""
    return marked(tuple((text, "focus") for text, _ in row), "▌", "focus")
