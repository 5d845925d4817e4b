"""A plot to rerun or into a table, and its feed: samples, values, states and twins; typed and printed lines as a log.

Theory of operation. A plot takes samples and texts at almost no cost. A thread passes them on in batches. A killed
process loses at most half a second, and a frozen viewer delays nothing. There are two timelines: `elapsed` (s since the
plot began; it continues where an existing file ended) and `time` (the wall clock).
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from functools import partial

from multidrop.base.errors import Diagnostic
from multidrop.base.text import counted
from multidrop.dialects.units import Takes
from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.events import Conditioned, Lost, Sample, Unsolicited, Valued
from multidrop.drives.telemetry import MODEST, READ_PERIOD, DriveValue, Subscription, Telemetry
from multidrop.features.plot_files.file import SinkBroken
from multidrop.features.plot_files.options import PlotOptions
from multidrop.features.plot_files.request import TABLES, PlotTarget
from multidrop.features.plot_files.rerun_calls import AGREES, COLOURS, DIFFERS, RUNS, Sink
from multidrop.features.plot_files.table import TableSink
from multidrop.shell import events
from multidrop.shell.plots.batch import TWIN, Batch, PlottedCurve, StateLane
from multidrop.shell.roles import DIFFERENCE, RunningPlot, Series
from multidrop.shell.session import Session
from multidrop.shell.threads import in_thread
from multidrop.transports.sockets import exposed

USUAL_OPTIONS = PlotOptions()
FILE_PERIOD, LIVE_PERIOD = 0.4, 0.1
"""The time between batches, s: longer makes a smaller file, shorter a smoother view."""
BATCH_TIMEOUT = 8.0
"""The time to take a batch, s, after which the sink counts as frozen."""
FILE_TIMEOUT = 120.0
"""The time to read and rewrite an existing file, s."""
ABANDON_TIMEOUT = 2.0
"""The time to disconnect a broken sink, s."""


class Plot:
    """An open plot. `open` makes one, `close` ends it; it ends by itself when its sink breaks.

    What takes samples, values, states and texts never blocks.
    """

    def __init__(self, sink: Sink | TableSink, clock: Callable[[], float], wall: Callable[[float], datetime]) -> None:
        """Use `open`."""
        self._sink, self._wall = sink, wall
        self._clock = clock
        self._begin = clock() - sink.offset
        self._epoch = self._at_zero()
        self._batch = Batch()
        self._curves: set[PlottedCurve] = set()
        """The curves that have samples."""
        self._states: dict[StateLane, str] = {}
        """The last state of each lane."""
        self._closing = asyncio.Event()
        self._on_failure: list[Callable[[str], None]] = []
        self.target = sink.target
        """The target, with the port that is in use."""
        self._in_units: set[PlottedCurve] = set()
        """The curves in units of which no end was recorded."""
        self.samples = 0
        """The number of samples taken."""
        self.failure = ""
        """The reason why the plot ended by itself; empty: it did not."""
        self.ended = asyncio.Event()
        """Set at the end, by `close` or after a failure."""
        self._task = asyncio.get_running_loop().create_task(self._flushing())

    @classmethod
    async def open(cls, target: PlotTarget, *, clock: Callable[[], float], wall: Callable[[float], datetime]) -> Plot:
        """Begin a plot. `clock` is the clock of the samples' times, `wall` converts such a time to the time of day.

        A file of ours is continued. Raises Diagnostic where rerun is missing, the file is not a plot or not
        writable, or the port is in use. Raises Unreachable where no viewer listens. The target is unchanged then.
        """
        try:
            sink = await in_thread(lambda: _sink(target), _timeout(target))
        except TimeoutError:
            raise Diagnostic(f"cannot plot to {target.text}: it does not respond") from None
        return cls(sink, clock, wall)

    def on_failure(self, callback: Callable[[str], None]) -> None:
        """Call back once, with one line for a person, if the plot ends by itself."""
        self._on_failure.append(callback)

    def label(self, bus: str, address: str, label: str) -> None:
        self._batch.labels[bus, address] = label

    def sample(self, bus: str, sample: Sample) -> None:
        if not self._done:
            self.samples += 1
            drive = (bus, sample.address, sample.axis)
            self._point(PlottedCurve(*drive, "position"), sample.at, sample.position)
            self._point(PlottedCurve(*drive, "velocity"), sample.at, sample.velocity)

    def in_units(self, bus: str, sample: Sample, word: str, value: float, unit: str) -> None:
        """Take a quantity of a sample in the unit of its axis, too."""
        if not self._done:
            curve = PlottedCurve(bus, sample.address, sample.axis, word, unit=unit)
            self._in_units.add(curve)
            self._point(curve, sample.at, value)

    def not_in_units(self, bus: str, sample: Sample) -> None:
        """End the curves of an axis in its unit: its scale does not hold."""
        for curve in [unit for unit in self._in_units if unit[:3] == (bus, sample.address, sample.axis)]:
            self._in_units.remove(curve)
            self._batch.gaps.setdefault(curve, []).append(self._times(sample.at))

    def value(self, bus: str, read: Valued) -> None:
        if not self._done:
            self.samples += 1
            self._point(PlottedCurve(bus, read.address, "", read.word), read.at, read.value)

    def predicted(self, bus: str, twin: events.Predicted, *, alone: bool = False) -> None:
        """Take a prediction of a drive's twin; `alone`: the difference only."""
        if not self._done:
            self.samples += alone
            drive = (bus, twin.address, twin.axis)
            for word, value in [("position", twin.position), ("velocity", twin.velocity)] if not alone else []:
                self._point(PlottedCurve(*drive, word, twin=True), twin.at, value)
            self._point(PlottedCurve(*drive, DIFFERENCE, twin=True), twin.at, twin.difference)
            if self._states.get(StateLane(*drive, TWIN), "") == "":
                self.state(*drive, TWIN, twin.at, RUNS)

    def twin_ended(self, bus: str, address: str, at: float) -> None:
        for curve in self._curves if not self._done else ():
            if curve.twin and curve[:2] == (bus, address):
                self._batch.gaps.setdefault(curve, []).append(self._times(at))
        for lane in list(self._states):
            if (*lane[:2], lane.name) == (bus, address, TWIN):
                self.state(*lane, at, "")

    def _point(self, curve: PlottedCurve, at: float, value: float) -> None:
        self._curves.add(curve)
        self._batch.curves.setdefault(curve, []).append((*self._times(at), float(value)))

    def state(self, bus: str, address: str, axis: str, name: str, at: float, text: str) -> None:
        """Take a state; one that has not changed takes no room."""
        lane = StateLane(bus, address, axis, name)
        if not self._done and self._states.get(lane) != text:
            self._states[lane] = text
            self._batch.states.setdefault(lane, []).append((*self._times(at), text))

    def gap(self, bus: str, at: float) -> None:
        """End the curves of a bus that is lost; their next samples begin them again."""
        for curve in self._curves if not self._done else ():
            if curve.bus == bus:
                self._batch.gaps.setdefault(curve, []).append(self._times(at))
        for lane in list(self._states):
            if lane.bus == bus:
                self.state(*lane, at, "")

    def text(self, bus: str, address: str, at: float, text: str, level: str) -> None:
        """Take a line of text; `level` is `command`, `reply`, `error` or `note`."""
        if level not in COLOURS:
            raise ValueError(f"level {level!r}")
        if not self._done:
            line = (f"{address}: {text}" if address else text).encode("utf-8", "replace").decode("utf-8")
            self._batch.texts.setdefault(bus, []).append((*self._times(at), line, level))

    async def close(self) -> str:
        """Write everything and close; return one line about the result. May be called again.

        Raises Diagnostic where the plot failed.
        """
        self._closing.set()
        await asyncio.shield(self._task)
        if self.failure:
            raise Diagnostic(self.failure)
        return f"{counted(self.samples, 'sample')} in {self.target.text}"

    @property
    def _done(self) -> bool:
        return self._closing.is_set() or bool(self.failure)

    def _times(self, at: float) -> tuple[float, float]:
        return at - self._begin, at + self._epoch

    def _at_zero(self) -> float:
        """The wall clock's time when the samples' clock was 0, s; read for each batch, not for each sample."""
        now = self._clock()
        return self._wall(now).timestamp() - now

    async def _flushing(self) -> None:
        """Send batches until the plot is closed or broken. Never cancelled; `close` ends it."""
        period = LIVE_PERIOD if self.target.file is None else FILE_PERIOD
        try:
            while not self._closing.is_set():
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._closing.wait(), period)
                await self._flush()
            await self._flush()
            await in_thread(self._sink.close, _timeout(self.target))
        except (SinkBroken, TimeoutError) as error:
            reason = str(error) if isinstance(error, SinkBroken) else self._sink.why(error)
            self.failure = f"plotting ended: {reason}"
            self._batch = Batch()
            self._sink.leave_behind()
            for callback in self._on_failure:
                callback(self.failure)
            with contextlib.suppress(TimeoutError):
                await in_thread(self._sink.abandon, ABANDON_TIMEOUT)
            self._sink.let_go()
        finally:
            self.ended.set()

    async def _flush(self) -> None:
        batch, self._batch, self._epoch = self._batch, Batch(), self._at_zero()
        if batch:
            await in_thread(lambda: self._sink.send(batch), BATCH_TIMEOUT)


