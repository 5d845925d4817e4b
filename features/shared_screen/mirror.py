"""A screen that watches another one: the same app on a session that mirrors what the host sends.

Its buses lead nowhere: nothing but the stop leaves, to the host, whose thread writes it onto the wires. The values are
those that the host reads, on the host's clock; the transcripts are the host's, with this screen's own remarks.
"""

from __future__ import annotations

import asyncio
import sys
from collections import deque
from collections.abc import Container, Coroutine, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from textual.driver import Driver

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.dialects import Hints
from multidrop.dialects.families import FAMILIES
from multidrop.drives.bus import Bus
from multidrop.drives.events import BusEvent
from multidrop.drives.stopping import Fate
from multidrop.features.shared_screen.wire import Dropped, GarbledMessage, Item, Items, Now, StopHeard
from multidrop.macros import MacroStore
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.opening import OpenedBus
from multidrop.shell.events import Failed, OnBus, SessionEvent
from multidrop.shell.line_syntax import Place, TypedLine
from multidrop.shell.openings import Failed as OpeningFailed
from multidrop.shell.origin import Origin
from multidrop.shell.playing import Playing
from multidrop.shell.session import Session
from multidrop.shell.stop_report import DriveFate, FateTally
from multidrop.transports import Lost, Received, Transport
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from multidrop.tui.figures import NATIVE, Figures
from multidrop.tui.polling import Polling
from multidrop.tui.purpose import Purpose
from multidrop.tui.screen_model import Record, ScreenModel
from multidrop.tui.widgets.lines import Row

if sys.platform != "win32":
    from multidrop.features.shared_screen.feed import ON_BUS, TYPES, Shared, SharedBus, SharedDrive, note
    from multidrop.features.shared_screen.join import Stops
    from multidrop.transports.relay_pipe import SocketStream

assert sys.platform != "win32"

HOST = "the host"
STOP_REPLY_TIMEOUT = 1.0
"""Seconds in which the host confirms a stop."""
SILENCE = 3.0
"""Seconds without a sign of life that are said."""
OWN = ("/help", "/page", "/clear", "/quit", "/use", "/times", "/filter")
"""The verbs that change only what this screen shows."""
PAGES = ("drives", "plot")
"""The pages that a watcher has."""
READ_ONLY = "read only; Ctrl+X stops everything there, Ctrl+Q leaves"
REFUSED = "this screen only watches: Ctrl+X stops everything, and all other lines are typed at the host"


class WatchedHost:
    """What a watcher knows of the host: its state and clock, and what became of the stops sent to it."""

    def __init__(self, stops: Stops) -> None:
        self.stops = stops
        self.shared = Shared()
        self.over = ""
        """Why the connection has ended; empty: it has not."""
        self.offset = 0.0
        """The host's clock minus that of this loop, s."""
        self.heard_at = asyncio.get_running_loop().time()
        self.figures: dict[tuple[str, str, str], Figures] = {}
        self._asked_at, self._before = 0.0, 0

    def take(self, state: Shared) -> None:
        self.shared = state
        self.figures = {
            (readout.bus, readout.address, axis): figures
            for readout in state.readouts
            for axis, figures in readout.figures
        }

    def tick(self, at: float) -> None:
        """Take a sign of life with the host's time; the one that came fastest sets the clock."""
        self.heard_at = asyncio.get_running_loop().time()
        late = self.offset - (at - self.heard_at)
        if not 0 <= late < 1.0:
            self.offset -= late

    def asked(self) -> None:
        """Note that a stop was sent."""
        self._asked_at, self._before = asyncio.get_running_loop().time(), self.shared.stops

    @property
    def pending(self) -> bool:
        """A stop was sent, and the host has not said what came of it."""
        return self.stops.heard < self.stops.sent or (self.stops.sent > 0 and self.shared.stops <= self._before)

    @property
    def trouble(self) -> str:
        """Why a stop did not reach the host; empty: it did, or it may yet."""
        if not self.pending:
            return ""
        waited = asyncio.get_running_loop().time() - self._asked_at
        late = "no reply" if self.stops.heard < self.stops.sent and waited > STOP_REPLY_TIMEOUT else ""
        return self.stops.trouble or late

    @property
    def words(self) -> str:
        """What the screen does, for its prompt."""
        silent = asyncio.get_running_loop().time() - self.heard_at
        if self.over:
            return "the host is gone"
        return "watching" if silent < SILENCE else f"no news for {silent:.0f} s"


