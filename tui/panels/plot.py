"""Plots as rows of text: what is plotted, in charts one above the other, for the panel and for the page.

What does not change in the time that is shown is one line of words; the rest is drawn. All charts have
the same columns, so what happens at one time is in one column.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from multidrop.tui.curves.chart import Chart, Extent
from multidrop.tui.curves.ink import Ink
from multidrop.tui.curves.look import Look
from multidrop.tui.curves.window import Window
from multidrop.tui.panels.chart_rows import AXIS, Shown, chart_rows, columns_of, gutter, shown_number, time_row
from multidrop.tui.panels.series import PLOTTED, Group, Line, groups, role_of
from multidrop.tui.panels.view import View
from multidrop.tui.text import age, fit
from multidrop.tui.widgets.lines import Row, Span, width_of

REST = 2.0
"""Steps by which the position of a drive at rest may change: an encoder between two counts."""
SAID = 8
"""Most rows of words of a chart."""
LOW = 3
"""Least rows of a chart."""
ROOM = AXIS + 8


def plot_title(view: View) -> Row:
    """The time shown, and the rate of the samples."""
    look = view.model.look
    hidden = f" no {' and '.join(sorted(look.hidden))} " if look.hidden else ""
    zoomed = f" x{look.zoom} " if look.zoom > 1 else ""
    return ((" plot ", "strong"), (f"{_span_words(look)} {rate_words(view)} {hidden}{zoomed}", "dim"))


def _title(view: View, group: Group, width: int) -> list[Span]:
    """The title of a chart: its quantity and unit; pieces of its lines with their names, unless those end the lines."""
    unit = group.lines[0].unit
    row: list[Span] = [(f" {group.title} ", "strong"), (f"{unit} " if unit else "", "dim")]
    if len(group.lines) > 1 and not gutter(width):
        row += _legend(view.model.look.ink, group)
    return row


def _legend(ink: Ink, group: Group) -> list[Span]:
    """Pieces of the lines with their names; under a title that names the only drive: `drive` and `twin`."""
    own = [line for line in group.lines if not line.twin]
    twins = [line for line in group.lines if line.twin]
    names = [line.name for line in own] if len(own) > 1 else ["drive"]
    row = [(f"{ink.sample(line.stroke)} {name} ", role_of(line.number)) for line, name in zip(own, names, strict=True)]
    if twins:
        samples = " ".join(dict.fromkeys(ink.sample(line.stroke) for line in twins))
        role = role_of(twins[0].number) if len(own) == 1 else "dim"
        row.append((f"{samples} {'twin' if len(twins) == 1 else 'twins'} ", role))
    return row


def _span_words(look: Look) -> str:
    span = f"{look.span:.0f} s" if look.span < 120 else f"{look.span / 60:.0f} min"
    return f"last {span} " if look.paused_at is None else f"{span}, paused "


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


def plot_rows(view: View, width: int, height: int) -> list[Row]:
    """The charts one below the other, in at most `height` rows; fewer where nothing moves."""
    found = groups(view)
    if not found:
        return [((fit(" nothing to plot: no drive is selected", width), "dim"),)]
    if width < ROOM or height < 1:
        no_room: Row = ((fit(" no room for a plot", width), "dim"),)
        return [no_room][:height]
    columns = columns_of(width)
    look = view.model.look
    window = look.window(view.now, columns, look.ink.wide)
    shown = _with_words(view, [_take(view, group, window) for group in found])
    return _stacked(view, shown, window, width, height)


def _take(view: View, group: Group, window: Window) -> tuple[Group, Chart, dict[Line, Extent]]:
    charts = view.model.look.charts
    key = (group.word, group.key, window.columns)
    if key not in charts and len(charts) > 32:
        charts.clear()
    chart = charts.setdefault(key, Chart())
    extents = chart.take(view.model.traces, [line.quantity for line in group.lines], window)
    return group, chart, {line: extents[line.quantity] for line in group.lines if line.quantity in extents}


def _with_words(view: View, taken: Sequence[tuple[Group, Chart, dict[Line, Extent]]]) -> list[Shown]:
    """Words for what does not move. A velocity of 0 is said by the position."""
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
            words.append((*_words(view, line, extent, velocities.get(line.quantity[:3])), *too))
        if len(words) > SAID:
            words[SAID - 1 :] = [((f" and {len(words) - SAID + 1} more that do not change", "dim"),)]
        shown.append(Shown(group, chart, moving, tuple(words)))
    return shown


def _agree(twin: Line, extents: Mapping[Line, Extent]) -> bool:
    """Whether a drive has the values of its twin."""
    own, predicted = extents.get(twin.of_drive), extents.get(twin)
    if own is None or predicted is None:
        return False
    return max(abs(own.low - predicted.low), abs(own.high - predicted.high)) <= REST


def _slack(line: Line, velocities: Mapping[tuple[str, str, str], Extent]) -> float:
    """The change of a value other than a motion."""
    resting = velocities.get(line.quantity[:3]) == (0, 0)
    return REST if line.of_drive.quantity.word == "position" and resting else 0.0


def _words(view: View, line: Line, extent: Extent | None, velocity: Extent | None) -> Row:
    """`a gantry at rest at 51300 steps`; what is not known is said."""
    measured = line.of_drive.quantity.word
    word = "" if measured in PLOTTED else f"{measured} "
    name = f" {line.shown} {word}"
    if extent is None:
        trace = view.model.traces.get(line.quantity)
        why = "no samples yet" if trace is None else "no samples in this time"
        return ((name, role_of(line.number)), (why, "dim"))
    value = (
        shown_number(extent.low) if not extent.width else f"{shown_number(extent.low)} to {shown_number(extent.high)}"
    )
    rests = measured == "position" and (velocity is None or velocity == (0, 0))
    text = f"{'at rest' if rests else 'steady'} at {value} {line.unit}".rstrip()
    trace = view.model.traces.get(line.quantity)
    missed = trace.overdue(view.now) if trace is not None and view.model.look.paused_at is None else 0.0
    if missed:
        return ((name, role_of(line.number)), (f"{text}, read {age(missed)} ago", "dim"))
    return ((name, role_of(line.number)), (text, "text"))


def _stacked(view: View, shown: Sequence[Shown], window: Window, width: int, height: int) -> list[Row]:
    """The groups one below the other; those that find no room are named."""
    kept = [each for each in shown if each.moving or each.words]
    left_out: list[str] = []
    while len(kept) > 1 and _least(kept) + bool(left_out) > height:
        left_out.append(kept.pop().group.title)
    charts = sum(1 for each in kept if each.moving)
    room = height - charts - sum(len(each.words) for each in kept) - bool(left_out)
    timed = bool(charts) and room - 1 >= (LOW + 1) * charts
    rows: list[Row] = []
    shares = _shares([each for each in kept if each.moving], room - timed)
    for each in kept:
        rows += each.words
        if each.moving:
            rows.append(_head(view, each.group, width))
            rows += chart_rows(view, each, window, width, shares.pop(0))
    if timed:
        rows.append(time_row(view, window))
    if left_out:
        rows.append(((fit(f" no room: {', '.join(reversed(left_out))}", width), "dim"),))
    return rows[:height]


def _shares(moving: Sequence[Shown], room: int) -> list[int]:
    """The rows of each chart: few for a switch beside other charts, the rest in equal parts."""
    switches = sum(map(_is_switch, moving))
    if switches == len(moving):
        switches = 0
    low = min(LOW, room // max(1, len(moving)))
    others, left = len(moving) - switches, room - switches * low
    shares = []
    for each in moving:
        if switches and _is_switch(each):
            shares.append(low)
        else:
            shares.append(left // others)
            left, others = left - shares[-1], others - 1
    return shares


def _is_switch(shown: Shown) -> bool:
    """Whether a chart has only values between 0 and 1, which need few rows."""
    return shown.group.word not in PLOTTED and all(low >= 0 and high <= 1 for low, high in shown.moving.values())


def _least(shown: Sequence[Shown]) -> int:
    return sum(len(each.words) + (1 + LOW if each.moving else 0) for each in shown)


def _head(view: View, group: Group, width: int) -> Row:
    """The title of a chart as a row; only panels have rules."""
    title = _title(view, group, width)
    while width_of(title) > width and len(title) > 1:
        title.pop()
    return tuple(title)
