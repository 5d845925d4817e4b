"""The feed of a shared screen: what its watchers get of transcripts, values and the state of the session.

Records go as the transcript shows them, values as the events that the screen model takes. They are gathered, and
encoded once for all watchers, twenty times a second. While nobody watches only the last values are kept.
"""

from __future__ import annotations

import asyncio
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

from multidrop.drives.events import Conditioned, Sample, Silent, Valued
from multidrop.features.shared_screen.wire import Dropped, Item, Now, StopHeard, line
from multidrop.shell import events
from multidrop.shell.roles import Series
from multidrop.shell.stop_report import DriveFate
from multidrop.tui.app import MultidropApp
from multidrop.tui.figures import Figures
from multidrop.tui.screen_model import Record

if sys.platform != "win32":
    from multidrop.features.shared_screen.host import Gate, GateCalls, Watcher

assert sys.platform != "win32"

BEAT = 0.05
"""Seconds between two lines to the watchers."""
LOOKS = 5
"""Beats between two looks at the state."""
BEATS_A_SIGN = 20
"""Beats between two signs of life."""
HISTORY = 2000
"""Records of each transcript for a watcher that comes."""
SAMPLES = 1000
"""Samples of each axis for his plots."""
ITEMS_A_MESSAGE = 250
"""Items of a line to him."""
SERIES = (Sample, Valued, events.Predicted)
"""Values of which a plot shows many."""
ON_BUS = (*SERIES, Silent, Conditioned, events.Diverged, events.Agreed, events.TwinEnded)
"""Values that are events of a bus."""
LASTING = (*ON_BUS, events.ProgramRead, events.ProgramSeen)
"""Events of which a watcher that comes needs the last."""
VALUES = (*LASTING, events.Entered, events.Progressed)


class SharedDrive(NamedTuple):
    """A drive as it is shown."""

    address: str
    label: str
    family: str
    product: str
    version: str
    programming: bool
    unreferenced: tuple[str, ...]
    stranger: str = ""


class SharedBus(NamedTuple):
    """An open bus. `number` tells it from others whatever its name; `lost` is the reason, empty while it is there."""

    number: int
    name: str
    port: str
    lost: str
    drives: tuple[SharedDrive, ...]


class SharedReadout(NamedTuple):
    """How a drive is read, s between two polls and between two readings of conditions, and the figures of its axes."""

    bus: str
    address: str
    period: float
    watched: float
    figures: tuple[tuple[str, Figures], ...]


class SharedMacro(NamedTuple):
    """A macro that plays."""

    name: str
    key: str
    step: int
    steps: int


class Shared(NamedTuple):
    """The state of a session, as far as a screen shows it. `found` and `vain`: the tally of the last stop."""

    stops: int = -1
    stopped_at: float = 0.0
    latched: bool = False
    found: tuple[DriveFate, ...] = ()
    vain: bool = False
    selected: tuple[str, str] = ("", "")
    recording: str = ""
    log: str = ""
    macros: tuple[SharedMacro, ...] = ()
    plotted: tuple[Series, ...] = ()
    buses: tuple[SharedBus, ...] = ()
    readouts: tuple[SharedReadout, ...] = ()
    watchers: tuple[str, ...] = ()


TYPES = (Shared, Record, Now, StopHeard, Dropped, *VALUES)
"""The values on the wire."""


def shared(app: MultidropApp, watchers: Sequence[str]) -> Shared:
    """The state of an app's session. `watchers`: their names."""
    session, presenter = app.session, app.presenter
    buses, readouts = list[SharedBus](), list[SharedReadout]()
    for bus in session.tabs.shown:
        drives = tuple(
            SharedDrive(
                drive.address,
                drive.label,
                drive.family.name,
                drive.product,
                drive.version,
                drive.programming,
                tuple(sorted(drive.state.unreferenced)),
                drive.state.stranger,
            )
            for drive in bus.drives.values()
        )
        buses.append(SharedBus(id(bus), bus.name, bus.link.transport.name, presenter.loss(bus), drives))
        for address in bus.drives:
            readout = app.model.bus(bus.name).readout(address)
            figures = tuple((axis.axis, axis.figures) for axis in readout.axes)
            readouts.append(SharedReadout(bus.name, address, readout.period, readout.watched, figures))
    tally = session.tally() if session.latched else None
    return Shared(
        session.stops,
        max(session.stopped_at, 0.0),
        session.latched,
        tally.found if tally is not None else (),
        tally is not None and tally.vain,
        (session.place.bus, session.place.address),
        session.recording,
        str(session.log.path) if session.log is not None else "",
        tuple(SharedMacro(playing.name, playing.key, playing.step, playing.steps) for playing in session.playing),
        tuple(session.plotted),
        tuple(buses),
        tuple(readouts),
        tuple(watchers),
    )


def note(watchers: Sequence[str], width: int) -> str:
    """Who watches, for the top line of a screen; empty: nobody."""
    if not watchers:
        return ""
    who = watchers[0] if len(watchers) == 1 and width >= 100 else str(len(watchers))
    return f"watched by {who[:24]}"


