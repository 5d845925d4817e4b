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
from typing import Any

from dialects import Diagnostic
from dialects.files import why
from shell.plots.file import APPLICATION, FLUSH, GAP, RecordingFile, SinkBroken
from shell.plots.layout import COLOURS, QUANTITIES, entity_path, layout
from shell.plots.target import PlotTarget, bracketed
from transports import Unreachable

_INSTALL = "pip install 'multidrop[rerun]'"

Series = tuple[str, str, str]
"""Bus, address, axis (empty for a drive with one axis)."""


@dataclass
class Batch:
    """The samples and texts since the last flush; times are (elapsed, s; wall clock, s since 1970)."""

    samples: dict[Series, list[tuple[float, float, int, int]]] = field(default_factory=dict)
    texts: dict[str, list[tuple[float, float, str, str]]] = field(default_factory=dict)
    gaps: dict[Series, list[tuple[float, float]]] = field(default_factory=dict)
    """Times at which a curve ends; the next sample begins it again."""

    def __bool__(self) -> bool:
        """Whether the batch has content."""
        return bool(self.samples or self.texts or self.gaps)


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
            self._recording, self._paths, self.offset = served
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
            for series, rows in batch.samples.items():
                self._send_samples(series, rows)
            for bus, texts in batch.texts.items():
                self._send_texts(bus, texts)
            for series, gaps in batch.gaps.items():
                self._send_gaps(series, gaps)
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
                _SERVED[self._target.host, self._target.port] = (self._recording, self._paths, self._end + GAP)
                return
            self._recording.disconnect()
        except RuntimeError as error:
            raise SinkBroken(self.why(error)) from None
        if self._file:
            self._file.finish(layout(self._paths))

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
        """Name the new series, and lay out the views again if there are any."""
        new = {entity_path(self._rr, bus, "log") for bus in batch.texts} - self._paths
        for series in batch.samples:
            for what, unit in QUANTITIES:
                path = entity_path(self._rr, *series, what)
                if path not in self._paths:
                    new.add(path)
                    name = f"{' '.join(part for part in series if part)} {what} ({unit})"
                    self._recording.log(path, self._rr.SeriesLines(names=name), static=True, strict=True)
        if new:
            self._paths |= new
            self._recording.send_blueprint(layout(self._paths))

    def _send_samples(self, series: Series, rows: list[tuple[float, float, int, int]]) -> None:
        times = self._times([row[0] for row in rows], [row[1] for row in rows])
        for what, column in (("position", 2), ("velocity", 3)):
            values = self._rr.Scalars.columns(scalars=[float(row[column]) for row in rows])
            self._recording.send_columns(entity_path(self._rr, *series, what), times, values, strict=True)

    def _send_gaps(self, series: Series, gaps: list[tuple[float, float]]) -> None:
        for elapsed, wall in gaps:
            self._recording.set_time("elapsed", duration=elapsed)
            self._recording.set_time("time", timestamp=wall)
            for what, _ in QUANTITIES:
                self._recording.log(entity_path(self._rr, *series, what), self._rr.Clear(recursive=False), strict=True)
        self._recording.reset_time()

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


_LEFT: list[Any] = []
"""Broken recordings: deleting one may block."""
_SERVED: dict[tuple[str, int], tuple[Any, set[str], float]] = {}
"""Served recordings without a plot: recording, entities, the next `elapsed`. A server keeps its port while a viewer is
connected, so it stays, and the next plot at that port continues it."""


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
        return Diagnostic(f"cannot serve at {where}: that is no host name", hint="valid: PORT or HOST:PORT, as 9876")
    return Diagnostic(
        f"cannot serve at {where} ({error.strerror})", hint="use another port, or end the program that uses it"
    )


def _probe(target: PlotTarget) -> None:
    """Check that a viewer listens: rerun's client would wait for seconds, and again on close."""
    try:
        socket.create_connection((target.host, target.port), timeout=3.0).close()
    except (OSError, UnicodeError) as error:
        raise Unreachable(f"no viewer at {target.url} ({why(error)}); start `rerun` there first") from None
