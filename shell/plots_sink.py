"""The blocking half of a plot: everything that touches rerun, which is imported when the first plot is asked for.

What is known of rerun and shaped this file: it writes on the screen unless it is told not to before its import; a
write that failed shows at the next flush; a client blocks for seconds where nobody listens, and for ever where the
other side froze (so all of this is called from threads that a caller may leave behind); recordings cannot be joined
by joining their files, but their chunks can be copied into a new one.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import sys
import time
import uuid
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dialects import Diagnostic

if sys.platform != "win32":
    import fcntl

APPLICATION = "multidrop"
FLUSH = 5.0
"""Seconds that a flush may take before the other side counts as gone."""
GAP = 1.0
"""Seconds of `elapsed` between what a file held and what is added to it."""
_COLOURS = {"command": 0x4FC3F7FF, "reply": 0xB0BEC5FF, "error": 0xEF5350FF, "note": 0xFFD54FFF}

Series = tuple[str, str, str]
"""Bus, address, axis (empty where a drive has one)."""


class SinkBroken(Exception):
    """What a plot is written to takes no more. One line, for a person."""


@dataclass(frozen=True)
class PlotTarget:
    """Where a plot goes: one of a file, a server of our own, a viewer elsewhere."""

    file: Path | None = None
    host: str = ""
    port: int = 0
    """Served at host:port; 0 takes a free one."""
    url: str = ""
    """A viewer elsewhere: `rerun+http://HOST:PORT/proxy`; `host` and `port` are its."""

    @property
    def serves(self) -> bool:
        """Whether viewers come to us."""
        return self.file is None and not self.url

    @property
    def text(self) -> str:
        """What a person calls it: the file, or the address to open in a viewer."""
        return str(self.file) if self.file else self.url or address_of(self.host, self.port)


@dataclass
class Batch:
    """What came since the last flush: times are (elapsed, s; wall clock, s since 1970)."""

    samples: dict[Series, list[tuple[float, float, int, int]]] = field(default_factory=dict)
    texts: dict[str, list[tuple[float, float, str, str]]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """Whether there is anything."""
        return bool(self.samples or self.texts)


def address_of(host: str, port: int) -> str:
    """The address that a viewer opens."""
    return f"rerun+http://{f'[{host}]' if ':' in host else host}:{port}/proxy"


def load() -> Any:
    """The rerun module, kept off the screen. Raises Diagnostic where it is not installed or too old."""
    os.environ["RUST_LOG"] = "off"
    try:
        import rerun
        from rerun.error_utils import RerunWarning
    except ModuleNotFoundError:
        raise Diagnostic(
            "plots need rerun, which is not installed", hint="pip install 'multidrop[rerun]'"
        ) from None
    except ImportError as error:
        raise Diagnostic(f"rerun does not load here: {error}", hint="plots need it") from None
    if not hasattr(rerun, "GrpcServerSink"):
        raise Diagnostic("the rerun that is installed is another one", hint="pip install 'multidrop[rerun]'")
    warnings.filterwarnings("ignore", category=RerunWarning)
    return rerun


class Sink:
    """An open recording. Not for two threads at once; every method may block."""

    def __init__(self, target: PlotTarget) -> None:
        """Open it. Raises Diagnostic where it cannot be, and touches nothing then."""
        self._rr = load()
        self.target = target
        self.offset = 0.0
        """Where `elapsed` goes on: 0, or after what the file held."""
        self._series: set[Series] = set()
        self._logs: set[str] = set()
        self._file: _File | None = None
        sinks: list[Any] = []
        identity = uuid.uuid4().hex
        if target.file:
            self._file = _File(self._rr, target.file)
            identity, self.offset = self._file.identity or identity, self._file.offset
        self._recording = self._rr.RecordingStream(APPLICATION, recording_id=identity)
        try:
            sinks.append(self._make_sink())
            self._recording.set_sinks(*sinks)
            self._recording.flush(timeout_sec=FLUSH)
        except (RuntimeError, ValueError, OSError) as error:
            self._recording.disconnect()
            if self._file:
                self._file.release()
            raise Diagnostic(f"cannot plot to {target.text}: {error}") from None
        if self._file:
            self._file.began()

    def _make_sink(self) -> Any:
        if self._file:
            return self._rr.FileSink(str(self._file.writes))
        if self.target.serves:
            self.target = _free_address(self.target)
            return self._rr.GrpcServerSink(
                self.target.host, self.target.port, server_memory_limit="64MiB", cors_allow_origin=[]
            )
        _probe(self.target)
        return self._rr.GrpcSink(self.target.url)

    def send(self, batch: Batch) -> None:
        """Write a batch and flush it. Raises SinkBroken."""
        try:
            self._describe(batch)
            for series, rows in batch.samples.items():
                self._send_samples(series, rows)
            for bus, texts in batch.texts.items():
                self._send_texts(bus, texts)
            self._recording.flush(timeout_sec=FLUSH)
        except (RuntimeError, OSError) as error:
            raise SinkBroken(self._why(error)) from None
        if self._file:
            self._file.mark()

    def close(self) -> None:
        """Write what is left and close. Raises SinkBroken, with what was kept where."""
        try:
            self._recording.flush(timeout_sec=FLUSH)
            self._recording.disconnect()
        except RuntimeError as error:
            raise SinkBroken(self._why(error)) from None
        if self._file:
            self._file.finish(self._series, self._logs)

    def abandon(self) -> None:
        """Leave a broken recording: blocks as long as it likes. A file keeps what was flushed."""
        with contextlib.suppress(RuntimeError):
            self._recording.disconnect()
        if self._file:
            self._file.cut()

    def leave_behind(self) -> None:
        """The other side froze, and `abandon` with it: let neither it nor rerun's own end hold up ours."""
        self._rr.unregister_shutdown()
        _LEFT.append(self)

    def _send_samples(self, series: Series, rows: list[tuple[float, float, int, int]]) -> None:
        times = self._times([row[0] for row in rows], [row[1] for row in rows])
        for what, column in (("position", 2), ("velocity", 3)):
            values = self._rr.Scalars.columns(scalars=[float(row[column]) for row in rows])
            self._recording.send_columns(self._path(series, what), times, values, strict=True)

    def _send_texts(self, bus: str, rows: list[tuple[float, float, str, str]]) -> None:
        columns = self._rr.TextLog.columns(
            text=[row[2] for row in rows],
            level=[row[3].upper() for row in rows],
            color=[_COLOURS[row[3]] for row in rows],
        )
        times = self._times([row[0] for row in rows], [row[1] for row in rows])
        self._recording.send_columns(_log_path(self._rr, bus), times, columns, strict=True)

    def _times(self, elapsed: list[float], wall: list[float]) -> list[Any]:
        return [
            self._rr.TimeColumn("elapsed", duration=elapsed),
            self._rr.TimeColumn("time", timestamp=wall),
        ]

    def _path(self, series: Series, what: str) -> str:
        return str(self._rr.new_entity_path([part for part in (*series, what) if part]))

    def _describe(self, batch: Batch) -> None:
        """Name what is new, and lay out the views anew."""
        new = batch.samples.keys() - self._series
        logs = batch.texts.keys() - self._logs
        if not new and not logs:
            return
        self._series |= new
        self._logs |= logs
        for series in sorted(new):
            for what, unit in (("position", "steps"), ("velocity", "steps/s")):
                name = f"{' '.join(part for part in series if part)} {what} ({unit})"
                self._recording.log(self._path(series, what), self._rr.SeriesLines(names=name), static=True)
        self._recording.send_blueprint(layout(self._rr, self._series, self._logs))

    def _why(self, error: Exception) -> str:
        if self._file:
            return self._file.why(error)
        return f"the viewer at {self.target.text} is gone; plotting ended"