class Elsewhere(Transport):
    """The port of a mirrored bus, which is the host's: nothing goes there and nothing comes. `loss`: why it is lost."""

    def __init__(self, name: str, loss: str) -> None:
        self.name, self._loss = name, loss

    def start(self, received: Received, lost: Lost) -> None:
        if self._loss:
            lost(TransportLost(self._loss))

    def write(self, data: bytes) -> bool:
        return False

    def discard(self, whole: bool = False) -> int:
        return 0

    async def close(self) -> None:
        return None


class HostLog:
    """The log that the host writes."""

    size: int = 0

    def __init__(self, path: str) -> None:
        self.path = Path(path)

    def last(self, number: int) -> list[str]:
        return ["it is written at the host"]

    def close(self) -> None:
        return None


class Mirror(Session):
    """The session of a watcher. Its stop goes to the host, and nothing else does."""

    def __init__(self, settings: Settings, host: WatchedHost, receiver: Receiver) -> None:
        self._host, self._receiver = host, receiver
        self._ahead = 0
        """Stops that another thread has sent, and the loop has not taken over."""
        self._own, self._seen = 0, -1
        """Its stops that the host has not counted yet, and the number that the host has counted."""
        super().__init__(settings)
        self.macros = MacroStore(settings.state / "none")  # they are the host's
        self.said = host.words
        """What the screen does, as its prompt says it."""

    def now(self) -> float:
        return super().now() + self._host.offset

    @property
    def recording(self) -> str:
        return self._host.shared.recording

    def changed(self) -> None:
        """Take over what the host says, and publish it."""
        state = self._host.shared
        self.said = self._host.words
        self.latched = state.latched or self._host.pending
        self.plotted = state.plotted
        self.playing = [
            Playing(macro.name, macro.steps, 1, macro.key, 0, macro.step, None, None) for macro in state.macros
        ]
        self.log = HostLog(state.log) if state.log else None
        if state.stops > self._seen >= 0:
            others = state.stops - self._seen - self._own
            self._own = max(0, -others)
            if others > 0:
                self.stops, self.stopped_at = self.stops + 1, state.stopped_at
        self._seen = state.stops
        super().changed()

    # The stop

    def stop_ahead(self) -> None:
        self._ahead += 1
        self._host.stops.send()

    def stop(self, why: str = "stop", follows: bool = True) -> None:
        """Stop everything at the host. `follows`: as in a session."""
        if follows and self._ahead:
            self._ahead -= 1
        else:
            self._host.stops.send()
        self._host.asked()
        self._own += 1
        self.stops, self.stopped_at = self.stops + 1, self.now()
        self.tasks.stop()
        self.questions.open.stop()
        self.changed()

    def tally(self) -> FateTally:
        state, trouble = self._host.shared, self._host.trouble
        if trouble or self._host.pending:
            fate = Fate.NOT_REACHED if trouble else Fate.SENT
            return FateTally(self.wall(self.stopped_at), (DriveFate(fate, HOST, HOST, trouble),))
        return FateTally(self.wall(state.stopped_at), state.found, state.vain)

    # What is typed

    async def run(self, line: str | TypedLine, origin: Origin | None = None, since: int | None = None) -> None:
        """Run a line that changes only what this screen shows, or stops. Raises Diagnostic for any other."""
        text = (line if isinstance(line, str) else line.typed).strip()
        word = text.partition(" ")[0].lower()
        if word == "/stop":
            self.stop(follows=False)
        elif word in OWN:
            await super().run(line, origin, since)
        else:
            refused = Diagnostic(REFUSED, text)
            self.publish(Failed(self.now(), str(refused), by=(origin or self.origin).by))
            raise refused

    async def open(self, url: str, name: str | None = None, *, raw: bool = False) -> list[Bus]:
        raise Diagnostic(REFUSED, url)

    async def open_all(self, urls: Sequence[str], failed: OpeningFailed | None = None) -> None:
        """Show what the host sends, until the end."""
        await self._receiver.run()

    # What the host does, and its end: none of a watcher's is one there

    def _on_bus(self, bus: Bus, event: BusEvent) -> None:
        return None

    def interrupt(self) -> None:
        return None

    async def in_motion(self) -> list[str]:
        return []


