"""Plots as rows of text: what is plotted, in charts one above the other, for the panel and for the page.

What does not change in the time that is shown is one line of words; the rest is drawn. All charts have
the same columns, so what happens at one time is in one column.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import count
from typing import NamedTuple

from multidrop.dialects.values import Conditions
from multidrop.shell.roles import DIFFERENCE, Series
from multidrop.tui.curves.chart import Chart, Extent, Look, Window
from multidrop.tui.curves.raster import CURSOR, EMPTY, TWINS, Ink, Scale, row_of, ticks, with_cursor
from multidrop.tui.curves.samples import PREDICTED, Quantity
from multidrop.tui.figures import NATIVE, Conversion, Figures
from multidrop.tui.panels.view import View
from multidrop.tui.polling import moved_lately, plotted
from multidrop.tui.readout import Readout
from multidrop.tui.text import age, digits, fit, short
from multidrop.tui.widgets.lines import SERIES, Row, Span, beside, width_of

PLOTTED = ("velocity", "position")
"""The quantities of every drive."""
_MEASURED = {predicted: measured for measured, predicted in PREDICTED.items()}


class Line(NamedTuple):
    """A quantity that is plotted: its drive's name, its unit, and the number of its colour and dashes."""

    name: str
    quantity: Quantity
    unit: str
    number: int
    twin: bool = False
    """A prediction of the drive's twin."""
    figures: Figures = NATIVE
    """The form in which its values are shown."""

    @property
    def stroke(self) -> int:
        return self.number + TWINS * self.twin

    @property
    def of_drive(self) -> Line:
        if not self.twin:
            return self
        return self._replace(twin=False, quantity=self.quantity._replace(word=_MEASURED[self.quantity.word]))

    @property
    def conversion(self) -> Conversion:
        """What is plotted in the unit that is shown."""
        word, figures = self.of_drive.quantity.word, self.figures
        if word == DIFFERENCE:
            return Conversion(figures.places.gain)
        return {"velocity": figures.speeds, "position": figures.places}.get(word, Conversion())

    def text(self, plotted: float) -> str:
        """A plotted value; in units with its unit, else a whole number has no decimals."""
        figures, value = self.figures, self.conversion.value(plotted)
        if figures.unit and self.unit:
            return f"{round(value, figures.decimals) + 0.0:.{figures.decimals}f} {self.unit}"
        return digits(int(value)) if value == int(value) else f"{value:.3f}"

    def extent(self, plotted: Extent) -> Extent:
        """A plotted extent in the unit that is shown."""
        return Extent(*sorted(map(self.conversion.value, plotted)))

    @property
    def shown(self) -> str:
        """`a gantry`, or `a gantry twin`."""
        return f"{self.name} twin" if self.twin else self.name

    @property
    def short(self) -> str:
        """The same without the name that a person gave."""
        where, axis = self.name.partition(" ")[0], self.quantity.axis
        return " ".join(filter(None, (where, axis if axis != where else "", "twin" if self.twin else "")))


class Group(NamedTuple):
    """The lines that share a chart."""

    word: str
    key: str
    """The drive, where each has charts of its own."""
    lines: tuple[Line, ...]

    @property
    def title(self) -> str:
        """Its quantity, and the drive if there is only one."""
        names = {line.name for line in self.lines}
        return f"{self.word} {names.pop()}" if len(names) == 1 else self.word


def shown_series(view: View) -> Sequence[Series]:
    """What is plotted: what was named; else the selected drive, and each one that moved in the time that is shown."""
    named = view.only or plotted(view.session)
    if view.only or view.session.plotted:
        return named
    look = view.model.look
    since = (view.now if look.paused_at is None else look.paused_at) - look.span
    return list(dict.fromkeys([*named, *moved_lately(view.session, view.model, since)]))


def plot_shows(view: View) -> bool:
    """True while there is a curve: something was named, or moved in the time that is shown, or the plot is paused."""
    look = view.model.look
    moved = moved_lately(view.session, view.model, view.now - look.span)
    return bool(view.session.plotted or moved) or look.paused_at is not None


def _numbers(view: View, drawn: Sequence[Series]) -> dict[tuple[str, str, str], int]:
    """The number of the colour of each axis: it stays while the axis is plotted, whatever else moves."""
    axes = [(*each[:2], axis) for each in drawn for axis in _axes(view, each)]
    held = view.model.look.numbers
    for gone in held.keys() - set(axes):
        del held[gone]
    for each in axes:
        held.setdefault(each, next(number for number in count() if number not in held.values()))
    return held


def _axes(view: View, series: Series) -> list[str]:
    return (view.model.traces.axes(*series[:2]) if series.of_motion else []) or [""]