_LEFT: list[Sink] = []
"""Recordings whose other side froze: what is never dropped never blocks while it is dropped."""


def layout(rr: Any, series: set[Series], logs: set[str]) -> Any:
    """Positions, velocities and the log, one below the other."""
    import rerun.blueprint as rrb

    def paths(what: str) -> list[str]:
        return [str(rr.new_entity_path([part for part in (*each, what) if part])) for each in sorted(series)]

    return rrb.Blueprint(
        rrb.Vertical(
            rrb.TimeSeriesView(name="position (steps)", contents=paths("position")),
            rrb.TimeSeriesView(name="velocity (steps/s)", contents=paths("velocity")),
            rrb.TextLogView(name="commands and replies", contents=[_log_path(rr, bus) for bus in sorted(logs)]),
            row_shares=[2, 2, 1],
        ),
        rrb.TimePanel(timeline="elapsed", expanded=False),
        collapse_panels=True,
    )


def _log_path(rr: Any, bus: str) -> str:
    return str(rr.new_entity_path([bus, "log"] if bus else ["log"]))


def _free_address(target: PlotTarget) -> PlotTarget:
    """The address to serve at, numeric and seen to be free: rerun only logs that it is not."""
    try:
        found = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, kind, protocol, _, address = found[0]
        with socket.socket(family, kind, protocol) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind(address)
            host, port = trial.getsockname()[:2]
    except OSError as error:
        raise Diagnostic(
            f"cannot serve a plot at {target.host}:{target.port} ({error.strerror or error})",
            hint="take another port, or end what uses it",
        ) from None
    return PlotTarget(host=str(host), port=int(port))