async def write(target: PlotTarget, batch: Batch) -> None:
    """Write samples into a new file. Raises Diagnostic, and then there is no file, or what came before."""
    if target.file is None or os.path.exists(target.file):
        what = "is there already" if target.file is not None else "is not a file"
        raise Diagnostic(f"{target.text} {what}", hint="use another name")

    def work() -> None:
        sink = _sink(target)
        try:
            sink.send(batch)
            sink.close()
        except SinkBroken as error:
            sink.abandon()
            sink.let_go()
            raise Diagnostic(str(error)) from None

    try:
        await in_thread(work, FILE_TIMEOUT)
    except TimeoutError:
        raise Diagnostic(f"cannot write {target.text}: it does not respond") from None


def _sink(target: PlotTarget) -> Sink | TableSink:
    return TableSink(target) if target.file is not None and target.file.suffix in TABLES else Sink(target)


def _timeout(target: PlotTarget) -> float:
    return BATCH_TIMEOUT if target.file is None else FILE_TIMEOUT


ON = {True: "on", False: "off", None: ""}


def states_of(conditions: Conditions) -> Iterator[tuple[str, str]]:
    """The name of each lane and its state; an empty state is not known."""
    yield "program", conditions.program or "none"
    if conditions.error:
        number = "set" if conditions.error == UNREAD else conditions.error_name.removeprefix("error")
        yield "error", f"{number} {conditions.error_text}".strip()
    else:
        yield "error", "none"
    for lamp in conditions.lamps:
        if lamp.function.isdecimal():
            continue  # an analogue input, whose value can be plotted
        kind = "output" if lamp.output else "input"
        function = lamp.function.replace("+", " plus").replace("-", " minus").split()
        yield "-".join((kind, lamp.name, *function)), ON[lamp.on]