def groups(view: View) -> list[Group]:
    """The plotted lines by chart: velocities, positions, then values by their words. A twin's follow their drive's."""
    found: dict[tuple[str, str], list[Line]] = {}
    drawn = shown_series(view)
    numbers = _numbers(view, drawn)
    several = len({each.bus for each in drawn}) > 1
    for each_drawn in drawn:
        bus, address, word = each_drawn
        for axis in _axes(view, each_drawn):
            number = numbers[bus, address, axis] % len(SERIES)
            drive = view.session.buses[bus].drives[address]
            where = ":".join(filter(None, (bus if several or not address else "", address)))
            name = " ".join(filter(None, (where, drive.label, axis)))
            for each in [word] if word else PLOTTED:
                unit, figures = _unit(view, bus, address, axis, each) if word in ("", DIFFERENCE) else ("", NATIVE)
                key = " ".join(filter(None, (name if view.model.look.apart else "", unit if figures.unit else "")))
                lines = found.setdefault((each, key), [])
                lines.append(Line(name, Quantity(bus, address, axis, each), unit, number, figures=figures))
                if not word and _recent(view, predicted := Quantity(bus, address, axis, PREDICTED[each])):
                    lines.append(Line(name, predicted, unit, number, twin=True, figures=figures))
    order = sorted(found, key=lambda key: list(PLOTTED).index(key[0]) if key[0] in PLOTTED else 9)
    if view.model.look.apart:
        order = sorted(order, key=lambda key: min(line.number for line in found[key]))
    return [Group(*key, tuple(found[key])) for key in order if key[0] not in view.model.look.hidden]


def _recent(view: View, predicted: Quantity) -> bool:
    """True if a twin has predicted in the time that is shown, also one that has ended since."""
    look, trace = view.model.look, view.model.traces.get(predicted)
    end = view.now if look.paused_at is None else look.paused_at
    return trace is not None and trace.at[-1] >= end - look.span


def _unit(view: View, bus: str, address: str, axis: str, quantity: str) -> tuple[str, Figures]:
    """`mm`, `steps`, or what the drive counts; of a velocity, that a second or a unit of its own; with the figures."""
    found = next((each for each in view.model.bus(bus).readout(address).axes if each.axis == axis), Readout())
    figures, own = found.figures, found.conditions or Conditions()
    if quantity == "velocity":
        return (f"{figures.speed_unit}{figures.sign}" if figures.speed_unit else own.speed_unit), figures
    return (f"{figures.unit}{figures.sign}" if figures.unit else own.unit), figures


def role_of(number: int) -> str:
    return SERIES[number]


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


def chart_rows(view: View, shown: Shown, window: Window, width: int, height: int) -> list[Row]:
    """The rows of a chart, from top to bottom."""
    if height < 1:
        return []
    look = view.model.look
    scale = _scale(view, shown)
    lines = [(line.quantity, line.stroke, _own_scale(line, scale)) for line in shown.moving]
    drawn = shown.chart.draw(lines, window, height, scale, look.ink)
    marks = ticks(scale, height)
    zero = row_of(0.0, scale, height) if scale.low <= 0 <= scale.high else -1
    if zero >= 0:
        marks.setdefault(zero, 0.0)
    ends = _line_ends(view, shown, scale, height, gutter(width))
    cursor = None if look.cursor is None else int(look.cursor // window.dot) // window.wide - window.first
    in_units = any(line.figures.unit for line in shown.moving)
    rows: list[Row] = []
    for y, runs in enumerate(drawn):
        if cursor is not None:
            runs = with_cursor(runs, cursor, "│")
        label = short(marks[y], scale.step, prefixes=not in_units) if y in marks else ""
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
    extents = [line.extent(each) for line, each in shown.moving.items()]
    if word == "position":  # a stated travel is the range of the chart
        extents += [line.extent(Extent(*line.figures.travel)) for line in shown.moving if line.figures.travel]
    middle, convert = newest if centre is None else centre, first.conversion
    least = LEAST.get(word, 1.0) * abs(convert.gain)
    return shown.chart.scale(extents, least, word == "velocity", look.zoom, convert.value(middle))


def _own_scale(line: Line, scale: Scale) -> Scale:
    """The scale of a chart in the numbers that are plotted; it falls where their sign is turned."""
    gain, zero = line.conversion
    return Scale((scale.low - zero) / gain, (scale.high - zero) / gain, scale.step)


def _line_ends(view: View, shown: Shown, scale: Scale, rows: int, room: int) -> dict[int, tuple[Span, ...]]:
    """The names of lines with their last values, or those at the cursor, beside the rows where the lines end."""
    look = view.model.look
    found: list[tuple[tuple[int, float], Line, Span]] = []
    for line in shown.moving if room else ():
        trace = view.model.traces.get(line.quantity)
        at = look.cursor if look.cursor is not None else look.paused_at
        last = trace.values[-1] if trace is not None and trace.values else None
        value = last if at is None else shown.chart.value_at(line.quantity, at)
        height = line.conversion.value(value or 0.0)
        row = rows // 2 if value is None else row_of(min(max(height, scale.low), scale.high), scale, rows)
        missed = trace.overdue(view.now) if trace is not None and at is None else 0.0
        text = "–" if value is None else line.text(value)
        shown_value = (f"{text} ({age(missed)})", "dim") if missed else (text, "strong")
        found.append(((row, -height), line, shown_value))
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
                ("not known" if value is None else line.text(value), "strong"),
                ("  ", "text"),
            ]
    return tuple(row)


