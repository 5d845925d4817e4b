"""A plot of positions and velocities to rerun, with commands and replies as a text log on the same timelines.

Theory of operation. A plot takes samples and texts at almost no cost. A thread passes them on in batches. A killed
process loses at most half a second, and a frozen viewer delays nothing. There are two timelines: `elapsed` (s since the
plot began; it continues where an existing file ended) and `time` (the wall clock).
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from datetime import datetime

from multidrop.dialects import Diagnostic
from multidrop.drives.events import Sample, Valued
from multidrop.shell.events import Predicted
from multidrop.shell.plots.file import SinkBroken
from multidrop.shell.plots.layout import COLOURS, RUNS, TWIN
from multidrop.shell.plots.sink import Batch, Curve, Sink, State
from multidrop.shell.plots.target import PlotTarget
from multidrop.shell.roles import DIFFERENCE
from multidrop.shell.threads import in_thread

FILE_PERIOD, LIVE_PERIOD = 0.4, 0.1
"""The time between batches, s: longer makes a smaller file, shorter a smoother view."""
BATCH_TIMEOUT = 8.0
"""The time to take a batch, s, after which the sink counts as frozen."""
FILE_TIMEOUT = 120.0
"""The time to read and rewrite an existing file, s."""
ABANDON_TIMEOUT = 2.0
"""The time to disconnect a broken sink, s."""


class Plot:
    """An open plot. `open` makes one, `close` ends it; it ends by itself when its sink breaks."""

    def __init__(self, sink: Sink, clock: Callable[[], float], wall: Callable[[float], datetime]) -> None:
        """Use `open`."""
        self._sink, self._wall = sink, wall
        self._clock = clock
        self._begin = clock() - sink.offset
        self._epoch = self._at_zero()
        self._batch = Batch()
        self._curves: set[Curve] = set()
        """The curves that have samples."""
        self._states: dict[State, str] = {}
        """The last state of each lane."""
        self._closing = asyncio.Event()
        self._on_failure: list[Callable[[str], None]] = []
        self.target = sink.target
        """The target, with the port that is in use."""
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
            sink = await in_thread(lambda: Sink(target), _timeout(target))
        except TimeoutError:
            raise Diagnostic(f"cannot plot to {target.text}: it does not respond") from None
        return cls(sink, clock, wall)

    def on_failure(self, callback: Callable[[str], None]) -> None:
        """Call back once, with one line for a person, if the plot ends by itself."""
        self._on_failure.append(callback)

    def label(self, bus: str, address: str, label: str) -> None:
        """Note the name that a person gave to a drive, before its first sample."""
        self._batch.labels[bus, address] = label

    def sample(self, bus: str, sample: Sample) -> None:
        """Take a sample. Never blocks."""
        if not self._done:
            self.samples += 1
            drive = (bus, sample.address, sample.axis)
            self._point(Curve(*drive, "position"), sample.at, sample.position)
            self._point(Curve(*drive, "velocity"), sample.at, sample.velocity)

    def value(self, bus: str, read: Valued) -> None:
        """Take a value. Never blocks."""
        if not self._done:
            self.samples += 1
            self._point(Curve(bus, read.address, "", read.word), read.at, read.value)

    def predicted(self, bus: str, twin: Predicted, *, alone: bool = False) -> None:
        """Take a prediction of a drive's twin; `alone`: the difference only. Never blocks."""
        if not self._done:
            self.samples += alone
            drive = (bus, twin.address, twin.axis)
            for word, value in [("position", twin.position), ("velocity", twin.velocity)] if not alone else []:
                self._point(Curve(*drive, word, twin=True), twin.at, value)
            self._point(Curve(*drive, DIFFERENCE, twin=True), twin.at, twin.difference)
            if self._states.get(State(*drive, TWIN), "") == "":
                self.state(*drive, TWIN, twin.at, RUNS)

    def twin_ended(self, bus: str, address: str, at: float) -> None:
        """End the curves of a twin. Never blocks."""
        for curve in self._curves if not self._done else ():
            if curve.twin and curve[:2] == (bus, address):
                self._batch.gaps.setdefault(curve, []).append(self._times(at))
        for lane in list(self._states):
            if (*lane[:2], lane.name) == (bus, address, TWIN):
                self.state(*lane, at, "")

    def _point(self, curve: Curve, at: float, value: float) -> None:
        self._curves.add(curve)
        self._batch.curves.setdefault(curve, []).append((*self._times(at), float(value)))

    def state(self, bus: str, address: str, axis: str, name: str, at: float, text: str) -> None:
        """Take a state; one that has not changed takes no room. Never blocks."""
        lane = State(bus, address, axis, name)
        if not self._done and self._states.get(lane) != text:
            self._states[lane] = text
            self._batch.states.setdefault(lane, []).append((*self._times(at), text))

    def gap(self, bus: str, at: float) -> None:
        """End the curves of a bus that is lost; their next samples begin them again. Never blocks."""
        for curve in self._curves if not self._done else ():
            if curve.bus == bus:
                self._batch.gaps.setdefault(curve, []).append(self._times(at))
        for lane in list(self._states):
            if lane.bus == bus:
                self.state(*lane, at, "")

    def text(self, bus: str, address: str, at: float, text: str, level: str) -> None:
        """Take a line of text; `level` is `command`, `reply`, `error` or `note`. Never blocks."""
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
        return f"{self.samples} samples in {self.target.text}"

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
            await self._break(error)
        finally:
            self.ended.set()

    async def _flush(self) -> None:
        batch, self._batch, self._epoch = self._batch, Batch(), self._at_zero()
        if batch:
            await in_thread(lambda: self._sink.send(batch), BATCH_TIMEOUT)

    async def _break(self, error: SinkBroken | TimeoutError) -> None:
        reason = str(error) if isinstance(error, SinkBroken) else self._sink.why(error)
        self.failure = f"plotting ended: {reason}"
        self._batch = Batch()
        self._sink.leave_behind()
        for callback in self._on_failure:
            callback(self.failure)
        with contextlib.suppress(TimeoutError):
            await in_thread(self._sink.abandon, ABANDON_TIMEOUT)
        self._sink.let_go()


def _timeout(target: PlotTarget) -> float:
    return BATCH_TIMEOUT if target.file is None else FILE_TIMEOUT
