"""One chart (some quantities with one scale, over one window of time), and the view of plots that a person has set."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor
from typing import NamedTuple

from multidrop.tui.curves.raster import BRAILLE, Curve, Ink, PlotFrame, Raster, Run, TickScale, magnified, steady
from multidrop.tui.curves.samples import Columns, TraceQuantity, Traces
from multidrop.tui.curves.trigger import Trigger, TriggerSetting, TriggerState


class ColumnWindow(NamedTuple):
    """The columns of cells that are shown. Both count from time 0."""

    span: float
    first: int
    columns: int
    wide: int
    """Dots in a cell."""
    step: float = 1.0
    """Seconds between two ticks, a whole number of cells."""

    @property
    def last(self) -> int:
        return self.first + self.columns - 1

    @property
    def cell(self) -> float:
        """Seconds in a column of cells."""
        return self.span / self.columns

    @property
    def dot(self) -> float:
        """Seconds in a column of dots."""
        return self.cell / self.wide


MOST_KEPT_RASTERS = 3
"""Pictures of different heights that are kept."""


class Extent(NamedTuple):
    """The least and the greatest value in a window."""

    low: float
    high: float

    @property
    def width(self) -> float:
        return self.high - self.low


class Chart:
    """Keeps the columns of its quantities, its scale, and what was drawn."""

    def __init__(self) -> None:
        self._columns: dict[TraceQuantity, Columns] = {}
        self._scale: TickScale | None = None
        self._wide, self._rows = 1, 0
        self._rasters: dict[tuple[int, ...], Raster] = {}

    def take(
        self, traces: Traces, quantities: Sequence[TraceQuantity], window: ColumnWindow
    ) -> dict[TraceQuantity, Extent]:
        """Take in new samples; return the extent of each quantity that has values in the window."""
        extents: dict[TraceQuantity, Extent] = {}
        self._wide = window.wide
        oldest, newest = window.first * window.wide, window.last * window.wide + window.wide - 1
        for quantity in quantities:
            trace = traces.get(quantity)
            if trace is None:
                continue
            columns = self._columns.get(quantity)
            if columns is None or columns.trace is not trace or columns.dot != window.dot or columns.oldest > oldest:
                columns = self._columns[quantity] = Columns(trace, window.dot, oldest - window.columns)
            columns.update(oldest)
            if extent := columns.extent(oldest, newest):
                extents[quantity] = Extent(*extent)
        return extents

    def scale(
        self, extents: Sequence[Extent], least: float, zero: bool, zoom: int, centre: float, rows: int
    ) -> TickScale:
        """The scale of these extents in this number of rows, at least `least` wide; `zero`: with 0 in it."""
        low = min([extent.low for extent in extents] + [0.0] * zero)
        high = max([extent.high for extent in extents] + [0.0] * zero)
        if zero and low == 0:
            high = max(high, least)
        self._scale = steady(self._scale if rows == self._rows else None, low, high, rows, least)
        self._rows = rows
        return magnified(self._scale, rows, zoom, min(max(centre, low), high))

    def draw(
        self,
        shown: Sequence[tuple[TraceQuantity, int, TickScale]],
        window: ColumnWindow,
        rows: int,
        scale: TickScale,
        ink: Ink,
    ) -> list[list[Run]]:
        """Draw quantities, each with the number of its colour and dashes, and `scale` in its own units."""
        raster = self._rasters.get((rows, window.columns))
        if raster is None:
            if len(self._rasters) >= MOST_KEPT_RASTERS:
                self._rasters.clear()
            raster = self._rasters[rows, window.columns] = Raster()
        curves = [Curve(self._columns[quantity], number, own) for quantity, number, own in shown]
        return raster.draw(curves, PlotFrame(window.first, window.columns, rows, scale, ink))

    def value_at(self, quantity: TraceQuantity, at: float) -> float | None:
        """The last value in the column of cells at a time; None where nothing is known."""
        columns = self._columns.get(quantity)
        if columns is None:
            return None
        x = floor(at / columns.dot) // self._wide * self._wide
        cell = [columns.columns[column] for column in range(x, x + self._wide) if column in columns.columns]
        return cell[-1].last if cell else None


STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0)
"""Seconds between two ticks of time."""
TICK_COLUMNS = 11
"""Least cells between two ticks of time."""
SPANS = (2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0, 600.0)
"""Seconds that a plot shows, or up to a tenth more, so that a tick falls on a cell."""
USUAL_SPAN = SPANS.index(20.0)
LARGEST_ZOOM = 64
"""The greatest zoom of values."""


class ChartView:
    """The view that a person has set. Every key is a transition."""

    def __init__(self) -> None:
        self._span = USUAL_SPAN
        self.ink: Ink = BRAILLE
        self.paused_at: float | None = None
        """The time at the right edge while paused."""
        self.cursor: float | None = None
        """The time of the cursor; only while paused."""
        self.other: float | None = None
        """The time of the second cursor, which stands."""
        self.trigger, self._taken = Trigger(), 0
        self.zoom = 1
        """The magnification of the values."""
        self.apart = False
        """Each drive has a plot of its own."""
        self.hidden: set[str] = set()
        """The words whose plots are hidden."""
        self.charts: dict[tuple[str, str, int], Chart] = {}
        """The charts that were drawn, by word, drive and width."""
        self.dot = 0.0
        """Seconds of a column of dots in the last picture."""
        self.numbers: dict[tuple[str, str, str], int] = {}
        """The number of the colour of each axis that is plotted."""

    @property
    def span(self) -> float:
        return SPANS[self._span]

    def window(self, now: float, columns: int, wide: int) -> ColumnWindow:
        end = now if self.paused_at is None else self.paused_at
        step, cell = self.cells(columns)
        self.dot = cell / wide
        return ColumnWindow(cell * columns, floor(end / cell) - columns + 1, columns, wide, step)

    def cells(self, columns: int) -> tuple[float, float]:
        """The seconds between two ticks of time, and those of a cell."""
        step = next((each for each in STEPS if each * columns >= self.span * TICK_COLUMNS), self.span)
        return step, step / floor(columns * step / self.span + 1e-9)

    def pause(self, now: float) -> None:
        """Stop the picture, or let it go on."""
        if self.paused_at is None:
            self.paused_at = now
        else:
            self.go_on()

    def go_on(self) -> None:
        self.paused_at = self.cursor = self.other = None

    def arm(self, setting: TriggerSetting, single: bool, traces: Traces) -> None:
        """Let the trigger wait for the next edge; the picture runs until then."""
        trace = traces.get(setting.quantity)
        self._taken = trace.count if trace is not None else 0
        self.trigger.arm(setting, single)
        self.go_on()

    def follow(self, traces: Traces, now: float) -> None:
        """Show the picture of the trigger, with the new samples; it does not change while it has a cursor."""
        trigger, held = self.trigger, self.paused_at is not None and not self.trigger.stands
        if trigger.state is TriggerState.OFF or trigger.setting is None or held or self.cursor is not None:
            return
        trace = traces.get(trigger.setting.quantity)
        trigger.take(trace.since(self._taken) if trace is not None else (), self.span, now)
        self._taken = trace.count if trace is not None else 0
        self.paused_at = trigger.end(self.span) if trigger.stands else None

    @property
    def zero(self) -> float | None:
        """The time of the trigger, while its picture is shown."""
        return self.trigger.at if self.trigger.stands and self.paused_at is not None else None

    def change_cursor(self, now: float, width: int) -> None:
        """Set the first cursor, then the second one where it is; then change between the two."""
        if self.cursor is None:
            self.move_cursor(0, now, width)
        else:
            self.other, self.cursor = self.cursor, self.cursor if self.other is None else self.other

    def shorter(self, by: int) -> None:
        """Show `by` steps less time."""
        self._span = min(max(self._span - by, 0), len(SPANS) - 1)
        if self.cursor is not None and self.paused_at is not None and self.cursor < self.paused_at - self.span:
            self.paused_at = self.cursor + self.span / 2

    def closer(self, by: int) -> None:
        """Magnify the values by a factor of two, `by` times."""
        self.zoom = min(max(1, self.zoom << by if by > 0 else self.zoom >> -by), LARGEST_ZOOM)

    def automatic(self) -> None:
        self._span, self.zoom = USUAL_SPAN, 1

    def move_cursor(self, columns: int, now: float, width: int) -> None:
        """Move the cursor by columns of a picture of this width; that pauses, and shifts the picture at its edge."""
        cell = self.cells(width)[1]
        if self.paused_at is None:
            self.paused_at = now
        before = self.paused_at if self.cursor is None else self.cursor
        self.cursor = min(before + columns * cell, now)
        self.paused_at = max(self.paused_at, self.cursor)
        if self.cursor < self.paused_at - self.span + cell:
            self.paused_at = self.cursor + self.span - cell
