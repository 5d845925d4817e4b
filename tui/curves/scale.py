"""Scales of values: round ends, round ticks, and no jump without need."""

from __future__ import annotations

import math
from typing import NamedTuple


def nice_step(span: float, ticks: int) -> float:
    """The step (1, 2 or 5 times a power of ten) that gives at most `ticks` steps over a span."""
    raw = span / max(ticks, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    for factor in (1.0, 2.0, 5.0, 10.0):
        if factor * power >= raw * (1 - 1e-9):
            return factor * power
    raise AssertionError


class Scale(NamedTuple):
    """The span of an axis; both ends are multiples of `step`."""

    low: float
    high: float
    step: float

    def dot(self, value: float, dots: int) -> int:
        """The dot of a value, counted from the top; outside of 0 to `dots` - 1 for a value beyond the ends."""
        return round((self.high - value) / (self.high - self.low) * (dots - 1))


def nice_scale(low: float, high: float, least: float = 1.0) -> Scale:
    """A scale around the values that ends on round numbers, so that it seldom changes; at least `least` wide."""
    if high - low < least:
        middle = (low + high) / 2
        low, high = min(low, middle - least / 2), max(high, middle + least / 2)
    step = nice_step(high - low, 6)
    return Scale(math.floor(low / step + 1e-9) * step, math.ceil(high / step - 1e-9) * step, step)


def steady(before: Scale | None, low: float, high: float, least: float) -> Scale:
    """The scale before while it fits: it grows at once, and shrinks when the values fill less than a third of it."""
    fitting = nice_scale(low, high, least)
    if before is None or low < before.low or high > before.high:
        return fitting
    return fitting if fitting.high - fitting.low < (before.high - before.low) / 2.5 else before


def magnified(scale: Scale, factor: int, centre: float) -> Scale:
    """A part of a scale around a value, `factor` times as large; its ends are round."""
    if factor <= 1:
        return scale
    half = (scale.high - scale.low) / factor / 2
    return nice_scale(centre - half, centre + half, 2 * half)


def ticks(scale: Scale, rows: int) -> dict[int, float]:
    """Row (0 is the top) and value of each tick: both ends, and as many even steps between as fit."""
    steps = max(1, round((scale.high - scale.low) / scale.step))
    room = max(1, min(4, (rows - 1) // 2))
    stride = next(each for each in range(1, steps + 1) if steps % each == 0 and steps // each <= room)
    found = [scale.low + scale.step * n for n in range(0, steps + 1, stride)]
    return {row_of(value, scale, rows): value for value in found}


def row_of(value: float, scale: Scale, rows: int) -> int:
    """The row of cells that shows a value."""
    return min(rows - 1, max(0, scale.dot(value, rows * 4) // 4))
