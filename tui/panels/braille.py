"""Curves in braille: two by four dots in each cell, on a fixed grid of columns. Pure functions of numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
_LEFT = sum(_DOTS[0])
Curve = Sequence[tuple[float, float]]
"""(time, value) pairs, times rising."""


def nice_step(span: float, ticks: int) -> float:
    """The step (1, 2 or 5 times a power of ten) that gives at most `ticks` steps over a span."""
    raw = span / max(ticks, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    for factor in (1.0, 2.0, 5.0, 10.0):
        if factor * power >= raw * (1 - 1e-9):
            return factor * power
    raise AssertionError


class Range(NamedTuple):
    """The span of an axis; both ends are multiples of `step`."""

    low: float
    high: float
    step: float


def nice_range(low: float, high: float, least: float = 1.0) -> Range:
    """A range around the values that ends on round numbers, so that it seldom changes; at least `least` wide."""
    if high - low < least:
        middle = (low + high) / 2
        low, high = min(low, middle - least / 2), max(high, middle + least / 2)
    step = nice_step(high - low, 4)
    return Range(math.floor(low / step + 1e-9) * step, math.ceil(high / step - 1e-9) * step, step)


def ticks(axis: Range, rows: int) -> dict[int, float]:
    """Row (0 is the top) and value of each tick: both ends, and as many even steps between as fit."""
    steps = max(1, round((axis.high - axis.low) / axis.step))
    room = max(1, min(4, (rows - 1) // 2))
    stride = next(each for each in range(1, steps + 1) if steps % each == 0 and steps // each <= room)
    found = [axis.low + axis.step * n for n in range(0, steps + 1, stride)]
    return {row_of(value, axis.low, axis.high, rows): value for value in found}


def row_of(value: float, low: float, high: float, rows: int) -> int:
    """The row of cells that shows a value."""
    return min(rows - 1, max(0, _dot(value, low, high, rows * 4) // 4))


def _dot(value: float, low: float, high: float, dots: int) -> int:
    share = (high - value) / (high - low)
    return min(dots - 1, max(0, round(share * (dots - 1))))


def draw(
    curve: Curve, start: float, end: float, low: float, high: float, size: tuple[int, int], gap: float
) -> list[str]:
    """Draw the curve as `rows` strings of `columns` braille cells; `size` is (columns, rows).

    Values less than `gap` seconds apart are joined; unknown stretches stay empty.
    """
    columns, rows = size
    wide, tall = columns * 2, rows * 4
    cells = [[0] * columns for _ in range(rows)]
    scale = wide / (end - start)
    last: tuple[float, int, int] | None = None
    drawn, y = math.nan, 0
    for at, value in curve:
        x = int((at - start) * scale)
        if x >= wide:
            break
        if value != drawn:  # a drive at rest reads the same a thousand times
            drawn, y = value, _dot(value, low, high, tall)
        if last is None or at - last[0] > gap:
            if x >= 0:
                cells[y // 4][x // 2] |= _DOTS[x % 2][y % 4]
        elif (x, y) != last[1:]:  # many readings fall on one dot
            _join(cells, last[1], last[2], x, y)
        last = (at, x, y)
    return ["".join(chr(0x2800 + dots) if dots else " " for dots in row) for row in cells]


def laid_over(solid: str, *dotted: str) -> str:
    """Lay rows of cells over each other; all but the first show every other column of dots only."""
    cells = [_dots_of(cell) for cell in solid]
    for row in dotted:
        cells = [dots | _dots_of(cell) & _LEFT for dots, cell in zip(cells, row, strict=True)]
    return "".join(chr(0x2800 + dots) if dots else " " for dots in cells) if dotted else solid


def _dots_of(cell: str) -> int:
    return 0 if cell == " " else ord(cell) - 0x2800


def _join(cells: list[list[int]], x0: int, y0: int, x1: int, y1: int) -> None:
    """Draw a line between two dots; each column of dots gets the line's full height in it."""
    across = max(1, x1 - x0)
    begin = max(x0, 0)
    y = y0 + round((y1 - y0) * (begin - x0) / across)
    for x in range(begin, x1 + 1):
        reached = y1 if x == x1 else y0 + round((y1 - y0) * (x - x0) / across)
        for each in range(min(y, reached), max(y, reached) + 1):
            cells[each // 4][x // 2] |= _DOTS[x % 2][each % 4]
        y = reached