STATES, SPARING = 1.0, 2.0
"""Seconds between two readings of states on a bus, of one drive after the other; the second where all that the line
carries is asked for: a reading takes the time of four samples."""


async def begin(
    workspace: Session, target: PlotTarget, series: Sequence[Series], options: PlotOptions = USUAL_OPTIONS
) -> tuple[RunningPlot, Plot]:
    """Begin to plot drives and values."""
    if not series:
        raise Diagnostic("no drive to plot", hint="/open URL opens a line of drives")
    plot = await Plot.open(target, clock=workspace.now, wall=workspace.wall)
    detach = attach(workspace, plot, series, options.period)

    async def end() -> str:
        if running in workspace.plots:
            workspace.plots.remove(running)
        detach()
        return await plot.close()

    where = plot.target.text
    running = RunningPlot(where, plot.target.desk, f"rerun {where}", options.shown, plot.target.about, end)
    workspace.plots.append(running)
    if target.serves and exposed(target.host):
        workspace.notify(f"other computers can read the plot at {target.text}; they need no password", warning=True)
    return running, plot


def attach(workspace: Session, plot: Plot, series: Sequence[Series], period: float = MODEST) -> Callable[[], None]:
    """Feed the plot: poll drives and values every `period` s, and log the lines of their buses.

    The function returned ends the polling; so does the end of the plot. Raises Diagnostic for a bus that is not open.
    """
    for each in series:
        if each.bus not in workspace.buses:
            raise Diagnostic(f"no bus {each.bus!r}", hint=f"open: {', '.join(workspace.buses) or 'none'}")
    wanted, buses = set(series), {each.bus for each in series}
    for bus, address, _ in series:
        plot.label(bus, address, workspace.buses[bus].drives[address].label)
    ends: list[Callable[[], None]] = [
        workspace.subscribe(partial(_take, workspace, plot, wanted, buses), *OF_BUSES, *OF_TWINS, *OF_LINES)
    ]
    for bus in sorted(buses):
        ends += _polls(
            workspace.buses[bus].telemetry, [each for each in dict.fromkeys(series) if each.bus == bus], period
        )

    def detach() -> None:
        while ends:
            ends.pop()()

    def failed(reason: str) -> None:
        detach()
        workspace.notify(reason, warning=True)

    plot.on_failure(failed)
    return detach


OF_BUSES = Sample, Valued, Conditioned, Lost, Unsolicited
OF_TWINS = events.Predicted, events.Diverged, events.Agreed, events.TwinEnded
OF_LINES = events.Entered, events.Printed, events.Failed, events.Notified


