"""The blocking half of a plot: all calls of rerun, which is imported with the first plot, and the views in the viewer.

Five properties of rerun shaped this file. It writes on the screen unless that is turned off before its import. A failed
write shows at the next flush. A client waits for seconds where nothing listens. It waits forever for a frozen viewer.
For a table at the end of a file it keeps a row for each chunk in memory; our files have no such table. Only threads
that a caller may abandon call this module, never the event loop.

The views show velocities, positions, values, states, and the log of commands and replies; their time axes are linked. A
view of one drive bears its name, and has no legend that could cover a curve, unless it has a twin. A twin's position
and velocity share the charts of its drive; the difference has a chart of its own.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import warnings
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.files import why
from multidrop.features.plot_files.file import APPLICATION, FLUSH, SESSION_GAP, RecordingFile, SinkBroken
from multidrop.features.plot_files.request import PlotTarget, bracketed
from multidrop.shell.plots.batch import TWIN, UNITS, Batch, PlottedCurve, StateLane
from multidrop.shell.roles import DIFFERENCE
from multidrop.transports import Unreachable

RUNS, AGREES, DIFFERS = "runs", "agrees", "differs"
"""The states of a twin: it runs, it agrees with its drive again, or the two differ."""
STATE = "state"
"""The part of a path after which the name of a lane of states follows."""
COLOURS = {"command": 0x2F8FD0FF, "reply": 0x808A90FF, "error": 0xE04848FF, "note": 0xB07D10FF}
"""The colour of a log line, by level; each can be read on a dark and on a light ground."""
LINE_COLOURS = (0x3FA0E0FF, 0x009E73FF, 0xCC79A7FF, 0xD08C00FF, 0x7A6FD0FF, 0x808A90FF, 0x40B0A8FF, 0xA07850FF)
"""The colours of drives, which people with any colour vision can tell apart. None is that of an error."""
SHADES = {
    "on": 0x3FA0E0FF,
    "off": 0x80808050,
    "none": 0x80808050,
    RUNS: 0x80808050,
    AGREES: 0x80808050,
    DIFFERS: 0xE04848FF,
}
"""The colours of states that need no attention, and of what is on; the viewer chooses those of others."""
BAND, PALE = 4.0, 0x70
"""The width of a twin's line, and its opacity: a pale band in the colour of its drive, whose thin line lies in it."""
SIDE_BY_SIDE = 4
"""The greatest number of drives that open with views of their own."""