REST = 2.0
"""Steps by which the position of a drive at rest may change: an encoder between two counts."""
SAID = 8
"""Most rows of words of a chart."""
LOW = 3
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


def _legend(ink: Ink, lines: Sequence[Line], alone: bool, room: int) -> list[Span]:
    """Pieces of the lines with their names, short ones where there is little room; `drive` and `twin` of one drive."""
    own = [line for line in lines if not line.twin]
    twins = [line for line in lines if line.twin]
    names = ["drive"] if alone else [line.name for line in own]
    if not alone and sum(map(len, names)) + 4 * len(names) > room:
        names = [line.short for line in own]
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


def panel_rows(view: View, width: int, height: int) -> list[Row]:
    """The charts of the panel: velocities beside positions where they would be low, one below the other."""
    found = groups(view)
    if len(found) > 2 and width >= 2 * HALF and height < HIGH * len(found):
        half = width // 2
        speeds = [each for each in found if each.word == PLOTTED[0]]
        left = _charts(view, speeds, half - 1, height)
        right = _charts(view, [each for each in found if each not in speeds], width - half, height)
        return beside(left, right, half)
    return plot_rows(view, width, height)


def plot_rows(view: View, width: int, height: int) -> list[Row]:
    """The charts one below the other, in at most `height` rows; fewer where nothing moves."""
    return _charts(view, groups(view), width, height)


def _charts(view: View, found: Sequence[Group], width: int, height: int) -> list[Row]:
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
            words.append((*_words(view, line, extent, velocities.get(line.quantity[:3])), *too))
        if len(words) > SAID:
            words[SAID - 1 :] = [((f" and {len(words) - SAID + 1} more that do not change", "dim"),)]
        shown.append(Shown(group, chart, moving, tuple(words)))
    return _stacked(view, shown, window, width, height)


def _take(view: View, group: Group, window: Window) -> tuple[Group, Chart, dict[Line, Extent]]:
    charts = view.model.look.charts
    key = (group.word, group.key, window.columns)
    if key not in charts and len(charts) > 32:
        charts.clear()
    chart = charts.setdefault(key, Chart())
    extents = chart.take(view.model.traces, [line.quantity for line in group.lines], window)
    return group, chart, {line: extents[line.quantity] for line in group.lines if line.quantity in extents}


def _agree(twin: Line, extents: Mapping[Line, Extent]) -> bool:
    own, predicted = extents.get(twin.of_drive), extents.get(twin)
    if own is None or predicted is None:
        return False
    return max(abs(own.low - predicted.low), abs(own.high - predicted.high)) <= REST


def _slack(line: Line, velocities: Mapping[tuple[str, str, str], Extent]) -> float:
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
    value = line.text(extent.low) if not extent.width else f"{line.text(extent.low)} to {line.text(extent.high)}"
    rests = measured == "position" and (velocity is None or velocity == (0, 0))
    text = f"{'at rest' if rests else 'steady'} at {value} {'' if line.figures.unit else line.unit}".rstrip()
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
            unit = each.group.lines[0].unit
            title: list[Span] = [(f" {each.group.title} ", "strong"), (f"{unit} " if unit else "", "dim")]
            if len(each.group.lines) > 1 and not gutter(width):  # else the names end the lines
                alone = len({line.name for line in each.group.lines}) == 1
                lines = each.group.lines if alone else tuple(each.moving)
                title += _legend(view.model.look.ink, lines, alone, width - width_of(title))
            while width_of(title) > width and len(title) > 1:
                title.pop()
            rows.append(tuple(title))
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
    """True if a chart has only values between 0 and 1, which need few rows."""
    return shown.group.word not in PLOTTED and all(low >= 0 and high <= 1 for low, high in shown.moving.values())


def _least(shown: Sequence[Shown]) -> int:
    return sum(len(each.words) + (1 + LOW if each.moving else 0) for each in shown)