def _probe(target: PlotTarget) -> None:
    """See that somebody listens there: rerun's client would wait for seconds, twice."""
    try:
        socket.create_connection((target.host, target.port), timeout=3).close()
    except OSError as error:
        raise Diagnostic(
            f"no viewer listens at {target.url} ({error.strerror or error})", hint="start `rerun` there first"
        ) from None


class _File:
    """A recording's file: a new one is written in place; what is added to one stands beside it until it is closed.

    `run.rrd` is locked while it is plotted to. Additions go to `run.part.rrd`; at the end both are copied into a new
    file that takes the place of `run.rrd` in one step. A part that a killed process left behind is added first.
    """

    def __init__(self, rr: Any, path: Path) -> None:
        self._rr, self._path = rr, path
        self.part = path.with_name(f"{path.stem}.part.rrd")
        self.identity, self.offset = "", 0.0
        self._good = 0
        self._lock: int | None = None
        self.adds = path.exists() and (not path.is_file() or path.stat().st_size > 0)
        if not self.adds:
            return
        self._take_lock()
        try:
            self._look()
        except Diagnostic:
            self.release()
            raise

    @property
    def writes(self) -> Path:
        """The file that is written now."""
        return self.part if self.adds else self._path

    def _look(self) -> None:
        self.identity = _identity(self._path)
        if not self.identity:
            self.adds = False  # a plot that was killed before its first sample: nothing to lose
            return
        if self.part.exists():
            self._add_leftover()
        self.offset = _end(self._path) + GAP

    def _add_leftover(self) -> None:
        if _identity(self.part) not in ("", self.identity):
            raise Diagnostic(f"{self.part} is in the way", hint="it holds something else: rename it")
        try:
            self._join(set(), set())
        except (SinkBroken, OSError) as error:
            raise Diagnostic(f"cannot add {self.part}, which a plot left: {error}") from None

    def began(self) -> None:
        """The file is open."""
        if self._lock is None:
            self._take_lock()
        self.mark()

    def mark(self) -> None:
        """All up to here is on file."""
        with contextlib.suppress(OSError):
            self._good = self.writes.stat().st_size

    def cut(self) -> None:
        """Drop a message that was written in part, which nobody could read past."""
        with contextlib.suppress(OSError):
            os.truncate(self.writes, self._good)
        self.release()

    def finish(self, series: set[Series], logs: set[str]) -> None:
        """The recording was closed: make one file of it. Raises SinkBroken, and then both are kept."""
        try:
            if self.adds:
                self._join(series, logs)
            else:
                _sync(self._path)
        except OSError as error:
            raise SinkBroken(self.why(error)) from None
        finally:
            self.release()

    def _join(self, series: set[Series], logs: set[str]) -> None:
        """Copy the file and the part into a new file, which takes the file's place."""
        beside = self._path.with_name(f".{self._path.stem}.{secrets.token_hex(4)}.tmp.rrd")
        try:
            _copy(self._rr, [self._path, self.part], beside, self.identity)
            _sync(beside)
            os.replace(beside, self._path)
        except RuntimeError as error:
            raise SinkBroken(self.why(error)) from None
        finally:
            beside.unlink(missing_ok=True)
        self.part.unlink(missing_ok=True)

    def why(self, error: Exception) -> str:
        """What happened, and where what was written is."""
        reason = str(error)
        with contextlib.suppress(OSError):
            room = os.statvfs(self.writes.parent)
            if room.f_bavail * room.f_frsize < 1 << 18:
                reason = "the disk is full"
        kept = f"{self._path} is as it was, {self.part} has what was added" if self.adds else "it has all before"
        return f"cannot write {self.writes} ({reason}); plotting ended: {kept}"

    def _take_lock(self) -> None:
        if sys.platform == "win32":
            return
        try:
            self._lock = os.open(self._path, os.O_RDONLY)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise Diagnostic(f"{self._path} is being plotted to already", hint="take another file") from None
        except OSError as error:
            self.release()
            raise Diagnostic(f"cannot read {self._path} ({error.strerror})") from None

    def release(self) -> None:
        """Let others have the file."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
