"""The blocking half of a plot: all calls of rerun, which is imported with the first plot.

Five properties of rerun shaped this file. It writes on the screen unless that is turned off before its import. A failed
write shows at the next flush. A client waits for seconds where nothing listens. It waits forever for a frozen viewer.
For a table at the end of a file it keeps a row for each chunk in memory; our files have no such table. Only threads
that a caller may abandon call this module, never the event loop.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import warnings
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import why
from multidrop.shell.plots.file import APPLICATION, FLUSH, GAP, RecordingFile, SinkBroken
from multidrop.shell.plots.layout import (
    BAND,
    COLOURS,
    LINES,
    PALE,
    SHADES,
    STATE,
    TWIN,
    UNITS,
    drives_of,
    entity_path,
    is_state,
    layout,
)
from multidrop.shell.plots.target import PlotTarget, bracketed
from multidrop.shell.roles import DIFFERENCE
from multidrop.transports import Unreachable

_INSTALL = "pip install 'multidrop[rerun]'"


class Curve(NamedTuple):
    """One curve: `axis` is empty for a drive with one axis, `word` is `position`, `velocity` or a word of the drive.

    `twin`: of its twin.
    """

    bus: str
    address: str
    axis: str
    word: str
    twin: bool = False

    @property
    def place(self) -> tuple[str, ...]:
        """The parts of its path."""
        return (*self[:3], *(TWIN,) * self.twin, self.word)

    @property
    def drive(self) -> tuple[str, ...]:
        """The parts that name the drive's axis; one colour belongs to them."""
        return tuple(part for part in self[:3] if part)


class State(NamedTuple):
    """One lane of states: a program, an error, an input or an output."""

    bus: str
    address: str
    axis: str
    name: str


@dataclass
class Batch:
    """The samples and texts since the last flush; times are (elapsed, s; wall clock, s since 1970)."""

    curves: dict[Curve, list[tuple[float, float, float]]] = field(default_factory=dict)
    texts: dict[str, list[tuple[float, float, str, str]]] = field(default_factory=dict)
    gaps: dict[Curve, list[tuple[float, float]]] = field(default_factory=dict)
    """Times at which a curve ends; the next sample begins it again."""
    states: dict[State, list[tuple[float, float, str]]] = field(default_factory=dict)
    """Changes of state; an empty one is not known."""
    labels: dict[tuple[str, str], str] = field(default_factory=dict)
    """Drives that begin to be plotted, in order, with the names that people gave to them."""

    def __bool__(self) -> bool:
        """Whether the batch has content."""
        return bool(self.curves or self.texts or self.gaps or self.states or self.labels)


def load() -> Any:
    """Import rerun without its output on the screen. Raises Diagnostic if it is missing or too old."""
    os.environ["RUST_LOG"] = "off"
    try:
        import rerun
        from rerun.error_utils import RerunWarning
    except ModuleNotFoundError:
        raise Diagnostic("plots need rerun, which is not installed", hint=_INSTALL) from None
    except ImportError as error:
        raise Diagnostic(f"plots need rerun, which does not load here: {error}") from None
    if not hasattr(rerun, "GrpcServerSink"):
        raise Diagnostic("plots need a newer version of rerun", hint=_INSTALL)
    warnings.filterwarnings("ignore", category=RerunWarning)
    return rerun


