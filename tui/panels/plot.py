"""Velocity and position of one drive over the last twenty seconds, as rows of text.

The time axis moves in whole columns of dots. Between two moves only the newest column changes, so a slow link has
little to carry.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tui.panels.braille import Curve, Range, draw, laid_over, nice_range, row_of, ticks
from tui.panels.view import View
from tui.screen_model import SPAN, Point, Readout
from tui.text import short
from tui.widgets.lines import Row

AXIS = 10
"""Width of the value axis in cells: label, space, tick."""
LEAST_VELOCITY = 100.0
LEAST_POSITION = 10.0
HEAD = 1


def plot_title(view: View) -> Row:
    """The name of the upper plot, and the rate of its samples."""
    if view.chosen is None:
        return ((" velocity ", "strong"),)
    rate = view.chosen.readout.rate(view.now)
    shown = f"{rate:.0f} Hz " if rate else "no samples "
    return ((" velocity ", "strong"), (f"{view.chosen.unit}/s, last {SPAN:.0f} s   {shown}", "dim"))


def plot_rows(view: View, width: int, height: int) -> list[Row]:
    """Draw both plots of the selected drive, one above the other, in exactly `height` rows."""
    if view.chosen is None:
        return [((" no drive selected", "dim"),)]
    readout, unit, now = view.chosen.readout, view.chosen.unit, view.now
    upper = height // 2
    lower = height - HEAD - upper
    if lower < 2 or width < AXIS + 8:
        return [((" no room for a plot"[:width], "dim"),)] + [()] * (height - 1)
    axes = readout.axes
    points = [point for each in axes for point in each.points]
    legend = f"{axes[0].axis} solid, {axes[1].axis} dotted; " if len(axes) > 1 else ""
    velocity = [[(point.at, float(point.velocity)) for point in each.points] for each in axes]
    rows = _curve_rows(velocity, _velocity_range(points), now, width, upper, _gap(readout))
    rows.append(_title("position", (f"{legend}{unit}", unit), width))
    position = [[(point.at, float(point.position)) for point in each.points] for each in axes]
    return rows + _curve_rows(position, _position_range(points), now, width, lower, _gap(readout))


def _gap(readout: Readout) -> float:
    return max(3 * readout.period, 1.0)


def _velocity_range(points: Sequence[Point]) -> Range:
    values = [0.0, *(point.velocity for point in points)]
    low, high = min(values), max(values)
    return nice_range(low, high if low < 0 else max(high, LEAST_VELOCITY), LEAST_VELOCITY)


def _position_range(points: Sequence[Point]) -> Range:
    values = [point.position for point in points] or [0]
    return nice_range(min(values), max(values), LEAST_POSITION)


def _title(name: str, details: Sequence[str], width: int) -> Row:
    left = f"─ {name} "
    room = width - len(left)
    detail = next((f"{detail} " for detail in details if len(detail) + 2 <= room), "")
    return (("─", "rule"), (left[1:], "strong"), (detail, "dim"), ("─" * max(0, room - len(detail)), "rule"))


def _curve_rows(curves: Sequence[Curve], axis: Range, now: float, width: int, height: int, gap: float) -> list[Row]:
    columns = width - AXIS
    low, high, step = axis
    dot = SPAN / (2 * columns)
    end = (math.floor(now / dot) + 1) * dot
    solid, *dotted = [draw(curve, end - SPAN, end, low, high, (columns, height), gap) for curve in curves]
    drawn = [laid_over(*lines) for lines in zip(solid, *dotted, strict=True)]
    marks = ticks(axis, height)
    zero = row_of(0.0, low, high, height) if low <= 0 <= high else -1
    rows: list[Row] = []
    for y, line in enumerate(drawn):
        label = short(marks[y], step) if y in marks else ""
        tick = "┼" if y == zero else "┤" if y in marks else "│"
        rows.append(((f"{label:>{AXIS - 2}} ", "dim"), (tick, "rule"), (line, "accent")))
    return rows