class ScreenFeed:
    """Feeds the watchers of one app, and stops for them. Raises Diagnostic where the screen cannot be shared."""

    def __init__(self, app: MultidropApp, folder: Path) -> None:
        self._app, self._loop = app, asyncio.get_running_loop()
        refused = partial(app.session.notify, warning=True)
        calls = GateCalls(app.stop_ahead, self._stop, self._joined, self._catch_up, self._left, refused)
        self.gate = Gate(folder, self._loop, calls)
        self._pending: list[Item] = []
        self._last: dict[tuple[str, ...], deque[Item]] = {}
        """The last values, by type, bus, address, and axis or word."""
        self._of_no_bus: list[Record] = []
        self._state = Shared()
        """The state as the watchers have it."""
        self._changed = False
        self._beats = 0
        self._timer: asyncio.TimerHandle | None = None
        self._unsubscribe = app.session.subscribe(self._take)
        app.presenter.on_records["what is sent to watchers"] = self._records
        app.presenter.notes.append(lambda width: note(self.watchers, width))

    @property
    def watchers(self) -> list[str]:
        """The names of those that watch."""
        return [watcher.name for watcher in self.gate.watchers]

    def close(self) -> None:
        self._unsubscribe()
        if self._timer is not None:
            self._timer.cancel()
        self.gate.close()

    # What happens in the session

    def _take(self, event: events.SessionEvent) -> None:
        if isinstance(event, events.StateChanged):
            self._changed = True
            return
        value, bus = (event.event, event.bus) if isinstance(event, events.OnBus) else (event, getattr(event, "bus", ""))
        if not isinstance(value, VALUES):
            return
        item = Item(value, bus)
        if isinstance(value, LASTING):
            part = getattr(value, "axis", "") or getattr(value, "word", "")
            key = (type(value).__name__, bus, value.address, part)
            if (kept := self._last.get(key)) is None:
                kept = self._last[key] = deque(maxlen=SAMPLES if isinstance(value, SERIES) else 1)
            kept.append(item)
        if self.gate.watchers:
            self._pending.append(item)

    def _records(self, bus: str, records: Sequence[Record]) -> None:
        """Take new records; those of the page of no bus come again once that becomes the page of the first bus."""
        news = [
            record for record in records if not (record.private or any(record is other for other in self._of_no_bus))
        ]
        self._of_no_bus = [] if bus else [*self._of_no_bus, *news]
        if self.gate.watchers:
            self._pending += [Item(record, bus) for record in news]

    # To the watchers

    def _beat(self) -> None:
        self._timer = self._loop.call_later(BEAT, self._beat) if self.gate.watchers else None
        self._beats += 1
        if self._beats % BEATS_A_SIGN == 0:
            self._pending.append(Item(Now(self._app.session.now())))
        if self._changed or self._beats % LOOKS == 0:
            self._changed = False
            if (state := shared(self._app, self.watchers)) != self._state:
                self._state = state
                self._pending.append(Item(state))
        self._flush()

    def _flush(self) -> None:
        items, self._pending = self._pending, []
        data = line(items) if items and self.gate.watchers else b""
        for watcher in self.gate.watchers if data else ():
            watcher.put(data, len(items))

    def _catch_up(self, watcher: Watcher, most: int = 1) -> None:
        """Send the state and the last values, as many of each as `most`."""
        buses = self._app.session.buses
        self._last = {key: kept for key, kept in self._last.items() if key[1] in buses}
        values = [item for kept in self._last.values() for item in list(kept)[-most:]]
        values.sort(key=lambda item: item.value.at)
        self._state = shared(self._app, self.watchers)
        _put(watcher, [Item(Now(self._app.session.now())), Item(self._state), *values])

    # Watchers

    def _joined(self, watcher: Watcher) -> None:
        self._flush()
        app = self._app
        self.gate.watchers.append(watcher)
        self._catch_up(watcher, SAMPLES)
        for bus, page in app.main.pages.items():
            kept = page.records
            last = kept.since(kept.taken - HISTORY)
            _put(watcher, [Item(record, bus) for _, record in last if not record.private])
        app.session.notify(f"{watcher.name} watches this screen", outcome=True)
        if self._timer is None:
            self._beat()

    def _left(self, watcher: Watcher) -> None:
        if watcher in self.gate.watchers:
            self.gate.watchers.remove(watcher)
            self._app.session.notify(f"{watcher.name} no longer watches this screen", outcome=True)

    def _stop(self, name: str) -> None:
        self._app.session.stop(f"stop by {name}, who watches")


def _put(watcher: Watcher, items: Sequence[Item]) -> None:
    for begin in range(0, len(items), ITEMS_A_MESSAGE):
        part = items[begin : begin + ITEMS_A_MESSAGE]
        watcher.put(line(part), len(part), keep=True)


@contextmanager
def sharing(app: MultidropApp, folder: Path) -> Iterator[ScreenFeed]:
    """Share an app's screen with watchers of the same account. Raises Diagnostic where that cannot be."""
    feed = ScreenFeed(app, folder)
    app.session.notify("this screen is shared: `multidrop tui --join` watches it; elsewhere, --join ssh://THIS-HOST")
    try:
        yield feed
    finally:
        feed.close()
