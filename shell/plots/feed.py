"""Plots of positions and velocities to rerun, with commands and replies as a text log on the same time lines.

A plot takes samples and texts as they come, which costs next to nothing, and hands them over in batches from a thread
of its own: a killed process loses half a second at most, and a viewer that froze holds up nobody. Two time lines:
`elapsed` (s since the plot began; goes on where a file that is added to ended) and `time` (the wall clock).
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar
from urllib.parse import urlsplit

from dialects import Diagnostic
from dialects.numbers import whole
from drives.events import Sample
from shell.events import Entered, Failed, Notified, OnBus, Printed, SessionEvent
from shell.plots.file import SinkBroken
from shell.plots.sink import Batch, PlotTarget, Sink, bracketed, load

if TYPE_CHECKING:
    from shell.session import Session

__all__ = ["Plot", "PlotTarget", "attach", "load", "parse_target"]

T = TypeVar("T")
_HOST = "127.0.0.1"
_FILE_PERIOD, _LIVE_PERIOD = 0.4, 0.1
"""Seconds between batches: fewer make a smaller file, more a smoother view."""
_PATIENCE = 8.0
"""Seconds after which whoever takes a batch counts as frozen."""
_FILE_PATIENCE = 120.0
"""Seconds that reading a file that is added to, and writing it anew, may take."""
_LEVELS = ("command", "reply", "error", "note")


def parse_target(to: str | None, serve: str | None) -> PlotTarget:
    """The target that `--to FILE.rrd`, `--to rerun+http://HOST:PORT/proxy` or `--serve [HOST:]PORT` say.

    Raises Diagnostic for a wrong one, for both and for none.
    """
    if (to is None) == (serve is None):
        what = "no place for the plot" if to is None else "two places for one plot"
        raise Diagnostic(what, hint="give --to FILE.rrd, --to rerun+http://HOST:PORT/proxy or --serve [HOST:]PORT")
    if serve is not None:
        return _served(serve)
    assert to is not None
    return _viewer(to) if "://" in to else _file(to)


def _file(text: str) -> PlotTarget:
    try:
        path = Path(text).expanduser()
    except RuntimeError:  # a ~ and no home
        path = Path(text)
    if path.suffix != ".rrd":
        raise Diagnostic(f"{text!r} is no place for a plot", hint="name a file that ends in .rrd")
    if not os.path.isdir(path.parent):  # Path's own methods raise for a name that is too long
        raise Diagnostic(f"no folder {path.parent}", hint="make it first")
    if os.path.exists(path) and not os.path.isfile(path):
        raise Diagnostic(f"{path} is no file", hint="take another name")
    return PlotTarget(file=path)


def _served(text: str) -> PlotTarget:
    host, _, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]") or _HOST
    number = whole(port, 0, 65535)
    if number is None:
        raise Diagnostic(f"{text!r} is no port to serve at", hint="give PORT or HOST:PORT, as 9876")
    return PlotTarget(host=host, port=number)


def _viewer(text: str) -> PlotTarget:
    hint = "write rerun+http://HOST:PORT/proxy"
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:
        raise Diagnostic(f"{text!r} is no address of a viewer", hint=hint) from None
    right = parts.scheme == "rerun+http" and parts.path == "/proxy" and not (parts.query or parts.fragment)
    if not (right and host and port and "@" not in parts.netloc):
        raise Diagnostic(f"{text!r} is no address of a viewer", hint=hint)
    return PlotTarget(host=host, port=port, url=f"rerun+http://{bracketed(host)}:{port}/proxy")


class Plot:
    """An open plot. Made with `open`, ended with `close`; it ends by itself when nobody takes it any more."""

    def __init__(self, sink: Sink, clock: Callable[[], float], wall: Callable[[float], datetime]) -> None:
        """Use `open`."""
        self._sink, self._wall = sink, wall
        self._begin = clock() - sink.offset
        self._batch = Batch()
        self._closing = asyncio.Event()
        self._failed: list[Callable[[str], None]] = []
        self.target = sink.target
        """Where it goes, with the port that was taken."""
        self.samples = 0
        """How many samples it was given, and took."""
        self.failure = ""
        """Why it ended by itself; empty: it did not."""
        self.ended = asyncio.Event()
        """Set when it has ended, by `close` or by itself."""
        self._task = asyncio.get_running_loop().create_task(self._flushing())

    @classmethod
    async def open(cls, target: PlotTarget, *, clock: Callable[[], float], wall: Callable[[float], datetime]) -> Plot:
        """Begin. `clock` is the one that samples' times are of, `wall` gives the time of day of such a time.

        A file of ours is added to. Raises Diagnostic where rerun is not installed, the file is something else or
        cannot be written, or the port is in use, Unreachable where no viewer is there; nothing is touched then.
        """
        try:
            sink = await _aside(lambda: Sink(target), _patience(target))
        except TimeoutError:
            raise Diagnostic(f"cannot plot to {target.text}: it does not answer") from None
        return cls(sink, clock, wall)

    def on_failure(self, callback: Callable[[str], None]) -> None:
        """Call back once, with one line for a person, if the plot ends by itself."""
        self._failed.append(callback)

    def sample(self, bus: str, sample: Sample) -> None:
        """Take a sample. Never blocks."""
        if self._done:
            return
        self.samples += 1
        row = (*self._times(sample.at), sample.position, sample.velocity)
        self._batch.samples.setdefault((bus, sample.address, sample.axis), []).append(row)

    def text(self, bus: str, address: str, at: float, text: str, level: str) -> None:
        """Take a line of text; `level` is `command`, `reply`, `error` or `note`. Never blocks."""
        if level not in _LEVELS:
            raise ValueError(f"level {level!r}")
        if not self._done:
            line = (f"{address}: {text}" if address else text).encode("utf-8", "replace").decode("utf-8")
            self._batch.texts.setdefault(bus, []).append((*self._times(at), line, level))

    async def close(self) -> str:
        """Write everything and close; one line about it. Raises Diagnostic where that failed. Twice: the same."""
        self._closing.set()
        await asyncio.shield(self._task)
        if self.failure:
            raise Diagnostic(self.failure)
        return f"{self.samples} samples in {self.target.text}"

    @property
    def _done(self) -> bool:
        return self._closing.is_set() or bool(self.failure)

    def _times(self, at: float) -> tuple[float, float]:
        return at - self._begin, self._wall(at).timestamp()

    async def _flushing(self) -> None:
        """The plot's own task: batches until it is closed or broken. Not to be cancelled; `close` ends it."""
        period = _LIVE_PERIOD if self.target.file is None else _FILE_PERIOD
        try:
            while not self._closing.is_set():
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._closing.wait(), period)
                await self._flush()
            await self._flush()
            await _aside(self._sink.close, _patience(self.target))
        except (SinkBroken, TimeoutError) as error:
            await self._break(error)
        finally:
            self.ended.set()

    async def _flush(self) -> None:
        batch, self._batch = self._batch, Batch()
        if batch:
            await _aside(lambda: self._sink.send(batch), _PATIENCE)

    async def _break(self, error: SinkBroken | TimeoutError) -> None:
        reason = str(error) if isinstance(error, SinkBroken) else self._sink.why(error)
        self.failure = f"plotting ended: {reason}"
        self._batch = Batch()
        self._sink.leave_behind()
        for callback in self._failed:
            callback(self.failure)
        with contextlib.suppress(TimeoutError):
            await _aside(self._sink.abandon, 2.0)
        self._sink.let_go()


