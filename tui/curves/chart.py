"""One chart: some quantities with one scale, over one window of time."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor
from typing import NamedTuple

from multidrop.tui.curves.columns import Columns
from multidrop.tui.curves.ink import Ink
from multidrop.tui.curves.raster import Curve, Frame, Raster, Run
from multidrop.tui.curves.scale import Scale, magnified, steady
from multidrop.tui.curves.trace import Quantity, Traces
from multidrop.tui.curves.window import Window

KEPT = 3
"""Pictures of different heights that are kept."""


class Extent(NamedTuple):
    """The least and the greatest value in a window."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """Their difference."""
        return self.high - self.low


class Chart:
    """Keeps the columns of its quantities, its scale, and what was drawn."""

    def __init__(self) -> None:
        self._columns: dict[Quantity, Columns] = {}
        self._scale: Scale | None = None
        self._wide = 1
        self._rasters: dict[tuple[int, ...], Raster] = {}

    def take(self, traces: Traces, quantities: Sequence[Quantity], window: Window) -> dict[Quantity, Extent]:
        """Take in new samples; return the extent of each quantity that has values in the window."""
        found: dict[Quantity, Extent] = {}
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
                found[quantity] = Extent(*extent)
        return found

    def scale(self, extents: Sequence[Extent], least: float, zero: bool, zoom: int, centre: float) -> Scale:
        """The scale of these extents, at least `least` wide; `zero`: with 0 in it."""
        low = min([each.low for each in extents] + [0.0] * zero)
        high = max([each.high for each in extents] + [0.0] * zero)
        if zero and low == 0:
            high = max(high, least)
        self._scale = steady(self._scale, low, high, least)
        return magnified(self._scale, zoom, min(max(centre, low), high))

    def draw(
        self, shown: Sequence[tuple[Quantity, int]], window: Window, rows: int, scale: Scale, ink: Ink
    ) -> list[list[Run]]:
        """Draw quantities, each with the number of its colour and dashes."""
        raster = self._rasters.get((rows, window.columns))
        if raster is None:
            if len(self._rasters) >= KEPT:
                self._rasters.clear()
            raster = self._rasters[rows, window.columns] = Raster()
        curves = [Curve(self._columns[quantity], number) for quantity, number in shown]
        return raster.draw(curves, Frame(window.first, window.columns, rows, scale, ink))

    def value_at(self, quantity: Quantity, at: float) -> float | None:
        """The last value in the column of cells at a time; None where nothing is known."""
        columns = self._columns.get(quantity)
        if columns is None:
            return None
        x = floor(at / columns.dot) // self._wide * self._wide
        cell = [columns.columns[each] for each in range(x, x + self._wide) if each in columns.columns]
        return cell[-1].last if cell else None
