"""Plots as rows of text: what is plotted, in charts one above the other, for the panel and for the page.

What does not change in the time that is shown is one line of words; the rest is drawn. All charts have
the same columns, so what happens at one time is in one column.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import floor
from typing import NamedTuple

from multidrop.tui.curves.chart import Chart, ChartView, ColumnWindow, Extent
from multidrop.tui.curves.raster import CURSOR, EMPTY, TWINS, TickScale, row_of, ticks, with_cursor
from multidrop.tui.curves.samples import TraceQuantity
from multidrop.tui.curves.trigger import TriggerState
from multidrop.tui.panels.plot_marks import ROLES, MarkedChart, with_marks
from multidrop.tui.panels.plotted import PLOTTED, ChartGroup, PlottedLine, groups, role_of
from multidrop.tui.panels.view import View
from multidrop.tui.text import age, fit, short
from multidrop.tui.widgets.lines import Row, Span, beside, width_of

AXIS = 10
"""Width of the axis of values in cells: label, space, tick."""
LEAST_SPANS = {"velocity": 100.0, "position": 10.0}
"""The least width of a scale."""
WIDE_FROM, HEADS = 64, 3
"""Width of a plot from which a legend may have several rows, and the most of them."""
_ROLES = {EMPTY: "text", CURSOR: "strong", **ROLES, **{n: role_of(n) for n in range(2 * TWINS)}}
"""The role of a cell by its owner."""


class ShownGroup(NamedTuple):
    """A group as it is shown: its chart, the extents of what moves, and words for what does not."""

    group: ChartGroup
    chart: Chart
    moving: dict[PlottedLine, Extent]
    words: tuple[Row, ...]


def columns_of(width: int) -> int:
    """The columns of cells of a chart in a plot of this width."""
    return max(1, width - AXIS)


def chart_rows(view: View, shown: ShownGroup, window: ColumnWindow, height: int, texts: bool = True) -> list[Row]:
    """The rows of a chart, from top to bottom; with `texts` its marks have theirs."""
    if height < 1:
        return []
    look = view.model.look
    scale = _scale(view, shown, height)
    lines: list[tuple[TraceQuantity, int, TickScale]] = []
    for line in shown.moving:  # each in the numbers that are plotted, whose scale falls where their sign is turned
        gain, zero = line.conversion
        own = TickScale((scale.low - zero) / gain, (scale.high - zero) / gain, scale.step)
        lines.append((line.quantity, line.stroke, own))
    drawn = shown.chart.draw(lines, window, height, scale, look.ink)
    drawn = with_marks(MarkedChart(view, list(shown.moving), shown.chart, window, scale, texts), drawn)
    marks = ticks(scale, height)
    cursors = [
        (int(at // window.dot) // window.wide - window.first, sign)
        for at, sign in ((look.other, "┊"), (look.cursor, "│"))
        if at is not None
    ]
    setting, level = look.trigger.setting, -1
    if look.trigger.state is not TriggerState.OFF and setting is not None:
        plotted = [line.conversion.value(setting.level) for line in shown.moving if line.quantity == setting.quantity]
        level = next((row_of(value, scale, height) for value in plotted if scale.low <= value <= scale.high), -1)
    in_units = any(line.figures.unit for line in shown.moving)
    rows: list[Row] = []
    for y, runs in enumerate(drawn):
        for at, sign in cursors:
            runs = with_cursor(runs, at, sign)
        label = short(marks[y], scale.step, prefixes=not in_units) if y in marks else ""
        tick = "▸" if y == level else "│" if y not in marks else "┤" if marks[y] else "┼"
        rows.append(
            (
                (f"{label:>{AXIS - 2}} ", "dim"),
                (tick, "rule"),
                *[(text, _ROLES[owner]) for text, owner in runs],
            )
        )
    return rows


def _scale(view: View, shown: ShownGroup, rows: int) -> TickScale:
    """The scale of what moves; magnified around the cursor, or around the newest value."""
    look, word = view.model.look, shown.group.word
    first = next(iter(shown.moving))
    centre = shown.chart.value_at(first.quantity, view.now if look.cursor is None else look.cursor)
    trace = view.model.traces.get(first.quantity)
    newest = trace.values[-1] if trace is not None and trace.values else 0.0
    extents = [line.extent(extent) for line, extent in shown.moving.items()]
    middle, convert = newest if centre is None else centre, first.conversion
    least = LEAST_SPANS.get(word, 1.0) * abs(convert.gain)
    return shown.chart.scale(extents, least, word == "velocity", look.zoom, convert.value(middle), rows)


def time_row(view: View, window: ColumnWindow) -> Row:
    """The times below the charts, in even steps: seconds before now; of a picture that stands, the time of day."""
    look = view.model.look
    end = view.now if look.paused_at is None else look.paused_at
    base = end if look.zero is None else look.zero
    if look.paused_at is not None and look.zero is None:
        wall = view.session.wall(end)
        base -= (wall.hour * 3600 + wall.minute * 60 + wall.second + wall.microsecond / 1e6) % window.step
    cells, every = [" "] * (AXIS + window.columns), round(window.step / window.cell)
    place = floor(base / window.cell + 1e-6) - window.first
    for n in range(-(place // every), (window.columns - 1 - place) // every + 1):
        text, begin = _time_words(view, base, n, window.step), AXIS + place + n * every
        if begin + len(text) < len(cells):
            cells[begin : begin + len(text) + 1] = f"╵{text}"
        elif not "".join(cells[begin - len(text) - 1 : begin + 1]).strip():
            cells[begin - len(text) : begin + 1] = f"{text}╵"
        else:
            cells[begin] = "╵"
    return (("".join(cells), "dim"),)


def _time_words(view: View, base: float, n: int, step: float) -> str:
    look, side = view.model.look, "+" if view.model.look.zero is not None else ""
    if look.paused_at is not None and look.zero is None:
        text = f"{view.session.wall(base + n * step + 1e-6):%H:%M:%S.%f}"
        return text[:-7] if step >= 1 else text[:-5]
    if n == 0:
        return "edge" if side else "now"
    return f"{n * step / 60:{side}.3g} min" if step >= 60 else f"{n * step:{side}.3g} s"


REST_STEPS = 2.0
"""Steps by which the position of a drive at rest may change: an encoder between two counts."""
SAID = 8
"""Most rows of words of a chart."""
LOWEST_CHART = 3
"""Least rows of a chart."""
ROOM = AXIS + 8
HALF, HIGH = 36, 6
"""Least width of one of two columns of charts; the rows below which charts are in two."""


def plot_title(view: View) -> Row:
    """The time shown, and the rate of the samples."""
    look = view.model.look
    hidden = f" no {' and '.join(sorted(look.hidden))} " if look.hidden else ""
    zoomed = f" x{look.zoom} " if look.zoom > 1 else ""
    return ((" plot ", "strong"), (f"{_span_words(look)} {rate_words(view)} {hidden}{zoomed}", "dim"))


def _head(view: View, shown: ShownGroup, width: int) -> list[Row]:
    """The title of a chart, its unit, and its legend: each curve by name, with its last value or that at the cursor.

    The names that people gave, then the values, are left out where there is no room for them.
    """
    group, look = shown.group, view.model.look
    unit = group.lines[0].unit
    title: list[Span] = [(f" {group.title} ", "strong"), (f"{unit} " if unit else "", "dim")]
    alone = len({line.name for line in group.lines}) == 1
    samples = [(look.ink.sample(line.stroke), line) for line in (group.lines if alone else shown.moving)]
    for valued, names in ((True, "shown"), (True, "short"), (False, "shown"), (False, "short")):
        rows, row = [], list(title)
        for sample, line in samples:
            name = ("twin" if line.twin else "drive" if len(samples) > 1 else "") if alone else getattr(line, names)
            piece: list[Span] = [(f"{sample} {name} ", role_of(line.number))] if len(samples) > 1 or not alone else []
            piece += [_value_span(view, shown, line)] if valued else []
            if width_of(row) + width_of(piece) > width:
                rows.append(tuple(row))
                row = [("  ", "text")]
            row += piece
        rows.append(tuple(row))
        if len(rows) <= (HEADS if width >= WIDE_FROM else 1) and width_of(rows[-1]) <= width:
            return rows
    left = list(rows[0])
    while width_of(left) > width and len(left) > 1:
        left.pop()
    return [tuple(left), *rows[1:]][: HEADS if width >= WIDE_FROM else 1]


def _value_span(view: View, shown: ShownGroup, line: PlottedLine) -> Span:
    """The last value of a line, or that at the cursor or the edge, as wide as any in its picture: so nothing jumps."""
    look, trace = view.model.look, view.model.traces.get(line.quantity)
    at = next((time for time in (look.cursor, look.zero, look.paused_at) if time is not None), None)
    if at is not None:
        value = shown.chart.value_at(line.quantity, at)
    else:
        value = trace.values[-1] if trace is not None and trace.values else None
    extent = shown.moving.get(line, Extent(value or 0.0, value or 0.0))
    text = "–" if value is None else line.text(value)
    text = f"{text:>{max(len(line.text(end)) for end in extent)}} "
    missed = trace.overdue(view.now) if trace is not None and at is None else 0.0
    return (f"{text}({age(missed)}) ", "dim") if missed else (text, "strong")


def _span_words(look: ChartView) -> str:
    span = f"{look.span:.0f} s" if look.span < 120 else f"{look.span / 60:.0f} min"
    if look.paused_at is None:
        return f"last {span} "
    return f"{span} " if look.zero is not None else f"{span}, paused "


def rate_words(view: View) -> str:
    """The real rate of the samples: `28 Hz`, or the lowest and the highest of several."""
    if not view.polling:
        return "polling off"
    traces = [view.model.traces.get(line.quantity) for group in groups(view) for line in group.lines if not line.twin]
    rates = [0.0 if trace is None else trace.rate(view.now) for trace in traces]
    low, high = min(rates, default=0.0), max(rates, default=0.0)
    if not high:
        return "no samples"
    return f"{high:.0f} Hz" if high - low < 2 else f"{low:.0f}-{high:.0f} Hz"


def panel_rows(view: View, width: int, height: int) -> list[Row]:
    """The charts of the panel: velocities beside positions where they would be low, one below the other."""
    charts = groups(view)
    if len(charts) > 2 and width >= 2 * HALF and height < HIGH * len(charts):
        half = width // 2
        speeds = [group for group in charts if group.word == PLOTTED[0]]
        left = _charts(view, speeds, half - 1, height)
        right = _charts(view, [group for group in charts if group not in speeds], width - half, height)
        return beside(left, right, half)
    return plot_rows(view, width, height)


def plot_rows(view: View, width: int, height: int) -> list[Row]:
    """The charts one below the other, in at most `height` rows; fewer where nothing moves."""
    return _charts(view, groups(view), width, height)


def _charts(view: View, found: Sequence[ChartGroup], width: int, height: int) -> list[Row]:
    if not found:
        return [((fit(" nothing to plot: no drive is selected", width), "dim"),)]
    if width < ROOM or height < 1:
        no_room: Row = ((fit(" no room for a plot", width), "dim"),)
        return [no_room][:height]
    columns = columns_of(width)
    look = view.model.look
    window = look.window(view.now, columns, look.ink.wide)
    taken = [_take(view, group, window) for group in found]
    velocities = {
        line.quantity[:3]: extent for group, _, extents in taken for line, extent in extents.items()
        if group.word == "velocity" and not line.twin
    }  # fmt: skip
    positions = {line.quantity[:3] for group, _, _ in taken if group.word == "position" for line in group.lines}
    shown = []
    for group, chart, extents in taken:
        moving = {line: each for line, each in extents.items() if each.width > _slack(line, velocities)}
        agreeing = {line.of_drive for line in group.lines if line.twin and _agree(line, extents)}
        words = []
        for line in group.lines:
            extent = extents.get(line)
            silent = extent is None or line.of_drive in agreeing
            if line in moving or (line.twin and silent):
                continue
            if extent in (None, (0, 0)) and group.word == "velocity" and line.quantity[:3] in positions:
                continue
            too: Row = ((", its twin too", "dim"),) if line in agreeing else ()
            words.append(_within((*_words(view, line, extent, velocities.get(line.quantity[:3])), *too), width))
        if len(words) > SAID:
            others = f" and {len(words) - SAID + 1} more that do not change"
            words[SAID - 1 :] = [_within(((others, "dim"),), width)]
        shown.append(ShownGroup(group, chart, moving, tuple(words)))
    return _stacked(view, shown, window, width, height)


def _take(view: View, group: ChartGroup, window: ColumnWindow) -> tuple[ChartGroup, Chart, dict[PlottedLine, Extent]]:
    charts = view.model.look.charts
    key = (group.word, group.key, window.columns)
    if key not in charts and len(charts) > 32:
        charts.clear()
    chart = charts.setdefault(key, Chart())
    extents = chart.take(view.model.traces, [line.quantity for line in group.lines], window)
    return group, chart, {line: extents[line.quantity] for line in group.lines if line.quantity in extents}


def _within(row: Row, width: int) -> Row:
    """A row, cut where it is wider than its room."""
    kept: list[Span] = []
    for text, role in row:
        room = width - width_of(kept)
        kept.append((text if width_of([(text, role)]) <= room else fit(text, room), role))
    return tuple(kept)


def _agree(twin: PlottedLine, extents: Mapping[PlottedLine, Extent]) -> bool:
    own, predicted = extents.get(twin.of_drive), extents.get(twin)
    if own is None or predicted is None:
        return False
    return max(abs(own.low - predicted.low), abs(own.high - predicted.high)) <= REST_STEPS


def _slack(line: PlottedLine, velocities: Mapping[tuple[str, str, str], Extent]) -> float:
    resting = velocities.get(line.quantity[:3]) == (0, 0)
    return REST_STEPS if line.of_drive.quantity.word == "position" and resting else 0.0


def _words(view: View, line: PlottedLine, extent: Extent | None, velocity: Extent | None) -> Row:
    """`a gantry at rest at 51300 steps`; what is not known is said."""
    measured = line.of_drive.quantity.word
    word = "" if measured in PLOTTED else f"{measured} "
    name = f" {line.shown} {word}"
    if extent is None:
        trace = view.model.traces.get(line.quantity)
        why = "no samples yet" if trace is None else "no samples in this time"
        return ((name, role_of(line.number)), (why, "dim"))
    value = line.text(extent.low) if not extent.width else f"{line.text(extent.low)} to {line.text(extent.high)}"
    rests = measured == "position" and (velocity is None or velocity == (0, 0))
    text = f"{'at rest' if rests else 'steady'} at {value} {'' if line.figures.unit else line.unit}".rstrip()
    trace = view.model.traces.get(line.quantity)
    missed = trace.overdue(view.now) if trace is not None and view.model.look.paused_at is None else 0.0
    if missed:
        return ((name, role_of(line.number)), (f"{text}, read {age(missed)} ago", "dim"))
    return ((name, role_of(line.number)), (text, "text"))


def _stacked(view: View, shown: Sequence[ShownGroup], window: ColumnWindow, width: int, height: int) -> list[Row]:
    """The groups one below the other; those that find no room are named."""
    kept = [group for group in shown if group.moving or group.words]
    left_out: list[str] = []
    while len(kept) > 1 and _least(kept) + bool(left_out) > height:
        left_out.append(kept.pop().group.title)
    heads = [_head(view, group, width) for group in kept if group.moving]
    if sum(map(len, heads)) + (LOWEST_CHART + 1) * len(heads) > height:
        heads = [head[:1] for head in heads]
    charts = len(heads)
    room = height - sum(map(len, heads)) - sum(len(group.words) for group in kept) - bool(left_out)
    timed = bool(charts) and room - 1 >= (LOWEST_CHART + 1) * charts
    rows: list[Row] = []
    shares = _shares([group for group in kept if group.moving], room - timed)
    said: set[str] = set()
    """The drives whose marks have their texts in a chart above."""
    for group in kept:
        rows += group.words
        if group.moving:
            names = {line.name for line in group.moving}
            rows += heads.pop(0)
            rows += chart_rows(view, group, window, shares.pop(0), not names <= said)
            said |= names
    if timed:
        rows.append(time_row(view, window))
    if left_out:
        rows.append(((fit(f" no room: {', '.join(reversed(left_out))}", width), "dim"),))
    return rows[:height]


def _shares(moving: Sequence[ShownGroup], room: int) -> list[int]:
    """The rows of each chart: few for a switch beside other charts, the rest in equal parts."""
    switches = sum(map(_is_switch, moving))
    if switches == len(moving):
        switches = 0
    low = min(LOWEST_CHART, room // max(1, len(moving)))
    others, left = len(moving) - switches, room - switches * low
    shares = []
    for group in moving:
        if switches and _is_switch(group):
            shares.append(low)
        else:
            shares.append(left // others)
            left, others = left - shares[-1], others - 1
    return shares


def _is_switch(shown: ShownGroup) -> bool:
    """True if a chart has only values between 0 and 1, which need few rows."""
    return shown.group.word not in PLOTTED and all(low >= 0 and high <= 1 for low, high in shown.moving.values())


def _least(shown: Sequence[ShownGroup]) -> int:
    return sum(len(group.words) + (1 + LOWEST_CHART if group.moving else 0) for group in shown)
