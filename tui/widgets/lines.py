"""Lines of styled text as a widget that repaints only changed rows.

A plain function makes a panel's content as rows of spans, `(text, role)`. Roles are the few styles of the whole screen,
defined in the style sheet. An unchanged row costs nothing on the wire.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import TypeVar

from rich.cells import cell_len
from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.geometry import Region, Size
from textual.strip import Strip
from textual.widget import Widget

from multidrop.base.text import visible

T = TypeVar("T")
Span = tuple[str, str]
"""A text and its role."""
Row = tuple[Span, ...]

MOST_STRIPS = 500
"""Strips that are kept."""
SERIES = ("series1", "series2", "series3", "series4", "series5", "series6")
"""The roles of curves."""
PLAIN_ROLES = ("text", "strong", "dim", "accent", "focus", "found", "motion", "error", "stop", "latched", "key", "rule")
ROLES = (*PLAIN_ROLES, *SERIES)


class ActionText(str):
    """A text with an action, which a click anywhere on its row runs."""

    action: str

    def __new__(cls, text: str, action: str) -> ActionText:
        link = super().__new__(cls, text)
        link.action = action
        return link


def width_of(row: Sequence[Span]) -> int:
    return sum(cell_len(text) for text, _ in row)


def spread(left: Sequence[Span], right: Sequence[Span], width: int) -> Row:
    """Put `left` and `right` at the two ends of a line; drop the right one if there is no room."""
    gap = width - width_of(left) - width_of(right)
    if gap < 1:
        return tuple(left)
    return (*left, (" " * gap, "text"), *right)


def beside(left: Sequence[Row], right: Sequence[Row], width: int) -> list[Row]:
    """Rows beside others; `width`: that of the left ones."""
    pairs = zip_longest(left, right, fillvalue=())
    return [(*one, (" " * (width - width_of(one)), "text"), *other) for one, other in pairs]


def in_view(items: Sequence[T], at: int, height: int) -> list[tuple[int, T]]:
    """The items around the one at a place that find room in `height` rows, with their places."""
    first = max(0, min(at - height // 2, len(items) - height))
    return list(enumerate(items[first : first + max(0, height)], first))


def grouped_rows(grouped: Sequence[tuple[str, Row]], at: int, width: int, height: int) -> list[Row]:
    """The rows around the one at a place, each given with its group, and a heading where a group begins."""
    made: list[Row] = []
    place, group = 0, ""
    for number, (own, row) in enumerate(grouped):
        if own != group:
            group = own
            made.append((("─ ", "rule"), (f"{group} ", "dim"), ("─" * max(0, width - len(group) - 3), "rule")))
        if number == at:
            place = len(made)
        made.append(row)
    return [shown for _, shown in in_view(made, place, height)]


class Roles(Widget):
    """Has the styles of all roles, once for the app: Textual works out those of a widget when it is mounted.

    It is the first part of the main screen, and is not shown.
    """

    COMPONENT_CLASSES = {f"roles--{role}" for role in ROLES}


class Lines(Widget):
    """Rows of spans. `put` replaces them and repaints those that differ."""

    def __init__(self, *, id: str | None = None, classes: str | None = None) -> None:
        super().__init__(id=id, classes=classes)
        self.rows: list[Row] = []
        self._styles_of: dict[str, Style] = {}
        self._strips: dict[Row, Strip] = {}
        """Strips of recent rows, for the width in `_strips_for`."""
        self._strips_for = 0
        self._done: tuple[Sequence[Row], tuple[Region, Size], list[Strip]] | None = None
        """The last rows, their region, and their strips."""

    def put(self, rows: Sequence[Row]) -> None:
        before, new = self.rows, list(rows)
        if before == new:
            return
        self.rows = new
        for y in range(max(len(before), len(self.rows))):
            if before[y : y + 1] != self.rows[y : y + 1]:
                self.refresh(Region(0, y, self.size.width, 1))

    def put_all(self, rows: Sequence[Row]) -> None:
        """Show rows, in as many lines as they are."""
        self.styles.height = len(rows)
        self.put(rows)

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._styles_of.clear()
        self._strips.clear()
        self._done = None

    def style_of(self, role: str) -> Style:
        """The style of a role under the current theme."""
        style = self._styles_of.get(role)
        if style is None:
            holder = next((roles for screen in self.app.screen_stack for roles in screen.query(Roles)), None)
            if holder is None:
                return self.rich_style
            try:
                partial = holder.get_component_rich_style(f"roles--{role}", partial=True)
            except KeyError:  # about to be styled, which is notified, or being removed
                return self.rich_style
            style = self._styles_of[role] = self.rich_style + partial
        return style

    def strip(self, row: Row, width: int) -> Strip:
        """A row as a Textual strip of exactly `width` cells; made once while it scrolls."""
        if self._strips_for != width or len(self._strips) > MOST_STRIPS:
            self._strips.clear()
            self._strips_for = width
        strip = self._strips.get(row)
        if strip is None:
            segments = [Segment(visible(text), self.style_of(role)) for text, role in row]
            room = width - sum(cell_len(segment.text) for segment in segments)
            if room > 0:
                segments.append(Segment(" " * room, self.style_of("text")))
            strip = Strip(segments).crop(0, width) if room < 0 else Strip(segments, width)
            self._strips[row] = strip
        return strip

    def shown(self) -> Sequence[Row]:
        """The rows, from the top of the widget. Other rows are another object."""
        return self.rows

    def render_lines(self, crop: Region) -> list[Strip]:
        """Render a region. A known row, and a region that is as it was, are not made again."""
        if self.gutter.totals != (0, 0):
            return super().render_lines(crop)
        rows = self.shown()
        if self._done is None or self._done[0] is not rows or self._done[1] != (crop, self.size):
            width, nothing = self.size.width, ()
            count = len(rows)
            strips = [self.strip(rows[y] if y < count else nothing, width) for y in range(crop.y, crop.bottom)]
            if (crop.x, crop.width) != (0, width):
                strips = [strip.crop(crop.x, crop.right) for strip in strips]
            if filters := self.get_line_filters():
                ground = self.background_colors[1]
                for each in filters:
                    strips = [strip.apply_filter(each, ground) for strip in strips]
            self._done = rows, (crop, self.size), strips
        return self._done[2]

    def render_line(self, y: int) -> Strip:
        rows = self.shown()
        return self.strip(rows[y] if y < len(rows) else (), self.size.width)

    async def on_click(self, event: events.Click) -> None:
        row = self.rows[event.y] if event.y < len(self.rows) else ()
        link = next((text for text, _ in row if isinstance(text, ActionText)), None)
        if link is not None:
            await self.run_action(link.action)

    @property
    def plain(self) -> str:
        return "\n".join("".join(text for text, _ in row) for row in self.rows)
