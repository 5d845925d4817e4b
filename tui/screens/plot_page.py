"""The page of plots: the same charts as the panel in all the room, with cursors, trigger, pause, zoom, and viewers.

A person sets a trigger, reads the cursors, and saves what is visible.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from math import isfinite

from multidrop.base.errors import Diagnostic
from multidrop.shell import plot_targets
from multidrop.shell.plots.batch import Batch, PlottedCurve
from multidrop.shell.roles import DIFFERENCE
from multidrop.tui.curves.chart import ChartView
from multidrop.tui.curves.marks import PlotMark
from multidrop.tui.curves.trigger import TriggerSetting, TriggerState
from multidrop.tui.panels.plot import columns_of, plot_rows, plot_title
from multidrop.tui.panels.plot_marks import marks_of, sign_of
from multidrop.tui.panels.plotted import PLOTTED, PlottedLine, groups, role_of
from multidrop.tui.panels.view import View
from multidrop.tui.polling import plotted
from multidrop.tui.screens.page import AskingPage, PageHost
from multidrop.tui.text import visible
from multidrop.tui.widgets.lines import Row, Span, width_of

EDGES = {"rise": True, "fall": False}
USUAL_SHARE = "20%"
"""The share of the picture before the edge."""
FORM = "CURVE rise|fall LEVEL [SHARE%]"
MOST_NAMED, NEAR = 3, 1.5
"""Marks that are named at the cursor, and the cells within which a mark is near it."""
SHORTEST_SPAN = 0.001
"""The least time between two cursors, s, of which the frequency is shown."""


def _lines(view: View) -> list[PlottedLine]:
    return [line for group in groups(view) for line in group.lines if not line.twin]


def _named(line: PlottedLine) -> str:
    """`a velocity`, `press:b X position`: as a person types it."""
    return f"{line.short} {line.quantity.word}"


def typed_trigger(view: View) -> str:
    """The trigger as it can be typed: that which is set, or one in the middle of a curve that moves."""
    lines, look = _lines(view), view.model.look
    setting = look.trigger.setting
    fits = [line for line in lines if setting is not None and line.quantity == setting.quantity]
    if fits and setting is not None:
        level, rising, before = fits[0].conversion.value(setting.level), setting.rising, f"{setting.before:.0%}"
        return f"{_named(fits[0])} {'rise' if rising == (fits[0].conversion.gain > 0) else 'fall'} {level:g} {before}"
    for line in lines:
        trace = view.model.traces.get(line.quantity)
        seen = [value for _, value in trace.since(trace.count_at(view.now - look.span))] if trace is not None else []
        if seen and max(seen) - min(seen) > 2:
            level = (line.conversion.value(min(seen)) + line.conversion.value(max(seen))) / 2
            return f"{_named(line)} rise {float(f'{level:.2g}'):.10g} {USUAL_SHARE}"
    return f"{_named(lines[0])} rise 100 {USUAL_SHARE}" if lines else ""


def parse_trigger(view: View, text: str) -> TriggerSetting:
    """Parse `CURVE rise|fall LEVEL [SHARE%]`; the level is in the unit that is shown. Raises Diagnostic."""
    words = text.split()
    at = next((n for n, word in enumerate(words) if word.lower() in EDGES), len(words))
    named, edge, numbers = words[:at], words[at : at + 1], words[at + 1 :]
    valid = f"valid: {FORM}, as {typed_trigger(view) or 'a velocity rise 100 20%'}"
    try:
        level, share = (*map(float, numbers[:1]), float((numbers[1:] or [USUAL_SHARE])[0].removesuffix("%")) / 100)
    except ValueError:
        raise Diagnostic(f"no trigger {text!r}", hint=valid) from None
    if not edge or len(numbers) > 2 or not isfinite(level) or not 0 <= share <= 1:
        raise Diagnostic(f"no trigger {text!r}", hint=valid)
    lines = _lines(view)
    fits = [line for line in lines if set(named) <= _names(line)]
    if len(fits) != 1:
        known = ", ".join(map(_named, fits or lines)) or "nothing"
        what = "several curves are" if fits else "no plotted curve is"
        raise Diagnostic(f"{what} {' '.join(named) or 'without a name'!r}", hint=f"plotted: {known}")
    gain, zero = fits[0].conversion
    return TriggerSetting(fits[0].quantity, (level - zero) / gain, EDGES[edge[0].lower()] == (gain > 0), share)


def _names(line: PlottedLine) -> set[str]:
    bus, address, axis, word = line.quantity
    return {bus, address, f"{bus}:{address}", axis, word, *line.name.split()}


def trigger_row(view: View) -> Row:
    """The state of the trigger and its condition; nothing while it is off."""
    trigger = view.model.look.trigger
    if trigger.state is TriggerState.OFF or (setting := trigger.setting) is None:
        return ()
    once = ", once" if trigger.single else ""
    line = next((each for each in _lines(view) if each.quantity == setting.quantity), None)
    if line is None:
        return ((f" {trigger.state.value}{once} ", "accent"), (f"by {setting.quantity.word}, not plotted now", "dim"))
    return ((f" {trigger.state.value}{once} ", "accent"), (typed_trigger(view), "dim"))


def cursor_rows(view: View, width: int, most: int) -> list[Row]:
    """The times of the cursors, their differences, and the values of each curve there, in at most so many rows."""
    look = view.model.look
    at, other = look.cursor, look.other
    if at is None:
        return []
    clocks = [f"{view.session.wall(time):%H:%M:%S.%f}"[:-4] for time in (other, at) if time is not None]
    since = at - (view.now if look.zero is None else look.zero)
    pieces: list[list[Span]] = [[(f" {' to '.join(clocks)} ", "strong"), (f" {since:.2f} s  ", "dim")]]
    if other is not None:
        apart = f"dt {at - other:+.3f} s  "
        pieces[0][1:] = [(f" {apart}", "strong")]
        if abs(at - other) >= SHORTEST_SPAN:
            pieces.append([(f"1/dt {1 / abs(at - other):.4g} Hz  ", "strong")])
    pieces += _mark_pieces(view, at, look.cells(columns_of(width))[1])
    for group in groups(view):
        chart = look.charts.get((group.word, group.key, columns_of(width)))
        for line in group.lines if chart is not None else ():
            values = [None if chart is None else chart.value_at(line.quantity, time) for time in (other or at, at)]
            texts = ["not known" if value is None else line.text(value) for value in values]
            text = texts[1] if other is None else f"{texts[0]} to {texts[1]}"
            if other is not None and values[0] is not None and values[1] is not None:
                text += f" ({line.apart(values[1] - values[0])})"
            pieces.append([(f"{line.shown} {group.word} ", role_of(line.number)), (f"{text}  ", "strong")])
    rows: list[list[Span]] = [[]]
    for number, piece in enumerate(pieces):
        if rows[-1] and width_of(rows[-1]) + width_of(piece) > width:
            if len(rows) == most:
                rows[-1].append((f"and {len(pieces) - number} more", "dim"))
                break
            rows.append([(" ", "text")])
        rows[-1] += piece
    return [tuple(row) for row in rows]


def _mark_pieces(view: View, at: float, cell: float) -> list[list[Span]]:
    """The marks within a cell of a time: sign, drive, text and time of each."""
    lines = _lines(view)
    found: dict[PlotMark, str] = {}
    for line in lines:
        for mark in marks_of(view, line, lines, at - NEAR * cell, at + NEAR * cell):
            found.setdefault(mark, line.name)
    nearest = sorted(found, key=lambda mark: abs(mark.at - at))
    pieces: list[list[Span]] = [
        [
            (
                f"{sign_of(view, mark.kind)} {found[mark] if mark.address is not None else 'all drives'} ",
                mark.kind.role,
            ),
            (f"{visible(mark.text)} ", "strong"),
            (f"{view.session.wall(mark.at):%H:%M:%S.%f}"[:-4] + "  ", "dim"),
        ]
        for mark in nearest[:MOST_NAMED]
    ]
    if len(nearest) > MOST_NAMED:
        pieces.append([(f"and {len(nearest) - MOST_NAMED} more marks  ", "dim")])
    return pieces


def samples_of(view: View, width: int) -> Batch:
    """The samples that are visible in a plot of this width: each curve with its own numbers, and in its unit."""
    look = view.model.look
    window = look.window(view.now, columns_of(width), look.ink.wide)
    begin, end = window.first * window.cell, (window.last + 1) * window.cell
    wall = view.session.wall(begin).timestamp()
    batch = Batch()
    for group in groups(view):
        for line in group.lines:
            trace = view.model.traces.get(line.quantity)
            seen = (
                [point for point in trace.since(trace.count_at(begin)) if point[0] < end] if trace is not None else []
            )
            if not seen:
                continue
            bus, address, axis, word = line.of_drive.quantity
            curve = PlottedCurve(bus, address, axis, word, twin=line.twin or word == DIFFERENCE)
            batch.labels[bus, address] = view.session.buses[bus].drives[address].label
            batch.curves[curve] = [(at - begin, wall + at - begin, value) for at, value in seen]
            if line.figures.unit and word in PLOTTED and not line.twin:
                shown = [(*times, line.conversion.value(value)) for *times, value in batch.curves[curve]]
                batch.curves[curve._replace(unit=line.unit.rstrip("?"))] = [
                    (one, two, point) for one, two, point in shown
                ]
    if not batch.curves:
        raise Diagnostic("nothing to save", hint="there are no samples in the time that is shown")
    return batch


class PlotPage(AskingPage):
    """Plots. Keys change how a person looks at them; what is plotted changes by lines that a person could type."""

    SHEET = "plot"
    WANTS = frozenset({"motion", "plot", "samples"})
    PARTS = {"heading": None, "charts": "1fr", "below": None, "asked": None}
    FIELD = "asked"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._columns = 1

    @property
    def _look(self) -> ChartView:
        return self.host.model.look

    @property
    def _view(self) -> View:
        """What is plotted now: a key may come before the page is painted first."""
        return View(self.host.session, self.host.model, [], self.host.session.now(), True)

    def show(self, view: View) -> None:
        if self.asked is not None and self.asked.overtaken(self.host.session):
            self._close("a stop or another drive came in between: it was not used")
        self._look.follow(view.model.traces, view.now)
        charts = self.lines("charts")
        size = charts.size
        self._columns = max(1, columns_of(size.width))
        _, *about = plot_title(view)
        self.lines("heading").put([((" PLOTS   ", "strong"), *about, *trigger_row(view))])
        charts.put(plot_rows(view, size.width, size.height))
        most = max(2, self.size.height // 5)
        said: list[Row] = [((f" {self.said[0]}", self.said[1]),)] if self.said[0] else []
        self.lines("below").put_all([*cursor_rows(view, size.width, most), *said] or [self._below(view)])

    def _below(self, view: View) -> Row:
        """The last failure, or how to see what a viewer shows, or what else takes the samples."""
        if self.host.model.trouble:
            return ((f" ✗ {self.host.model.trouble}", "error"),)
        served = [plot for plot in view.session.plots if plot.desk]
        if served:
            return (
                (" at your desk: ", "dim"),
                (served[0].desk, "strong"),
                ("   c copies it; then: ", "dim"),
                (served[0].viewer, "strong"),
            )
        others = [plot.shown for plot in view.session.plots]
        return ((f" {others[0]}", "dim"),) if others else ()

    def _type(self, line: str) -> None:
        """Send a line as if a person had typed it; its failure is shown below the charts."""
        self.host.model.trouble = ""
        self.say("", "dim")
        self.host.outbox.type(line)

    def action_pause(self) -> None:
        """Hold the picture, or let it run; from one that a trigger holds, wait for the next edge."""
        trigger = self._look.trigger
        if trigger.stands and trigger.setting is not None:
            self._look.arm(trigger.setting, trigger.single, self.host.model.traces)
        else:
            self._look.pause(self.host.session.now())

    def action_other(self) -> None:
        self._look.change_cursor(self.host.session.now(), self._columns)

    # What is typed: a trigger, or the name of a file

    def action_trigger(self, kind: str = "trigger") -> None:
        self.ask_for(kind, typed_trigger(self._view), FORM)
        self.say(f"trigger: {FORM}; SHARE of the picture comes before the edge", "dim")

    def action_single(self) -> None:
        """Wait for one edge with the trigger that is set; without one, ask for it."""
        trigger = self._look.trigger
        if trigger.setting is not None:
            self._look.arm(trigger.setting, True, self.host.model.traces)
        else:
            self.action_trigger("single")

    def action_save(self) -> None:
        try:
            files = plot_targets.needed().files
        except Diagnostic as failure:
            self.say(f"✗ {failure}", "error")
            return
        self.ask_for("save", "", files)
        self.say(f"save what is visible: {files}", "dim")

    def typed(self, text: str) -> None:
        asked, view = self.asked, self._view
        if asked is None or asked.overtaken(self.host.session):
            self._close("it was not used")
            return
        try:
            if asked.kind == "save":
                file, write = plot_targets.needed().save(text)
                batch = samples_of(view, self.lines("charts").size.width)
                self.app.run_worker(self._save(file, write, batch))
                self._close(f"saving {file} ...")
            else:
                self._look.arm(parse_trigger(view, text), asked.kind == "single", view.model.traces)
                self._close("")
        except Diagnostic as failure:
            self.say(f"✗ {failure}", "error")

    async def _save(self, file: str, write: Callable[[Batch], Awaitable[None]], batch: Batch) -> None:
        """Write the file; the outcome is on the page, and in the transcript also if the page was left."""
        try:
            await write(batch)
        except Diagnostic as failure:
            self.say(f"✗ {failure}", "error")
            self.host.show_line(str(failure), "x")
        else:
            said = f"{sum(map(len, batch.curves.values()))} values of {len(batch.curves)} curves are in {file}"
            self.say(said)
            self.host.show_line(said, ".")
        self.host.frames.wake()

    def _close(self, said: str) -> None:
        self.end_asking()
        self.say(said, "dim")

    def action_cursor(self, columns: int) -> None:
        """Move the cursor; that pauses."""
        self._look.move_cursor(columns, self.host.session.now(), self._columns)

    def action_shorter(self, by: int) -> None:
        self._look.shorter(by)

    def action_closer(self, by: int) -> None:
        self._look.closer(by)

    def action_automatic(self) -> None:
        self._look.automatic()
        self._look.trigger.disarm()
        self._look.go_on()

    async def action_beside(self) -> None:
        """Show the plot beside the transcript, or hide it, and go there."""
        self.dismiss(None)
        await self.app.run_action("act.panel('plot')")

    def action_apart(self) -> None:
        self._look.apart = not self._look.apart

    def action_hide(self, word: str) -> None:
        """Hide the charts of a quantity, or show them; one of the two stays."""
        hidden = self._look.hidden ^ {word}
        if hidden != set(PLOTTED):
            self._look.hidden = hidden

    def action_drive(self, number: int) -> None:
        """Plot a drive of the selected line, by its number in the list, or plot it no longer; 0: plot all of them."""
        if number == 0:
            self._type(f"/plot {self.host.session.selected_bus}:*")
            return
        bus = self.host.session.buses.get(self.host.session.selected_bus)
        if bus is None or number > len(bus.drives):
            return
        address = list(bus.drives)[number - 1]
        named = list(plotted(self.host.session))
        mine = [series for series in named if (series.bus, series.address, series.word) == (bus.name, address, "")]
        texts = [series.text for series in named if series not in mine]
        texts += [] if mine else [f"{bus.name}:{address}"]
        if texts:  # one stays
            self._type(f"/plot {' '.join(texts)}")

    def action_difference(self) -> None:
        named = list(plotted(self.host.session))
        texts = [series.text for series in named if series.word != DIFFERENCE]
        if len(texts) == len(named):
            texts += [series._replace(word=DIFFERENCE).text for series in named if not series.word]
        if texts:  # one stays
            self._type(f"/plot {' '.join(texts)}")

    def action_stream(self) -> None:
        if self.host.session.plots:
            self._type("/plot off")
            return
        texts = " ".join(series.text for series in plotted(self.host.session))
        try:
            self._type(f"/plot {texts} {plot_targets.needed().stream}")
        except Diagnostic as failure:
            self.say(f"✗ {failure}", "error")

    def action_copy(self) -> None:
        served = [plot.desk for plot in self.host.session.plots if plot.desk]
        if served:
            self.app.copy_to_clipboard(served[0])
            self.notify("Copied", timeout=2)

    def on_mount(self) -> None:
        self.host.model.trouble = ""

    def on_unmount(self) -> None:
        """Let the picture go on: only this page has keys for that."""
        self._look.go_on()

    def action_leave(self) -> None:
        """Close the line; remove the cursors and go on; then leave. A trigger stays."""
        look = self._look
        if self.asked is not None:
            self._close("")
            return
        if look.cursor is not None or (look.paused_at is not None and not look.trigger.stands):
            look.go_on()
            return
        super().action_leave()