class NoPolling(Polling):
    """The polls of a screen whose values come from the host: there are none."""

    def update(self, session: Session, model: ScreenModel, wants: Container[str]) -> None:
        return None


class Watching(Purpose):
    """The purpose of a watcher's screen: it shows what the host sends, and lines that are typed go nowhere."""

    works = False

    def __init__(self, session: Mirror) -> None:
        super().__init__(session)
        self._mirror = session
        self.polling = NoPolling()

    def fill(self) -> Coroutine[Any, Any, object]:
        return self._mirror.open_all(())

    def refused(self, page: str) -> str:
        return "" if page in PAGES else f"the page of {page} is at the host; a watcher has {' and '.join(PAGES)}"

    def label(self) -> Row:
        return ((f" {self._mirror.said} {':'.join(filter(None, self._mirror.place))} ▸ ", "motion"),)


class MirrorModel(ScreenModel):
    """A screen model that takes values of a host without making records of them: those come by themselves."""

    def __init__(self, session: Session, host: WatchedHost) -> None:
        super().__init__(
            lambda: session.selected_bus,
            lambda: session.buses,
            lambda bus, address, axis: host.figures.get((bus, address, axis), NATIVE),
        )
        self._mute = False

    def page(self, name: str) -> deque[Record]:
        return deque(maxlen=0) if self._mute else super().page(name)

    def mirror(self, event: SessionEvent) -> None:
        self._mute = True
        self.take(event)
        self._mute = False