def layout(paths: Set[str], names: Mapping[str, str]) -> Any:
    """The views of these entities, one below the other; `names` are those of drives, by their paths."""
    import rerun.blueprint as rrb

    rows: list[Any] = [_charts(rrb, paths, names)] if _curves(paths) else []
    if lanes := sorted(path for path in paths if is_state(path)):
        rows.append(
            rrb.StateTimelineView(name="programs, errors, inputs, outputs", contents=lanes, time_view=_linked(rrb))
        )
    log = sorted(path for path in paths if path.rpartition("/")[2] == "log")
    rows.append(rrb.TextLogView(name="commands and replies", contents=log))
    shares = [4.0, 1.5, 1.0] if len(rows) == 3 else [4.0, 1.0][-len(rows) :]
    return rrb.Blueprint(
        rrb.Vertical(*rows, row_shares=shares),
        rrb.TimePanel(state="collapsed", timeline="elapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )


def _charts(rrb: Any, paths: Set[str], names: Mapping[str, str]) -> Any:
    drives = drives_of(paths)
    if len(drives) == 1:
        return _column(rrb, _curves(paths), names.get(drives[0], drives[0]))
    together = _column(rrb, _curves(paths), "")
    column = [
        _column(rrb, [path for path in _curves(paths) if _drive(path) == drive], names.get(drive, drive))
        for drive in drives
    ]
    beside = rrb.Horizontal(*column, name="each drive")
    few = len(drives) <= SIDE_BY_SIDE
    return rrb.Tabs(beside, together, active_tab=0 if few else 1)


def _column(rrb: Any, curves: Iterable[str], drive: str) -> Any:
    """One chart for each quantity, one below the other; `drive` names the only one, or is empty."""
    words: dict[str, list[str]] = {word: [] for word in UNITS}
    for path in sorted(curves):
        words.setdefault(path.rpartition("/")[2], []).append(path)
    charts = [
        rrb.TimeSeriesView(
            name=" ".join(filter(None, (drive.lstrip("/"), word, f"({UNITS[word]})" if word in UNITS else ""))),
            contents=found,
            axis_x=_linked(rrb),
            plot_legend=rrb.PlotLegend(visible=not drive or len(found) > 1),
        )
        for word, found in words.items()
        if found
    ]
    return rrb.Vertical(*charts, name=drive.lstrip("/") or "all drives together")


def _linked(rrb: Any) -> Any:
    return rrb.TimeAxis(link="LinkToGlobal")


def is_state(path: str) -> bool:
    return path.split("/")[-2:-1] == [STATE]


def _curves(paths: Set[str]) -> list[str]:
    return sorted(path for path in paths if not is_state(path) and path.rpartition("/")[2] != "log")


def _drive(path: str) -> str:
    parent = path.rpartition("/")[0]
    return parent.removesuffix(f"/{TWIN}") or parent  # a line of drives may have that name


def drives_of(paths: Set[str]) -> list[str]:
    return sorted({_drive(path) for path in _curves(paths)})


def entity_path(rr: Any, *parts: str) -> str:
    """The path of an entity from its parts; empty parts are left out."""
    return str(rr.new_entity_path([part for part in parts if part]))


_INSTALL = "pip install 'multidrop[rerun]'"


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
        self.target = _numeric(target) if target.serves else target
        """The target, with the port that is in use."""
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
        if self.target.serves and (served := _SERVED.pop((self.target.host, self.target.port), None)) is not None:
            # The recording that an earlier plot of this process serves at this port goes on.
            self._recording, self._paths, self._drives, self.offset = served
            return
        identity = (self._file and self._file.identity) or secrets.token_hex(16)
        self._recording = self._rr.RecordingStream(APPLICATION, recording_id=identity)
        try:
            self._recording.set_sinks(self._make_sink())
            self._recording.flush(timeout_sec=FLUSH)
        except (RuntimeError, ValueError) as error:
            if self.target.url:
                self.leave_behind()
            if self._file:
                self._file.release()
            raise Diagnostic(f"cannot plot to {target.text}: {error}") from None
        if self._file:
            self._file.mark()

    def _make_sink(self) -> Any:
        if self._file:
            return self._rr.FileSink(str(self._file.writes), write_footer=False)
        if self.target.url:
            # Check that a viewer listens: rerun's client would wait for seconds, and again on close.
            try:
                socket.create_connection((self.target.host, self.target.port), timeout=3.0).close()
            except (OSError, UnicodeError) as error:
                raise Unreachable(f"no viewer at {self.target.url} ({why(error)}); start `rerun` there first") from None
            return self._rr.GrpcSink(self.target.url)
        self.target = _free(self.target)
        return self._rr.GrpcServerSink(self.target.host, self.target.port, server_memory_limit="64MiB")

    def send(self, batch: Batch) -> None:
        """Write a batch and flush it. Raises SinkBroken."""
        try:
            self._describe(batch)
            for curve, rows in batch.curves.items():
                self._columns(curve.place, rows, self._rr.Scalars.columns(scalars=[row[2] for row in rows]))
            for bus, texts in batch.texts.items():
                columns = self._rr.TextLog.columns(
                    text=[row[2] for row in texts],
                    level=[row[3].upper() for row in texts],
                    color=[COLOURS[row[3]] for row in texts],
                )
                self._columns((bus, "log"), texts, columns)
            for curve, gaps in batch.gaps.items():
                for elapsed, wall in gaps:
                    self._recording.set_time("elapsed", duration=elapsed)
                    self._recording.set_time("time", timestamp=wall)
                    self._recording.log(
                        entity_path(self._rr, *curve.place), self._rr.Clear(recursive=False), strict=True
                    )
                self._recording.reset_time()
            for state, changes in batch.states.items():
                columns = self._rr.StateChange.columns(state=[row[2] for row in changes])
                self._columns(_place(state), changes, columns)
            self._recording.flush(timeout_sec=FLUSH)
        except (RuntimeError, OSError) as error:
            raise SinkBroken(self.why(error)) from None
        if self._file:
            self._file.mark()

    def close(self) -> None:
        """Flush and close; a served recording stays visible. Raises SinkBroken."""
        try:
            self._recording.flush(timeout_sec=FLUSH)
            if self.target.serves:
                served = self._recording, self._paths, self._drives, self._end + SESSION_GAP
                _SERVED[self.target.host, self.target.port] = served
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
        if self._file:
            return self._file.why(error)
        return f"the viewer at {self.target.text} is gone" if self.target.url else f"cannot serve: {error}"

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
                unit = f"({curve.shown_unit})" if curve.shown_unit else ""
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

    def _colour(self, curve: PlottedCurve) -> int:
        """The colour of a drive's axis, the same in every view; those that a file has already keep theirs."""
        return LINE_COLOURS[self._number(entity_path(self._rr, *curve.drive)) % len(LINE_COLOURS)]

    def _number(self, drive: str) -> int:
        if drive not in self._drives:
            self._drives.append(drive)
        return self._drives.index(drive)

    def _layout(self) -> Any:
        return layout(self._paths, self._names)

    def _columns(self, place: tuple[str, ...], rows: Sequence[tuple[Any, ...]], values: Any) -> None:
        """Send the values of an entity; each row begins with its two times."""
        elapsed, wall = [row[0] for row in rows], [row[1] for row in rows]
        self._end = max(self._end, *elapsed)
        column = self._rr.TimeColumn
        times = [column("elapsed", duration=elapsed), column("time", timestamp=wall)]
        self._recording.send_columns(entity_path(self._rr, *place), times, values, strict=True)


def _place(state: StateLane) -> tuple[str, ...]:
    return (*state[:3], STATE, state.name)


_LEFT: list[Any] = []
"""Broken recordings: deleting one may block."""
_SERVED: dict[tuple[str, int], tuple[Any, set[str], list[str], float]] = {}
"""Served recordings without a plot: recording, entities, drives, the next `elapsed`. A server keeps its port while a
viewer is connected, so it stays, and the next plot at that port continues it."""


def _numeric(target: PlotTarget) -> PlotTarget:
    try:
        addresses = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        raise _unserved(target, error) from None
    return replace(target, host=str(addresses[0][4][0]))


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
