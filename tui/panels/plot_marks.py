"""Marks in a chart: what happened to its drives, on their curves, and the ends of their travel.

A mark is a sign on the curve at its time, with its text where the cells next to it are empty. An end of travel is a
dashed line with its value, or an arrow with the value at the edge beyond which it is. Nothing here hides a curve but
the sign of a mark, one cell.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from multidrop.tui.curves.chart import Chart, ColumnWindow
from multidrop.tui.curves.marks import URGENCY, MarkKind, PlotMark, between
from multidrop.tui.curves.raster import Run, TickScale, row_of, with_text
from multidrop.tui.panels.drive import LEARNT, SEEN, SOFTWARE, STATED, travel_of
from multidrop.tui.panels.plotted import PlottedLine
from multidrop.tui.panels.view import View

MARK, ALARM, TRAVEL = -3, -4, -5
"""Owners of cells: a mark, one that needs a person, an end of travel."""
ROLES = {MARK: "strong", ALARM: "error", TRAVEL: "dim"}
ENDS = {STATED: "travel", SOFTWARE: "software limit", LEARNT: "limit switch"}
"""The words of an end of travel, by how it is known."""
DASH, UP, DOWN = "┄", "▲", "▼"


class MarkedChart(NamedTuple):
    """What the marks of a chart are placed by."""

    view: View
    lines: Sequence[PlottedLine]
    chart: Chart
    window: ColumnWindow
    scale: TickScale
    """In the units that are shown."""
    texts: bool = True
    """The marks have their texts here, not in a chart above."""


class _Cells:
    """The rows of a chart, in which texts are put."""

    def __init__(self, rows: Sequence[Sequence[Run]]) -> None:
        self.rows = [list(row) for row in rows]
        self._taken = ["".join(text for text, _ in row) for row in self.rows]
        """A space for each empty cell."""

    def put(self, x: int, y: int, text: str, owner: int) -> None:
        self.rows[y] = with_text(self.rows[y], x, text, owner)
        self._taken[y] = self._taken[y][:x] + "x" * len(text) + self._taken[y][x + len(text) :]

    def free(self, x: int, y: int, length: int) -> bool:
        """True if so many cells are empty, and those at both sides."""
        if not 0 <= y < len(self.rows) or x < 0 or x + length > len(self._taken[y]):
            return False
        return not self._taken[y][max(0, x - 1) : x + length + 1].strip(" ")

    def last_free(self, y: int, length: int) -> int | None:
        """The last place in a row with so many empty cells."""
        last = len(self._taken[y]) - length if 0 <= y < len(self.rows) else -1
        return next((x for x in range(last, -1, -1) if self.free(x, y, length)), None)

    def fill(self, y: int, sign: str, owner: int) -> None:
        """Fill the empty cells of a row."""
        for empty in list(re.finditer(" +", self._taken[y])):
            self.put(empty.start(), y, sign * len(empty[0]), owner)


def with_marks(marked: MarkedChart, drawn: Sequence[Sequence[Run]]) -> list[list[Run]]:
    """Put marks and ends of travel into the rows of a chart."""
    cells = _Cells(drawn)
    dashed = list(_put_ends(marked, cells))
    _put_marks(marked, cells)
    for y in dashed:
        cells.fill(y, DASH, TRAVEL)
    return cells.rows


def _put_ends(marked: MarkedChart, cells: _Cells) -> Iterator[int]:
    """Write the ends of travel; return the rows that they are in."""
    scale, height = marked.scale, len(cells.rows)
    for value, texts in _ends(marked).items():
        if scale.low <= value <= scale.high:
            y, arrow = row_of(value, scale, height), ""
            yield y
        else:
            y, arrow = (0, f"{UP} ") if value > scale.high else (height - 1, f"{DOWN} ")
        for text in texts:
            if (x := cells.last_free(y, len(arrow + text))) is not None:
                cells.put(x, y, arrow + text, TRAVEL)
                break


def _ends(marked: MarkedChart) -> dict[float, tuple[str, str]]:
    """The ends of the known travels in the unit that is shown, each with its words and with its number alone."""
    positions = [line for line in marked.lines if line.quantity.word == "position"]
    found: dict[float, tuple[str, str]] = {}
    for line in positions:
        readout = marked.view.model.bus(line.quantity.bus).readout(line.quantity.address)
        axis = next((each for each in readout.axes if each.axis == line.quantity.axis), None)
        travel = None if axis is None else travel_of(axis)
        if travel is None or travel.known_by == SEEN:
            continue
        whose = f"{line.short} " if len(positions) > 1 else ""
        for end in travel[:2]:
            number = line.text(end)
            found.setdefault(line.conversion.value(end), (f"{whose}{ENDS[travel.known_by]} {number}", number))
    return found


def marks_of(view: View, line: PlottedLine, lines: Sequence[PlottedLine], begin: float, end: float) -> list[PlotMark]:
    """The marks of a curve in a time; `lines` are those that are plotted with it."""
    bus, address, axis, word = line.quantity
    first = next(each for each in lines if each.quantity[:2] == (bus, address) and each.quantity.word == word) == line
    marks = between(view.model.bus(bus).marks, begin, end)
    return [mark for mark in marks if mark.of(address, axis, first)]


def sign_of(view: View, kind: MarkKind) -> str:
    """The sign of a mark; a letter where the series have signs of their own."""
    return kind.sign if view.model.look.ink.glyphs else kind.letter


def _put_marks(marked: MarkedChart, cells: _Cells) -> None:
    view, window, height = marked.view, marked.window, len(cells.rows)
    begin, end = window.first * window.cell, (window.last + 1) * window.cell
    lines = [line for line in marked.lines if not line.twin]
    placed: dict[tuple[int, int], tuple[PlotMark, str]] = {}
    for line in lines:
        whose = f"{line.short} " if len({each.name for each in lines}) > 1 else ""
        for x, mark in _by_column(marks_of(view, line, lines, begin, end), window).items():
            value = _value_at(marked, line, mark.at)
            if value is None:
                continue
            y = row_of(line.conversion.value(value), marked.scale, height)
            if (x, y) not in placed or URGENCY[mark.kind] <= URGENCY[placed[x, y][0].kind]:
                placed[x, y] = mark, whose
    for (x, y), (mark, _) in placed.items():
        cells.put(x, y, sign_of(view, mark.kind), MARK if mark.kind is MarkKind.SENT else ALARM)
    urgent = sorted(placed.items(), key=lambda each: (URGENCY[each[1][0].kind], -each[1][0].at))
    for (x, y), (mark, whose) in urgent if marked.texts else ():
        text = whose + mark.short
        for left, row in ((x, y - 1), (x, y + 1), (x + 2, y), (x - len(text), y - 1), (x - len(text), y + 1)):
            if cells.free(left, row, len(text)):
                cells.put(left, row, text, MARK if mark.kind is MarkKind.SENT else ALARM)
                break


def _by_column(marks: Sequence[PlotMark], window: ColumnWindow) -> dict[int, PlotMark]:
    """The most urgent mark in each column of cells, and of equal ones the newest."""
    found: dict[int, PlotMark] = {}
    for mark in marks:
        x = int(mark.at // window.dot) // window.wide - window.first
        if 0 <= x < window.columns and (x not in found or URGENCY[mark.kind] <= URGENCY[found[x].kind]):
            found[x] = mark
    return found


def _value_at(marked: MarkedChart, line: PlottedLine, at: float) -> float | None:
    """The value of a curve in the cell of a mark, or the last one before it."""
    drawn = marked.chart.value_at(line.quantity, at)
    trace = marked.view.model.traces.get(line.quantity)
    if drawn is not None or trace is None or not trace.values:
        return drawn
    return trace.values[max(0, trace.count_at(at) - trace.dropped - 1)]
