"""The picture of some curves with one scale, kept from frame to frame: only columns with new samples are drawn.

Theory of operation. The time axis moves in whole cells, counted from time 0, so a drawn column of cells stays true
while the picture scrolls. A column is drawn again when a sample falls into it, or when the scale changes. Scales have
round ends and ticks, and do not jump without need. Curves are braille, half blocks, or ASCII, for terminals that lack
the others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from math import isnan
from typing import NamedTuple

from multidrop.tui.curves.samples import Column, Columns

MARKS = "*+ox#%@&=$svzw"
"""The ASCII mark of each series."""
PATTERNS = ((1, 1), (2, 1), (4, 2), (4, 1), (6, 4), (8, 6))
"""The period of the dashes of each series in columns of dots, and the length of a dash.

Each round of the colours begins one further.
"""

TWINS = len(PATTERNS) ** 2
"""The number of a series and this is that of its twin, whose line is of single dots."""
TWIN_MARKS = ".,:;'~"
"""The ASCII mark of each twin."""
SPARSE = 5
"""Dots of a line of which a twin shows one or two, in whatever direction the line goes."""


@dataclass(frozen=True)
class Ink:
    """Cells of `wide` by `tall` dots. The bits of a dot pattern: the left column from its top, then the right one."""

    name: str
    wide: int
    tall: int
    glyphs: tuple[str, ...]
    """The sign of each dot pattern; none: the mark of the series."""
    shown: tuple[int, ...] = (0,)
    """The dots of a twin that are shown, of `SPARSE`."""

    def glyph(self, dots: int, series: int) -> str:
        return self.glyphs[dots] if self.glyphs else _mark(series)

    def dots(self, series: int, x: int, top: int, bottom: int) -> Sequence[int]:
        """The dots that a series shows in column `x` of dots, of those from `top` to `bottom`.

        Flat parts are dashed, unless the series has marks of its own.
        """
        if series >= TWINS and self.glyphs:
            return [y for y in range(top, bottom + 1) if (x + 2 * y) % SPARSE in self.shown]
        period, length = PATTERNS[(series + series // len(PATTERNS)) % len(PATTERNS)]
        shown = not self.glyphs or x % period < length or bottom - top >= self.tall
        return range(top, bottom + 1) if shown else range(0)

    def sample(self, series: int) -> str:
        """A piece of the line of a series, for a legend."""
        if not self.glyphs:
            return _mark(series) * 2
        middle = self.tall // 2
        if series >= TWINS:
            ends = (0, 3 * self.wide - 1)
            shown = [1 << middle if x in ends else 0 for x in range(3 * self.wide)]
        else:
            shown = [1 << middle if self.dots(series, x, middle, middle) else 0 for x in range(2 * self.wide)]
        cells = (shown[n : n + self.wide] for n in range(0, len(shown), self.wide))
        return "".join(self.glyphs[sum(dots << (self.tall * n) for n, dots in enumerate(cell))] for cell in cells)


def _mark(series: int) -> str:
    marks = TWIN_MARKS if series >= TWINS else MARKS
    return marks[series % len(marks)]


def _braille(dots: int) -> str:
    order = (0x01, 0x02, 0x04, 0x40, 0x08, 0x10, 0x20, 0x80)
    code = sum(bit for n, bit in enumerate(order) if dots >> n & 1)
    return chr(0x2800 + code) if code else " "


BRAILLE = Ink("full", 2, 4, tuple(_braille(dots) for dots in range(256)))
BLOCK = Ink("boxes", 1, 2, (" ", "▀", "▄", "█"), (0, 2))
ASCII = Ink("ascii", 1, 1, ())
INKS = {ink.name: ink for ink in (BRAILLE, BLOCK, ASCII)}
"""By the value of `tui.widgets.theme.Signs`."""


MOST_TICKS = 8
"""Ticks that an axis has at most, about."""
TENS = (1.0, 10.0, 100.0, 1000.0)


class TickScale(NamedTuple):
    """The span of an axis. `step` is that of its ticks, 1, 2 or 5 times a power of ten; 0 is one of them."""

    low: float
    high: float
    step: float

    def dot(self, value: float, dots: int) -> int:
        """The dot of a value, counted from the top; outside of 0 to `dots` - 1 for a value beyond the ends."""
        return round((self.high - value) / (self.high - self.low) * (dots - 1))


def nice_scale(low: float, high: float, rows: int, least: float = 1.0) -> TickScale:
    """The narrowest scale around the values, at least `least` wide, whose ticks are the same whole rows apart."""
    if high - low < least:
        middle = (low + high) / 2
        low, high = min(low, middle - least / 2), max(high, middle + least / 2)
    rows = max(rows, 3)
    apart = range(max(1 + (rows > 6), -(-rows // MOST_TICKS)), max(1, (rows + 1) // 3) + 1)
    power = 10.0 ** math.floor(math.log10((high - low) / rows))
    units = sorted(
        (step * ten * power / each, step * ten * power) for step in (1, 2, 5) for ten in TENS for each in apart
    )
    for unit, step in units:
        bottom, top = math.floor(low / unit + 1e-9), math.ceil(high / unit - 1e-9)
        if (spare := rows - 1 - (top - bottom)) >= 0:
            bottom -= min(spare // 2, bottom) if bottom >= 0 else spare // 2 if top > 0 else spare
            return TickScale(bottom * unit, (bottom + rows - 1) * unit, step)
    raise AssertionError


HEADROOM, MOST_HEADROOM = 0.1, 1.5
"""Share of the width of the values that a new scale leaves free beyond each end that is not 0, unless that makes the
scale wider than the narrowest one by more than the factor: ends are round.
"""


def steady(before: TickScale | None, low: float, high: float, rows: int, least: float) -> TickScale:
    """The scale before while it fits: it grows at once, and shrinks when the values fill less than a third of it.

    A new one has some room beyond the values, so that values which go on rising do not change it with each sample.
    """
    room = HEADROOM * (high - low)
    narrowest = nice_scale(low, high, rows, least)
    fitting = nice_scale(low - room * (low != 0), high + room * (high != 0), rows, least)
    if fitting.high - fitting.low > MOST_HEADROOM * (narrowest.high - narrowest.low):
        fitting = narrowest
    if before is None or low < before.low or high > before.high:
        return fitting
    return fitting if fitting.high - fitting.low < (before.high - before.low) / 2.5 else before


def magnified(scale: TickScale, rows: int, factor: int, centre: float) -> TickScale:
    """A part of a scale around a value, `factor` times as large; its ticks are round."""
    if factor <= 1:
        return scale
    half = (scale.high - scale.low) / factor / 2
    return nice_scale(centre - half, centre + half, rows, 2 * half)


def ticks(scale: TickScale, rows: int) -> dict[int, float]:
    """Row (0 is the top) and value of each tick."""
    first, last = math.ceil(scale.low / scale.step - 1e-6), math.floor(scale.high / scale.step + 1e-6)
    return {row_of(n * scale.step, scale, rows): n * scale.step for n in range(first, last + 1)}


def row_of(value: float, scale: TickScale, rows: int) -> int:
    """The row of cells that shows a value."""
    return min(rows - 1, max(0, scale.dot(value, rows * 4) // 4))


EMPTY, CURSOR = -1, -2
"""Owners of a cell beside the numbers of the series."""
Run = tuple[str, int]
"""Cells of one owner, side by side."""


class PlotFrame(NamedTuple):
    """The frame of a picture: a window of columns of cells, its rows, scale and ink."""

    first: int
    columns: int
    rows: int
    scale: TickScale
    ink: Ink

    @property
    def last(self) -> int:
        return self.first + self.columns - 1


Cells = tuple[tuple[str, ...], tuple[int, ...]]
"""A column or a row of cells: signs, and the series to which each belongs."""


class Curve(NamedTuple):
    """The columns of a series, and the number that gives its colour and dashes."""

    columns: Columns
    number: int
    scale: TickScale | None = None
    """The scale of its values where it is not that of the frame: they are shown in other units."""


class Raster:
    """Draws curves, and keeps what it drew."""

    def __init__(self) -> None:
        self._kept: dict[int, Cells] = {}
        self._valid: object = None
        self._seen: list[tuple[int, int]] = []
        """For each curve, the samples taken and the newest column at the last drawing."""
        self._rows: list[Cells] = []
        self._runs: list[list[Run]] = []
        """The rows of the last picture, by cells and by runs."""
        self.drawn = 0
        """Number of columns of cells drawn so far."""

    def draw(self, curves: Sequence[Curve], frame: PlotFrame) -> list[list[Run]]:
        """Draw a window, from top to bottom."""
        valid = (frame.rows, frame.scale, frame.ink, *curves)
        if valid != self._valid:
            self._kept.clear()
            self._valid = valid
        else:
            now = [curve.columns.taken for curve in curves]
            changed = [last for taken, (before, last) in zip(now, self._seen, strict=True) if taken != before]
            if changed:
                first = min(changed) // frame.ink.wide
                self._kept = {x: column for x, column in self._kept.items() if x < first}
        self._seen = [(curve.columns.taken, curve.columns.last) for curve in curves]
        for x in range(frame.first, frame.last + 1):
            if x not in self._kept:
                self._kept[x] = self._column(curves, frame, x)
        if len(self._kept) > 3 * frame.columns:
            self._kept = {x: self._kept[x] for x in range(frame.first, frame.last + 1)}
        shown = [self._kept[x] for x in range(frame.first, frame.last + 1)]
        signs = zip(*(signs for signs, _ in shown), strict=True)
        owners = zip(*(owners for _, owners in shown), strict=True)
        before, self._rows = self._rows, list(zip(signs, owners, strict=True))
        same = len(before) == len(self._rows)
        self._runs = [self._runs[y] if same and row == before[y] else _runs(*row) for y, row in enumerate(self._rows)]
        return self._runs

    def _column(self, curves: Sequence[Curve], frame: PlotFrame, x: int) -> Cells:
        """Draw one column of cells; where curves meet, the cell shows the dots of all, and belongs to the first."""
        self.drawn += 1
        ink, rows = frame.ink, frame.rows
        dots, owners = [0] * rows, [EMPTY] * rows
        for columns, number, own in reversed(curves):
            for side in range(ink.wide):
                at = x * ink.wide + side
                column = columns.columns.get(at)
                span = None if column is None else _span(column, own or frame.scale, rows * ink.tall)
                if span is None:
                    continue
                for y in ink.dots(number, at, *span):
                    dots[y // ink.tall] |= 1 << (side * ink.tall + y % ink.tall)
                    owners[y // ink.tall] = number
        signs = (ink.glyph(dot, owner) if dot else " " for dot, owner in zip(dots, owners, strict=True))
        return tuple(signs), tuple(owners)


def _span(column: Column, scale: TickScale, dots: int) -> tuple[int, int] | None:
    """The dots of a column from top to bottom, with the line that comes from the column before; None: beyond it."""
    top, bottom = sorted((scale.dot(column.high, dots), scale.dot(column.low, dots)))
    if not isnan(column.come):
        come = scale.dot(column.come, dots)
        if come < top:
            top = come + 1
        elif come > bottom:
            bottom = come - 1
    top, bottom = max(0, top), min(dots - 1, bottom)
    return (top, bottom) if top <= bottom else None


def _runs(signs: Sequence[str], owners: Sequence[int]) -> list[Run]:
    """Join neighbouring cells; empty ones belong to the run before them, where there is one."""
    runs: list[Run] = []
    begin = 0
    for owner, group in groupby(owners):
        end = begin + sum(1 for _ in group)
        text = "".join(signs[begin:end])
        if runs and owner == EMPTY:
            runs[-1] = (runs[-1][0] + text, runs[-1][1])
        elif runs and (runs[-1][1] in (owner, EMPTY)):
            runs[-1] = (runs[-1][0] + text, owner)
        else:
            runs.append((text, owner))
        begin = end
    return runs


def with_text(runs: Sequence[Run], at: int, text: str, owner: int) -> list[Run]:
    """Put a text into a row from a column of cells on, over what is there."""
    with_it: list[Run] = []
    begin = 0
    for piece, own in runs:
        left, right = piece[: max(0, at - begin)], piece[max(0, at + len(text) - begin) :]
        here = [(text, owner)] if begin <= at < begin + len(piece) else []
        with_it += [run for run in ((left, own), *here, (right, own)) if run[0]]
        begin += len(piece)
    return with_it


def with_cursor(runs: Sequence[Run], at: int, sign: str) -> list[Run]:
    """Put the cursor into a row at a column of cells; a curve stays visible in it."""
    with_mark: list[Run] = []
    begin = 0
    for text, owner in runs:
        here = at - begin
        if 0 <= here < len(text):
            cell = sign if text[here] == " " else text[here]
            with_mark += [run for run in ((text[:here], owner), (cell, CURSOR), (text[here + 1 :], owner)) if run[0]]
        else:
            with_mark.append((text, owner))
        begin += len(text)
    return with_mark
