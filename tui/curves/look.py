"""The view of plots that a person has set: span, pause, cursor, zoom of values, one plot or several."""

from __future__ import annotations

from math import floor

from multidrop.tui.curves.chart import Chart
from multidrop.tui.curves.ink import BRAILLE, Ink
from multidrop.tui.curves.window import Window

SPANS = (2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0, 600.0)
"""Seconds that a plot shows."""
USUAL = SPANS.index(20.0)
LARGEST = 64
"""The greatest zoom of values."""


class Look:
    """The view that a person has set. Every key is a transition."""

    def __init__(self) -> None:
        self._span = USUAL
        self.ink: Ink = BRAILLE
        self.paused_at: float | None = None
        """The time at the right edge while paused."""
        self.cursor: float | None = None
        """The time of the cursor; only while paused."""
        self.zoom = 1
        """How many times the values are magnified."""
        self.apart = False
        """Each drive has a plot of its own."""
        self.hidden: set[str] = set()
        """The words whose plots are hidden."""
        self.charts: dict[tuple[str, str, int], Chart] = {}
        """What was drawn, by word, drive and width."""

    @property
    def span(self) -> float:
        """Seconds shown."""
        return SPANS[self._span]

    def window(self, now: float, columns: int, wide: int) -> Window:
        """The window at a time."""
        end = now if self.paused_at is None else self.paused_at
        last = floor(end / (self.span / columns))
        return Window(self.span, last - columns + 1, columns, wide)

    def pause(self, now: float) -> None:
        """Stop the picture, or let it go on."""
        if self.paused_at is None:
            self.paused_at = now
        else:
            self.go_on()

    def go_on(self) -> None:
        """Show the newest samples again."""
        self.paused_at = self.cursor = None

    def shorter(self, by: int) -> None:
        """Show `by` steps less time."""
        self._span = min(max(self._span - by, 0), len(SPANS) - 1)
        if self.cursor is not None and self.paused_at is not None and self.cursor < self.paused_at - self.span:
            self.paused_at = self.cursor + self.span / 2

    def closer(self, by: int) -> None:
        """Magnify the values by a factor of two, `by` times."""
        self.zoom = min(max(1, self.zoom << by if by > 0 else self.zoom >> -by), LARGEST)

    def automatic(self) -> None:
        """Go back to the usual span and scale."""
        self._span, self.zoom = USUAL, 1

    def move_cursor(self, columns: int, now: float, width: int) -> None:
        """Move the cursor by columns of a picture of this width; that pauses, and shifts the picture at its edge."""
        cell = self.span / width
        if self.paused_at is None:
            self.paused_at = now
        before = self.paused_at if self.cursor is None else self.cursor
        self.cursor = min(before + columns * cell, now)
        self.paused_at = max(self.paused_at, self.cursor)
        if self.cursor < self.paused_at - self.span + cell:
            self.paused_at = self.cursor + self.span - cell
