"""One chart as rows of text: its scale, its lines with their names and last values at the ends, the times below."""

from __future__ import annotations

from typing import NamedTuple

from multidrop.tui.curves.chart import Chart, Extent
from multidrop.tui.curves.ink import TWINS
from multidrop.tui.curves.look import Look
from multidrop.tui.curves.raster import CURSOR, EMPTY, with_cursor
from multidrop.tui.curves.scale import Scale, row_of, ticks
from multidrop.tui.curves.window import Window
from multidrop.tui.panels.series import Group, Line, groups, role_of
from multidrop.tui.panels.view import View
from multidrop.tui.text import age, digits, fit, short
from multidrop.tui.widgets.lines import SERIES, Row, Span

AXIS = 10
"""Width of the axis of values in cells: label, space, tick."""
LEAST = {"velocity": 100.0, "position": 10.0}
"""The least width of a scale."""
NAMES = 64
"""Width of a plot from which the names of its lines stand at their ends."""
_ROLES = {EMPTY: "text", CURSOR: "strong", **{n: SERIES[n % TWINS] for n in range(2 * TWINS)}}
"""The role of a cell by its owner."""
STEPS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0)
"""Seconds between two times below a chart."""


class Shown(NamedTuple):
    """A group as it is shown: its chart, the extents of what moves, and words for what does not."""

    group: Group
    chart: Chart
    moving: dict[Line, Extent]
    words: tuple[Row, ...]


def columns_of(width: int) -> int:
    """The columns of cells of a chart in a plot of this width."""
    return width - AXIS - gutter(width)


def gutter(width: int) -> int:
    """Room right of the charts, for names and values at the ends of lines."""
    return min(30, max(20, width // 4)) if width >= NAMES else 0


def shown_number(value: float) -> str:
    """Format a value; a whole number has no decimals."""
    return digits(int(value)) if value == int(value) else f"{value:.3f}"


def chart_rows(view: View, shown: Shown, window: Window, width: int, height: int) -> list[Row]:
    """The rows of a chart, from top to bottom."""
    if height < 1:
        return []
    look = view.model.look
    scale = _scale(view, shown)
    lines = [(line.quantity, line.stroke) for line in shown.moving]
    drawn = shown.chart.draw(lines, window, height, scale, look.ink)
    marks = ticks(scale, height)
    zero = row_of(0.0, scale, height) if scale.low <= 0 <= scale.high else -1
    if zero >= 0:
        marks.setdefault(zero, 0.0)
    ends = _line_ends(view, shown, scale, height, gutter(width))
    cursor = None if look.cursor is None else int(look.cursor // window.dot) // window.wide - window.first
    rows: list[Row] = []
    for y, runs in enumerate(drawn):
        if cursor is not None:
            runs = with_cursor(runs, cursor, "│")
        label = short(marks[y], scale.step) if y in marks else ""
        tick = "┼" if y == zero else "┤" if y in marks else "│"
        rows.append(
            (
                (f"{label:>{AXIS - 2}} ", "dim"),
                (tick, "rule"),
                *[(text, _ROLES[owner]) for text, owner in runs],
                *ends.get(y, ()),
            )
        )
    return rows


def _scale(view: View, shown: Shown) -> Scale:
    """The scale of what moves; magnified around the cursor, or around the newest value."""
    look, word = view.model.look, shown.group.word
    first = next(iter(shown.moving))
    centre = shown.chart.value_at(first.quantity, view.now if look.cursor is None else look.cursor)
    trace = view.model.traces.get(first.quantity)
    newest = trace.values[-1] if trace is not None and trace.values else 0.0
    extents = list(shown.moving.values())
    middle = newest if centre is None else centre
    return shown.chart.scale(extents, LEAST.get(word, 1.0), word == "velocity", look.zoom, middle)


def _line_ends(view: View, shown: Shown, scale: Scale, rows: int, room: int) -> dict[int, tuple[Span, ...]]:
    """The names of lines with their last values, or those at the cursor, beside the rows where the lines end."""
    look = view.model.look
    found: list[tuple[tuple[int, float], Line, Span]] = []
    for line in shown.moving if room else ():
        trace = view.model.traces.get(line.quantity)
        at = look.cursor if look.cursor is not None else look.paused_at
        last = trace.values[-1] if trace is not None and trace.values else None
        value = last if at is None else shown.chart.value_at(line.quantity, at)
        row = rows // 2 if value is None else row_of(min(max(value, scale.low), scale.high), scale, rows)
        missed = trace.overdue(view.now) if trace is not None and at is None else 0.0
        text = "–" if value is None else shown_number(value)
        shown_value = (f"{text} ({age(missed)})", "dim") if missed else (text, "strong")
        found.append(((row, -(value or 0.0)), line, shown_value))
    found.sort(key=lambda each: each[0])
    ends: dict[int, tuple[Span, ...]] = {}
    for place, ((row, _), line, value_span) in enumerate(found[:rows]):
        free = min(max(row, max(ends, default=-1) + 1), rows - len(found[:rows]) + place)
        sample = look.ink.sample(line.stroke)
        left = room - len(value_span[0]) - len(sample) - 3
        name = line.shown if len(line.shown) <= left else fit(line.short, left).rstrip()
        ends[free] = ((f" {sample} {name} ", role_of(line.number)), value_span)
    return ends


def time_row(view: View, window: Window) -> Row:
    """The times below the charts: seconds before now, or the time of day while paused."""
    look = view.model.look
    least = window.span / max(1, window.columns // 12)
    step = next((each for each in STEPS if each >= least), window.span)
    cells = [" "] * (AXIS + window.columns)
    for n in range(round(window.span / step), -1, -1):
        text = _time_words(view, look, n * step, minutes=window.span > 120)
        end = AXIS + round(window.columns * (1 - n * step / window.span))
        begin = min(max(AXIS, end - len(text) // 2), len(cells) - len(text))
        if not "".join(cells[max(0, begin - 1) : begin + len(text) + 1]).strip():
            cells[begin : begin + len(text)] = text
    return (("".join(cells), "dim"),)


def _time_words(view: View, look: Look, ago: float, *, minutes: bool) -> str:
    if look.paused_at is not None:
        return f"{view.session.wall(look.paused_at - ago):%H:%M:%S}"
    if ago == 0:
        return "now"
    return f"-{ago / 60:.3g} min" if minutes else f"-{ago:.3g} s"


def cursor_row(view: View, width: int) -> Row:
    """The time at the cursor, and the values there."""
    at = view.model.look.cursor
    if at is None:
        return ()
    clock = f"{view.session.wall(at):%H:%M:%S.%f}"[:-4]
    row: list[Span] = [(f" {clock} ", "strong"), (f" {at - view.now:.2f} s  ", "dim")]
    charts = view.model.look.charts
    for group in groups(view):
        chart = charts.get((group.word, group.key, columns_of(width)))
        for line in group.lines if chart is not None else ():
            value = None if chart is None else chart.value_at(line.quantity, at)
            name = f"{line.shown} {group.word} "
            row += [
                (name, role_of(line.number)),
                ("not known" if value is None else shown_number(value), "strong"),
                ("  ", "text"),
            ]
    return tuple(row)