class Receiver:
    """Takes what the host sends into the app and its session."""

    def __init__(self, connection: SocketStream, host: WatchedHost, name: str, early: bytes) -> None:
        """`name`: of the host; `early`: what it has sent already."""
        self._connection, self._host, self._name, self._early = connection, host, name, early
        self._shared: dict[Bus, SharedBus] = {}
        """The mirrored buses, as they are."""

    def app(self, settings: Settings, driver: type[Driver] | None = None) -> MultidropApp:
        """Make the app, on a session that mirrors the host's."""
        self._session = Mirror(replace(settings, connections={}), self._host, self)
        self._model = MirrorModel(self._session, self._host)
        assist = Assist(self._session, settings)
        purpose = Watching(self._session)
        self._app = MultidropApp(self._session, [], assist, driver, settings.screen, self._model, purpose)
        self._app.presenter.notes.append(lambda width: note(self._host.shared.watchers, width))
        return self._app

    async def run(self) -> None:
        """Take items until the connection ends; what it showed last stays."""
        items, data, why = Items(TYPES), self._early, ""
        watch = asyncio.create_task(self._watch())
        try:
            while True:
                for item in items.take(data):
                    await self._take(item)
                self._app.frames.wake()
                if not (data := await self._connection.read_some()):
                    break
        except GarbledMessage as problem:
            why = f"it sends what a shared screen does not ({problem})"
        finally:
            watch.cancel()
        self._host.over = why or self._connection.last_words() or "it has ended, or the connection is lost"
        self._host.stops.over(self._host.over)
        state = self._host.shared
        buses = tuple(bus._replace(lost=f"{HOST} is gone") for bus in state.buses)
        await self._apply(state._replace(buses=buses, watchers=()))
        self._session.notify(
            f"{HOST} is gone: {self._host.over}; nothing here is current, and a stop reaches nothing", warning=True
        )

    async def _watch(self) -> None:
        """Show a host that gives no sign of life."""
        while True:
            await asyncio.sleep(SILENCE / 3)
            if self._session.said != self._host.words or self._host.pending:
                self._session.changed()

    async def _take(self, item: Item) -> None:
        match item.value:
            case Shared() as state:
                first = self._host.shared.stops < 0
                await self._apply(state)
                if first:
                    self._app.show_line(f"you watch the screen of {self._name}: {READ_ONLY}")
            case Record() as record:
                self._model.page(item.bus).append(record)
                if record.mark in ("!", "x"):
                    self._model.trouble = record.text
            case Now(at):
                self._host.tick(at)
            case StopHeard(stops):
                self._host.stops.heard = stops
            case Dropped(number):
                self._app.show_line(f"{number} lines and values were dropped: this screen was not read in time", "!")
            case value:
                event: SessionEvent = OnBus(item.bus, value) if isinstance(value, ON_BUS) else value
                self._model.mirror(event)

    async def _apply(self, state: Shared) -> None:
        """Make buses, drives and selection those of the host; the selection follows his while it is the same."""
        session, before = self._session, self._host.shared
        own = session.place
        follows = own in (Place("", ""), Place(*before.selected))
        self._host.take(state)
        numbers = {opening.number: bus for bus, opening in self._shared.items()}
        for each in state.buses:
            bus = numbers.pop(each.number, None)
            if bus is None:
                bus = Bus(each.name, Elsewhere(each.port, each.lost), family=_family(each))
                session.adopt(OpenedBus(bus, Hints()), len(session.buses))
                self._shared[bus] = each._replace(drives=())
            self._update(bus, each)
        for gone in numbers.values():
            del self._shared[gone]
            await session.forget(gone)
        for place, each in enumerate(state.buses):
            while (at := list(session.buses).index(each.name)) > place:
                session.move_bus(session.buses[each.name], place - at)
        for read in state.readouts:
            readout = self._model.bus(read.bus).readout(read.address)
            readout.period, readout.watched = read.period, read.watched
        wanted = Place(*state.selected) if follows else own
        if wanted.bus in session.buses:
            with suppress(Diagnostic):  # the drive is gone
                session.select(wanted.address, wanted.bus)
        session.changed()

    def _update(self, bus: Bus, now: SharedBus) -> None:
        before, self._shared[bus] = self._shared[bus], now
        if before.name != now.name:
            self._session.rename_bus(bus, now.name)
        if before.lost != now.lost:
            bus.link.resume(Elsewhere(now.port, now.lost))
            if not now.lost:
                bus.link.resumed()
        if before.drives == now.drives:
            return
        bus.roster.drives.clear()
        for drive in now.drives:
            _add(bus, drive)
        self._session.identified(bus)


def _family(bus: SharedBus) -> str:
    return next((drive.family for drive in bus.drives if drive.family in FAMILIES), "")


def _add(bus: Bus, drive: SharedDrive) -> None:
    family = FAMILIES.get(drive.family) or bus.roster.family
    state = family.new_state(family.codec, drive.address)
    state.identified(drive.product, drive.version, stranger=drive.stranger)
    state.reference_lost(drive.unreferenced)
    if drive.programming:
        state.found_storing()
    bus.roster.found(state)
    bus.drives[drive.address].label = drive.label


def watch(
    connection: SocketStream, name: str, early: bytes, settings: Settings, driver: type[Driver] | None = None
) -> MultidropApp:
    """Make the app of a watcher. `name`: of the host; `early`: what it has sent already."""
    return Receiver(connection, WatchedHost(Stops(connection)), name, early).app(settings, driver)