def _take(workspace: Session, plot: Plot, wanted: set[Series], buses: set[str], event: events.SessionEvent) -> None:
    if not isinstance(event, events.OnBus):
        return _log(plot, buses, event)
    bus, inner = event
    if isinstance(inner, events.TwinEvent):
        return _twin(plot, wanted, bus, inner)
    if isinstance(inner, Sample) and Series(bus, inner.address) in wanted:
        plot.sample(bus, inner)
        if workspace.scaled:
            _also_in_units(workspace, plot, bus, inner)
    elif isinstance(inner, Valued) and Series(bus, inner.address, inner.word) in wanted:
        plot.value(bus, inner)
    elif isinstance(inner, Conditioned) and Series(bus, inner.address) in wanted:
        for condition in inner.conditions:
            for name, state in states_of(condition):
                plot.state(bus, inner.address, condition.axis, name, inner.at, state)
    elif isinstance(inner, Lost) and bus in buses:
        plot.gap(bus, inner.at)
    elif isinstance(inner, Unsolicited) and bus in buses:
        for text in inner.lines:
            plot.text(bus, "", inner.at, text, "reply")


def _also_in_units(workspace: Session, plot: Plot, bus: str, sample: Sample) -> None:
    quantities = list(_in_units(workspace, bus, sample))
    for quantity in quantities:
        plot.in_units(bus, sample, *quantity)
    if not quantities:
        plot.not_in_units(bus, sample)


def _in_units(workspace: Session, bus: str, sample: Sample) -> Iterator[tuple[str, float, str]]:
    """Position and velocity of a sample in units; nothing of an axis without a scale."""
    drive = workspace.buses[bus].drives.get(sample.address)
    for word, number, takes in (
        ("position", sample.position, Takes.PLACE),
        ("velocity", sample.velocity, Takes.VELOCITY),
    ):
        given = workspace.units.given(drive, sample.axis, number, takes) if drive is not None else None
        if given is not None:
            yield word, given[0], given[1].rstrip("?")


def _polls(telemetry: Telemetry, series: Sequence[Series], period: float) -> Iterator[Callable[[], None]]:
    """Begin to poll drives and values of a bus; the functions that end that."""
    if addresses := list(dict.fromkeys(each.address for each in series if each.of_motion)):
        yield telemetry.subscribe(addresses, period).close
        if period:
            yield telemetry.watch(addresses, len(addresses) * STATES).close
        else:
            yield from _sparing(telemetry, addresses)
    if values := [DriveValue(each.address, each.word) for each in series if not each.of_motion]:
        yield telemetry.read(values, max(period, READ_PERIOD)).close


def _sparing(telemetry: Telemetry, addresses: Sequence[str]) -> Iterator[Callable[[], None]]:
    """Begin to read the states of one drive after the other, as a first reading takes the time of many samples."""
    loop, pause = asyncio.get_running_loop(), SPARING * len(addresses)
    watches: list[Subscription[str]] = []
    for place, address in enumerate(addresses, 1):
        yield loop.call_later(
            place * SPARING, lambda each: watches.append(telemetry.watch([each], pause)), address
        ).cancel

    def close() -> None:
        for watch in watches:
            watch.close()

    yield close


def _twin(plot: Plot, wanted: set[Series], bus: str, event: events.TwinEvent) -> None:
    whole = Series(bus, event.address) in wanted
    if not whole and Series(bus, event.address, DIFFERENCE) not in wanted:
        return
    if isinstance(event, events.Predicted):
        plot.predicted(bus, event, alone=not whole)
    elif isinstance(event, events.TwinEnded):
        plot.twin_ended(bus, event.address, event.at)
    else:
        said = DIFFERS if isinstance(event, events.Diverged) else AGREES
        plot.state(bus, event.address, event.axis, TWIN, event.at, said)


def _log(plot: Plot, buses: set[str], event: events.SessionEvent) -> None:
    """Log an event of these buses, or of no bus (a verb)."""
    if not isinstance(event, OF_LINES) or event.bus not in {
        *buses,
        "",
    }:
        return
    if isinstance(event, events.Entered):
        plot.text(event.bus, event.address, event.at, event.line, "command")
    elif isinstance(event, events.Printed):
        plot.text(event.bus, event.address, event.at, event.text, "reply")
    elif isinstance(event, events.Failed):
        plot.text(event.bus, event.address, event.at, event.text, "error")
    else:
        plot.text(event.bus, "", event.at, event.text, "note")