def _patience(target: PlotTarget) -> float:
    return _PATIENCE if target.file is None else _FILE_PATIENCE


async def _aside(work: Callable[[], T], patience: float) -> T:
    """Do blocking work in a thread that the process does not wait for. Raises TimeoutError, and leaves it, after that.

    Not `to_thread`: the interpreter joins its threads at the end, and one that waits for a frozen viewer never ends.
    """
    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()

    def settle(result: T | None, error: BaseException | None) -> None:
        if future.done():
            return
        if error is not None:
            future.set_exception(error)
        else:
            future.set_result(result)  # type: ignore[arg-type]

    def thread() -> None:
        result: T | None = None
        failure: BaseException | None = None
        try:
            result = work()
        except BaseException as error:  # handed to whoever waits
            failure = error
        with contextlib.suppress(RuntimeError):  # the loop was closed meanwhile
            loop.call_soon_threadsafe(settle, result, failure)

    threading.Thread(target=thread, name="plot", daemon=True).start()
    return await asyncio.wait_for(future, patience)


def attach(session: Session, plot: Plot, drives: Sequence[tuple[str, str]]) -> Callable[[], None]:
    """Feed the plot: poll these drives (bus, address), and log what is said on their buses. Returns the way out.

    Polling ends with it, or with the plot. Raises Diagnostic for a bus that is not open.
    """
    for bus, _ in drives:
        if bus not in session.buses:
            raise Diagnostic(f"no bus {bus!r} is open", hint=f"open are {', '.join(session.buses) or 'none'}")
    wanted, buses = set(drives), {bus for bus, _ in drives}

    def take(event: SessionEvent) -> None:
        if isinstance(event, OnBus):
            if isinstance(event.event, Sample) and (event.bus, event.event.address) in wanted:
                plot.sample(event.bus, event.event)
        else:
            _log(plot, buses, event)

    ends: list[Callable[[], None]] = [session.subscribe(take)]
    for bus in sorted(buses):
        addresses = [address for each, address in dict.fromkeys(drives) if each == bus]
        ends.append(session.buses[bus].telemetry.subscribe(addresses).close)

    def detach() -> None:
        while ends:
            ends.pop()()

    def failed(reason: str) -> None:
        detach()
        session.notify(reason, warning=True)

    plot.on_failure(failed)
    return detach


def _log(plot: Plot, buses: set[str], event: SessionEvent) -> None:
    """A session's event as a line of the log, if it is of these buses or of none (a verb)."""
    if not isinstance(event, Entered | Printed | Failed | Notified) or event.bus not in {*buses, ""}:
        return
    if isinstance(event, Entered):
        plot.text(event.bus, event.address, event.at, event.line, "command")
    elif isinstance(event, Printed):
        plot.text(event.bus, event.address, event.at, event.text, "reply")
    elif isinstance(event, Failed):
        plot.text(event.bus, event.address, event.at, event.text, "error")
    else:
        plot.text(event.bus, "", event.at, event.text, "note")