class Sink:
    """An open recording. Every method may block; one thread at a time."""

    def __init__(self, target: PlotTarget) -> None:
        """Open the target. Raises Diagnostic if that fails, and leaves the target unchanged then."""
        self._rr = load()
        self._target = _numeric(target) if target.serves else target
        self._file = None if target.file is None else RecordingFile(self._rr, target.file)
        self._paths: set[str] = set(self._file.paths) if self._file else set()
        self._drives = drives_of(self._paths)
        """The axes of drives that have a colour, in its order."""
        self._names: dict[str, str] = {}
        """The names of drives, by their paths."""
        self._end = 0.0
        """The last `elapsed` sent."""
        self.offset = self._file.offset if self._file else 0.0
        """The first `elapsed`, s: after the samples that exist already."""
        if self._target.serves and self._go_on_serving():
            return
        identity = (self._file and self._file.identity) or secrets.token_hex(16)
        self._recording = self._rr.RecordingStream(APPLICATION, recording_id=identity)
        try:
            self._recording.set_sinks(self._make_sink())
            self._recording.flush(timeout_sec=FLUSH)
        except (RuntimeError, ValueError) as error:
            self._give_up()
            raise Diagnostic(f"cannot plot to {target.text}: {error}") from None
        if self._file:
            self._file.mark()

    @property
    def target(self) -> PlotTarget:
        """The target, with the port that is in use."""
        return self._target

    def _make_sink(self) -> Any:
        if self._file:
            return self._rr.FileSink(str(self._file.writes), write_footer=False)
        if self._target.url:
            _probe(self._target)
            return self._rr.GrpcSink(self._target.url)
        self._target = _free(self._target)
        return self._rr.GrpcServerSink(self._target.host, self._target.port, server_memory_limit="64MiB")

    def _go_on_serving(self) -> bool:
        """Continue the recording that an earlier plot of this process serves at this port; False if there is none."""
        served = _SERVED.pop((self._target.host, self._target.port), None)
        if served is not None:
            self._recording, self._paths, self._drives, self.offset = served
        return served is not None

    def _give_up(self) -> None:
        if self._target.url:
            self.leave_behind()
        if self._file:
            self._file.release()

    def send(self, batch: Batch) -> None:
        """Write a batch and flush it. Raises SinkBroken."""
        try:
            self._describe(batch)
            for curve, rows in batch.curves.items():
                self._send_samples(curve, rows)
            for bus, texts in batch.texts.items():
                self._send_texts(bus, texts)
            for curve, gaps in batch.gaps.items():
                self._send_gaps(curve, gaps)
            for state, changes in batch.states.items():
                self._send_states(state, changes)
            self._recording.flush(timeout_sec=FLUSH)
        except (RuntimeError, OSError) as error:
            raise SinkBroken(self.why(error)) from None
        if self._file:
            self._file.mark()

    def close(self) -> None:
        """Flush and close; a served recording stays visible. Raises SinkBroken."""
        try:
            self._recording.flush(timeout_sec=FLUSH)
            if self._target.serves:
                _SERVED[self._target.host, self._target.port] = (
                    self._recording,
                    self._paths,
                    self._drives,
                    self._end + GAP,
                )
                return
            self._recording.disconnect()
        except RuntimeError as error:
            raise SinkBroken(self.why(error)) from None
        if self._file:
            self._file.finish(self._layout())

    def abandon(self) -> None:
        """Disconnect a broken recording, after `leave_behind`. May block forever."""
        with contextlib.suppress(RuntimeError):
            self._recording.disconnect()
        _LEFT.remove(self._recording)

    def leave_behind(self) -> None:
        """Keep a broken recording alive: neither its deletion nor rerun's own end may block this process."""
        self._rr.unregister_shutdown()
        _LEFT.append(self._recording)

    def let_go(self) -> None:
        """Release the file, which keeps all flushed samples."""
        if self._file:
            self._file.cut()

    def why(self, error: Exception) -> str:
        """The error in one line."""
        if self._file:
            return self._file.why(error)
        return f"the viewer at {self._target.text} is gone" if self._target.url else f"cannot serve: {error}"

    def _describe(self, batch: Batch) -> None:
        """Name what is new, give each drive its colour, and lay out the views again if there is anything new."""
        for drive, label in batch.labels.items():
            path = entity_path(self._rr, *drive)
            self._names[path] = f"{':'.join(filter(None, drive))} {label}".strip()
            self._number(path)
        new = {entity_path(self._rr, bus, "log") for bus in batch.texts}
        new |= {entity_path(self._rr, *_place(state)) for state in batch.states}
        new -= self._paths
        for path in sorted(new):
            if is_state(path):
                shades = self._rr.StateConfiguration(values=list(SHADES), colors=list(SHADES.values()))
                self._recording.log(path, shades, static=True, strict=True)
        for curve in batch.curves:
            path = entity_path(self._rr, *curve.place)
            if path not in self._paths:
                new.add(path)
                unit = f"({UNITS[curve.word]})" if curve.word in UNITS else ""
                named = self._names.get(entity_path(self._rr, *curve[:2]), " ".join(curve.drive[:2]))
                predicted = curve.twin and curve.word != DIFFERENCE
                name = " ".join((named, curve.axis, TWIN if predicted else "", curve.word, unit))
                colour = self._colour(curve) & ~0xFF | PALE if predicted else self._colour(curve)
                width = BAND if predicted else 1.5
                lines = self._rr.SeriesLines(names=" ".join(name.split()), colors=colour, widths=width)
                self._recording.log(path, lines, static=True, strict=True)
        if new:
            self._paths |= new
            self._recording.send_blueprint(self._layout())

    def _colour(self, curve: Curve) -> int:
        """The colour of a drive's axis, the same in every view; those that a file has already keep theirs."""
        return LINES[self._number(entity_path(self._rr, *curve.drive)) % len(LINES)]

    def _number(self, drive: str) -> int:
        """The number of a drive's axis by its path."""
        if drive not in self._drives:
            self._drives.append(drive)
        return self._drives.index(drive)

    def _layout(self) -> Any:
        return layout(self._paths, self._names)

    def _send_samples(self, curve: Curve, rows: list[tuple[float, float, float]]) -> None:
        times = self._times([row[0] for row in rows], [row[1] for row in rows])
        values = self._rr.Scalars.columns(scalars=[row[2] for row in rows])
        self._recording.send_columns(entity_path(self._rr, *curve.place), times, values, strict=True)

    def _send_gaps(self, curve: Curve, gaps: list[tuple[float, float]]) -> None:
        for elapsed, wall in gaps:
            self._recording.set_time("elapsed", duration=elapsed)
            self._recording.set_time("time", timestamp=wall)
            self._recording.log(entity_path(self._rr, *curve.place), self._rr.Clear(recursive=False), strict=True)
        self._recording.reset_time()

    def _send_states(self, state: State, rows: list[tuple[float, float, str]]) -> None:
        times = self._times([row[0] for row in rows], [row[1] for row in rows])
        changes = self._rr.StateChange.columns(state=[row[2] for row in rows])
        self._recording.send_columns(entity_path(self._rr, *_place(state)), times, changes, strict=True)

    def _send_texts(self, bus: str, rows: list[tuple[float, float, str, str]]) -> None:
        times = self._times([row[0] for row in rows], [row[1] for row in rows])
        columns = self._rr.TextLog.columns(
            text=[row[2] for row in rows],
            level=[row[3].upper() for row in rows],
            color=[COLOURS[row[3]] for row in rows],
        )
        self._recording.send_columns(entity_path(self._rr, bus, "log"), times, columns, strict=True)

    def _times(self, elapsed: list[float], wall: list[float]) -> list[Any]:
        columns = self._rr.TimeColumn
        self._end = max(self._end, *elapsed)
        return [columns("elapsed", duration=elapsed), columns("time", timestamp=wall)]


