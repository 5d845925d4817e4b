"""The picture of some curves with one scale, kept from frame to frame: only columns with new samples are drawn.

Theory of operation. The time axis moves in whole cells, counted from time 0, so a drawn column of cells stays true
while the picture scrolls. A column is drawn again when a sample falls into it, or when the scale changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from math import isnan
from typing import NamedTuple

from multidrop.tui.curves.columns import Column, Columns
from multidrop.tui.curves.ink import Ink
from multidrop.tui.curves.scale import Scale

EMPTY, CURSOR = -1, -2
"""Owners of a cell beside the numbers of the series."""
Run = tuple[str, int]
"""Cells of one owner, side by side."""


class Frame(NamedTuple):
    """The frame of a picture: a window of columns of cells, its rows, scale and ink."""

    first: int
    columns: int
    rows: int
    scale: Scale
    ink: Ink

    @property
    def last(self) -> int:
        """The newest column of cells."""
        return self.first + self.columns - 1


@dataclass(frozen=True)
class _Drawn:
    """One column of cells from top to bottom: signs, and the series to which each belongs."""

    signs: tuple[str, ...]
    owners: tuple[int, ...]


class Curve(NamedTuple):
    """The columns of a series, and the number that gives its colour and dashes."""

    columns: Columns
    number: int


class Raster:
    """Draws curves, and keeps what it drew."""

    def __init__(self) -> None:
        self._kept: dict[int, _Drawn] = {}
        self._valid: object = None
        self._seen: list[tuple[int, int]] = []
        """For each curve, the samples taken and the newest column at the last drawing."""
        self._rows: list[tuple[tuple[str, ...], tuple[int, ...]]] = []
        self._runs: list[list[Run]] = []
        """The rows of the last picture, by cells and by runs."""
        self.drawn = 0
        """Number of columns of cells drawn so far."""

    def draw(self, curves: Sequence[Curve], frame: Frame) -> list[list[Run]]:
        """Draw a window, from top to bottom."""
        self._forget_changed(curves, frame)
        for x in range(frame.first, frame.last + 1):
            if x not in self._kept:
                self._kept[x] = self._column(curves, frame, x)
        if len(self._kept) > 3 * frame.columns:
            self._kept = {x: self._kept[x] for x in range(frame.first, frame.last + 1)}
        shown = [self._kept[x] for x in range(frame.first, frame.last + 1)]
        signs = zip(*(each.signs for each in shown), strict=True)
        owners = zip(*(each.owners for each in shown), strict=True)
        before, self._rows = self._rows, list(zip(signs, owners, strict=True))
        same = len(before) == len(self._rows)
        self._runs = [self._runs[y] if same and row == before[y] else _runs(*row) for y, row in enumerate(self._rows)]
        return self._runs

    def _forget_changed(self, curves: Sequence[Curve], frame: Frame) -> None:
        valid = (frame.rows, frame.scale, frame.ink, *((each.columns, each.number) for each in curves))
        if valid != self._valid:
            self._kept.clear()
            self._valid = valid
        else:
            now = [each.columns.taken for each in curves]
            changed = [last for taken, (before, last) in zip(now, self._seen, strict=True) if taken != before]
            if changed:
                first = min(changed) // frame.ink.wide
                self._kept = {x: column for x, column in self._kept.items() if x < first}
        self._seen = [(each.columns.taken, each.columns.last) for each in curves]

    def _column(self, curves: Sequence[Curve], frame: Frame, x: int) -> _Drawn:
        """Draw one column of cells; where curves meet, the cell shows the dots of all, and belongs to the first."""
        self.drawn += 1
        ink, rows = frame.ink, frame.rows
        dots, owners = [0] * rows, [EMPTY] * rows
        for columns, number in reversed(curves):
            for side in range(ink.wide):
                at = x * ink.wide + side
                column = columns.columns.get(at)
                span = None if column is None else _span(column, frame.scale, rows * ink.tall)
                if span is None:
                    continue
                for y in ink.dots(number, at, *span):
                    dots[y // ink.tall] |= 1 << (side * ink.tall + y % ink.tall)
                    owners[y // ink.tall] = number
        signs = (ink.glyph(each, owner) if each else " " for each, owner in zip(dots, owners, strict=True))
        return _Drawn(tuple(signs), tuple(owners))


def _span(column: Column, scale: Scale, dots: int) -> tuple[int, int] | None:
    """The dots of a column from top to bottom, with the line that comes from the column before; None: beyond it."""
    top, bottom = scale.dot(column.high, dots), scale.dot(column.low, dots)
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
    found: list[Run] = []
    begin = 0
    for owner, group in groupby(owners):
        end = begin + sum(1 for _ in group)
        text = "".join(signs[begin:end])
        if found and owner == EMPTY:
            found[-1] = (found[-1][0] + text, found[-1][1])
        elif found and (found[-1][1] in (owner, EMPTY)):
            found[-1] = (found[-1][0] + text, owner)
        else:
            found.append((text, owner))
        begin = end
    return found


def with_cursor(runs: Sequence[Run], at: int, sign: str) -> list[Run]:
    """Put the cursor into a row at a column of cells; a curve stays visible in it."""
    found: list[Run] = []
    begin = 0
    for text, owner in runs:
        here = at - begin
        if 0 <= here < len(text):
            cell = sign if text[here] == " " else text[here]
            found += [each for each in ((text[:here], owner), (cell, CURSOR), (text[here + 1 :], owner)) if each[0]]
        else:
            found.append((text, owner))
        begin += len(text)
    return found