def _place(state: State) -> tuple[str, ...]:
    """The parts of the path of a lane."""
    return (*state[:3], STATE, state.name)


_LEFT: list[Any] = []
"""Broken recordings: deleting one may block."""
_SERVED: dict[tuple[str, int], tuple[Any, set[str], list[str], float]] = {}
"""Served recordings without a plot: recording, entities, drives, the next `elapsed`. A server keeps its port while a
viewer is connected, so it stays, and the next plot at that port continues it."""


def _numeric(target: PlotTarget) -> PlotTarget:
    """The numeric address to serve at."""
    try:
        found = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        raise _unserved(target, error) from None
    return replace(target, host=str(found[0][4][0]))


def _free(target: PlotTarget) -> PlotTarget:
    """The address with a port that is free now: rerun would only log that it is not."""
    family = socket.AF_INET6 if ":" in target.host else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((target.host, target.port))
            return replace(target, port=int(trial.getsockname()[1]))
    except OSError as error:
        raise _unserved(target, error) from None


def _unserved(target: PlotTarget, error: OSError | UnicodeError) -> Diagnostic:
    where = f"{bracketed(target.host)}:{target.port}"
    if isinstance(error, UnicodeError):
        return Diagnostic(f"cannot serve at {where}: that is not a host name", hint="valid: PORT or HOST:PORT, as 9876")
    return Diagnostic(
        f"cannot serve at {where} ({error.strerror})", hint="use another port, or end the program that uses it"
    )


def _probe(target: PlotTarget) -> None:
    """Check that a viewer listens: rerun's client would wait for seconds, and again on close."""
    try:
        socket.create_connection((target.host, target.port), timeout=3.0).close()
    except (OSError, UnicodeError) as error:
        raise Unreachable(f"no viewer at {target.url} ({why(error)}); start `rerun` there first") from None
