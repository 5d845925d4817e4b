"""The open buses and their drives, the selection, macros, log and plots; and the stop of all of it.

An open bus is one record, `OpenBus`: it has all that is known of the bus, and goes as one when that is closed.

The stop has two phases. First its bytes go onto every wire, each wire by itself. Then the latch falls, running tasks
are cancelled, and the stop is published. A step that fails holds back none of the others.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic, NoAnswer
from multidrop.base.isolation import isolated
from multidrop.base.text import acts_first
from multidrop.drives.events import BusEvent, Changed, Conditioned, Lost, Notice, Sample, Unsolicited
from multidrop.macros import MacroStore, Recorder
from multidrop.shell import stop_report
from multidrop.shell.channel import Channel, Questions, Tasks, UnderWay
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.reconnect import Reconnections
from multidrop.shell.events import Failed, Notified, OnBus, Printed, StateChanged
from multidrop.shell.line_syntax import EVERYONE, Place, join_target
from multidrop.shell.playing import Playing
from multidrop.shell.remembered import KnownNames, Lately, Observing
from multidrop.shell.session_hooks import SessionHooks

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Drive
    from multidrop.drives.stopping import Halt
    from multidrop.shell.connect.opening import OpenedBus
    from multidrop.shell.connect.scheme import Connection
    from multidrop.shell.raw import RawLine, Watched
    from multidrop.shell.roles import Observer, OpenLog, RunningPlot, Series
    from multidrop.simulator.serving.running import RunningFloor


LATCHED = "stopped; /resume lets macros and scripts run again"
"""The refusal of automation after a stop."""


@dataclass(frozen=True, eq=False)
class BeingOpened:
    """A URL that is being opened, and the number of stops when that began."""

    url: str
    stops: int


@dataclass(eq=False)
class OpenBus:
    """An open bus, and what a session holds of it."""

    bus: Bus
    opened: OpenedBus
    connection: Connection | None
    """Its URL; None: a search opened it, or it mirrors one of another screen."""
    in_cell: str
    """The name that a simulated bus has in its cell."""
    place: float
    """Its place among the others."""
    unwatch: Callable[[], None]
    doubt: str = ""
    """The error of the configuration that took its names, units or guards; it is read only until a person agrees."""
    probe: bool = False
    """A search has opened it for a moment, so that a stop reaches it; a person did not."""
    searched_until: float = float("-inf")
    """The end of a search for drives that has taken over its port, s: until then it is not lost."""
    port: str = ""
    """The name of its port, the same in every session; empty for a simulated one."""
    selected: Drive | None = None
    """The drive selected on it; None: none has replied there."""
    raw: RawLine | None = None
    """Its raw mode; None: it is not raw."""
    bytes_shown: Watched | None = None
    """The view of its bytes while it is not raw."""
    annotators: list[Callable[[str], str]] = field(default_factory=list)
    """Functions that add to its unsolicited lines, such as the remark of a traced line."""
    debuggers: dict[Drive, Observer] = field(default_factory=dict)
    """The observation of a drive's program, for the verbs that do that."""


class Tabs:
    """The buses as a screen lists them: those that a person has opened, and which of them are lost."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace

    @property
    def shown(self) -> list[Bus]:
        """The buses that a person has opened, in their order; a search opens others for a moment."""
        return [bus for bus in self._workspace.buses.values() if not self._workspace.of(bus).probe]

    def missing(self, bus: Bus) -> bool:
        """True if a bus is lost; while its port is searched for drives, or just was, it is not."""
        return bus.lost is not None and self._workspace.now() >= self._workspace.of(bus).searched_until


class Workspace(Channel):
    """The open buses and the selection. Needs a running event loop, and belongs to its thread."""

    def __init__(self, settings: Settings, reconnect: bool = False) -> None:
        """Open nothing yet. `reconnect`: a bus that is lost is tried again until it is back or closed."""
        super().__init__()
        self.settings = settings
        self.buses: dict[str, Bus] = {}
        """By name, in their order."""
        self._open: dict[Bus, OpenBus] = {}
        self.tabs = Tabs(self)
        self.selected_bus = ""
        """The name of the selected bus; empty while nothing is open."""
        self.deselected = False
        """The selected bus was closed, and no other one was selected since."""
        self.latched = False
        """After a stop: macros and scripts are refused until `resume`."""
        self._closed_in_doubt: list[stop_report.DriveFate] = []
        """The drives of lines that were closed before they were read at rest after the stop that is latched."""
        self.stops = 0
        """The number of stops. A front end notes it as a line is typed; a line older than a stop is never sent."""
        self.stopped_at = float("-inf")
        """The time of the last stop, s of the session's clock."""
        self.opening: list[BeingOpened] = []
        """The URLs that are being opened, which no stop reaches yet."""
        self.tasks, self.questions, self.under_way = Tasks(self.changed), Questions(self), UnderWay(self)
        self.addressed: set[tuple[str, str]] = set()
        """(bus, address) of every drive that this session sent a line to; `/wait` waits for them."""
        self.macros = MacroStore(settings.macros, settings.project_macros)
        self.recorder = Recorder()
        self.lately = Lately()
        """The last lines that drives printed."""
        self.subscribe(self.lately.take, Printed, Unsolicited)
        self.subscribe(Observing(self.recorder, lambda: self.buses).take, Conditioned, Unsolicited, Sample)
        self.names = KnownNames()
        """The labels and variables that were read, for completion."""
        self.log: OpenLog | None = None
        self.scaled = any(connection.units for connection in settings.connections.values())
        """An axis may have a scale."""
        self.on_opened: list[Callable[[Bus], Awaitable[None]]] = []
        """Awaited with each bus whose drives were found, where an axis may have a scale."""
        self.hooks = SessionHooks()
        """What features hear of lines, and what they keep."""
        self.predicted: set[Bus] = set()
        """The buses of which a feature predicts drives: `shell.events.Predicted` comes beside their samples."""
        self.plots: list[RunningPlot] = []
        self.plotted: tuple[Series, ...] = ()
        """The series that the screen plots; empty: the selected drive."""
        self.playing: list[Playing] = []
        """The macros that play; a macro follows the one that plays it."""
        self.dropped: list[str] = []
        """The macros whose `on_early_end` lines a stop dropped; `/resume` says so."""
        self.doubted = ""
        """Why drives are read only: the stop key may be swallowed. Empty: it is not doubted."""
        self.quitting = False
        """After `/quit`: front ends end, scripts too."""
        self.reconnections = Reconnections(lambda bus, text: self.notify(text, bus=bus, warning=True), reconnect)
        """The buses that are tried again when they are lost."""
        self._closing: set[asyncio.Future[None]] = set()

    # Buses

    def adopt(self, opened: OpenedBus, place: int, connection: Connection | None = None, in_cell: str = "") -> OpenBus:
        """Add a bus and begin to read it; from here on a stop reaches it. Buses keep the order of their places."""
        bus = opened.bus
        unwatch = bus.watch(partial(self._on_bus, bus))
        record = self._open[bus] = OpenBus(bus, opened, connection, in_cell or bus.name, place, unwatch)
        self._open, self.buses = _in_order(self._open)
        self.scaled = self.scaled or bool(opened.units)
        for text in opened.warnings:
            self.notify(f"{bus.name}: {text}", bus=bus.name, warning=True)
        bus.start()
        return record

    async def forget(self, bus: Bus) -> None:
        """Close a bus and drop everything known of it. A stop that ends the caller does not leave the port open."""
        self.hooks.tell(self.hooks.forgotten, bus)
        record = self._open.get(bus)
        if self.latched and record is not None and not record.probe:
            self._closed_in_doubt += stop_report.in_doubt(_tally_of(self, [bus]))
        for observer in record.debuggers.values() if record is not None else ():
            observer.close()
        self._open.pop(bus, None)
        self.buses.pop(bus.name, None)
        self.addressed = {key for key in self.addressed if key[0] != bus.name}
        if record is not None:
            record.unwatch()
            for shown in (record.raw, record.bytes_shown):
                if shown is not None:
                    shown.close()
        if self.selected_bus == bus.name:
            self.selected_bus = next(iter(self.buses), "")
        closing = asyncio.ensure_future(_close(bus, self.reconnections))
        self._closing.add(closing)
        closing.add_done_callback(self._closing.discard)
        await asyncio.shield(closing)

    def of(self, bus: Bus) -> OpenBus:
        return self._open[bus]

    @property
    def raw(self) -> dict[str, RawLine]:
        """The buses in raw mode, by name."""
        return {bus.name: open_bus.raw for bus, open_bus in self._open.items() if open_bus.raw is not None}

    @property
    def cells(self) -> dict[str, RunningFloor]:
        """The running cells of simulated buses, by bus."""
        return {
            bus.name: open_bus.opened.floor for bus, open_bus in self._open.items() if open_bus.opened.floor is not None
        }

    def bus(self, name: str = "") -> Bus:
        """Find an open bus by name; the selected one where no name is given. Raises Diagnostic."""
        if not self.buses:
            raise Diagnostic("nothing is open", hint="/open URL opens a line of drives")
        bus = self.buses.get(name or self.selected_bus)
        if bus is None and not name and self.deselected:
            hint = f"/use selects one: {', '.join(self.buses)}"
            raise Diagnostic("no bus is selected since the selected one was closed", hint=hint)
        if bus is None and not name:
            raise Diagnostic("no bus is ready yet", hint=f"{', '.join(self.buses)} is being opened")
        if bus is None:
            raise Diagnostic(f"no bus {name}", hint=f"open: {', '.join(self.buses)}")
        return bus

    def of_demo(self, bus: str) -> str:
        """The name under which a bus of the demo cell is open; empty: it is not."""
        return next((name for name, each in self.buses.items() if each.link.transport.name == f"sim:#{bus}"), "")

    def move_bus(self, bus: Bus, by: int) -> None:
        """Put a bus before or after its neighbour; at an end nothing happens."""
        order = list(self._open.values())
        at = order.index(self._open[bus])
        if not 0 <= at + by < len(order):
            return
        order[at], order[at + by] = order[at + by], order[at]
        for number, open_bus in enumerate(order):
            open_bus.place = number / len(order)  # below 1, and so before what opens later
        self._open, self.buses = _in_order(self._open)
        self.changed()

    def rename_bus(self, bus: Bus, name: str) -> None:
        """Give an open bus another name. Raises Diagnostic, also while anything runs that knows it by its name."""
        before = bus.name
        if not re.fullmatch(r"[A-Za-z0-9_.-]{1,32}", name) or acts_first(name):
            hint = "valid: letters, digits, -, _ and . (32 at most), not - first"
            raise Diagnostic(f"{name!r} is not a name", "/rename", hint)
        if name in self.buses:
            raise Diagnostic(f"a bus {name} is open already", "/rename", "give another name")
        holds = (
            (bus.lost is not None, "it is lost"),
            (self._open[bus].raw is not None, "it is raw"),
            (self.busy or bool(self.playing), "a macro, a wait or a transfer runs"),
            (bool(self.plots), "a plot runs"),
            (bool(self._open[bus].debuggers), "its program is watched"),
            (bool(self.recording), "a macro is recorded"),
        )
        for held, why in holds:
            if held:
                raise Diagnostic(f"{before} keeps its name while {why}", "/rename", "rename it after that")
        bus.link.name = name
        self._open, self.buses = _in_order(self._open)
        self.addressed = {(name if each == before else each, address) for each, address in self.addressed}
        self.plotted = tuple(series._replace(bus=name) if series.bus == before else series for series in self.plotted)
        self.reconnections.rename(before, name)
        if self.selected_bus == before:
            self.selected_bus = name
        if self.front.renamed is not None:
            self.front.renamed(before, name)
        self.notify(f"{before} is {name} now", bus=name)
        self.changed()

    # Selection and addresses

    @property
    def selected(self) -> Drive | None:
        """The drive that plain text goes to."""
        bus = self.buses.get(self.selected_bus)
        return _present(bus, self._open[bus].selected) if bus is not None else None

    @property
    def place(self) -> Place:
        """The selected bus, and the selected drive on it."""
        selected = self.selected
        return Place(self.selected_bus, selected.address if selected is not None else "")

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive by address or label on a bus (by default the selected one).

        An empty address selects the bus and the drive that was last selected there. Raises Diagnostic.
        """
        chosen = self.bus(bus)
        if address:
            drive = _find(chosen, address)
            if drive is None:
                hint = f"valid: {', '.join(chosen.drives)}" if chosen.drives else "no drive has replied there"
                raise Diagnostic(f"no drive {address} on {chosen.name}", hint=hint)
            self._open[chosen].selected = drive
        self.selected_bus, self.deselected = chosen.name, False
        self.changed()

    def identified(self, bus: Bus) -> None:
        """Note that the drives of a bus are found; its first one is selected there."""
        if record := self._open.get(bus):
            record.selected = next(iter(bus.drives.values()), None)
        self.changed()
        self.hooks.tell(self.hooks.identified, bus)

    def drive(self, bus: str = "", address: str | None = None) -> Drive:
        """Find the drive at an address (or label) of a bus, known or not; by default the selected one."""
        chosen = self.bus(bus)
        if address is None:
            selected = _present(chosen, self._open[chosen].selected)
            if selected is None:
                raise NoAnswer(f"{chosen.name}: no drive has replied; @ADDR TEXT sends to one all the same")
            return selected
        drive = _find(chosen, address)
        sole = chosen.drives.get("")
        if drive is None and sole is not None:
            if address in EVERYONE:
                return sole
            hint = f"@{chosen.name}: TEXT goes to it"
            raise Diagnostic(f"no address {address}: the drive on {chosen.name} takes none", hint=hint)
        return drive or chosen.at(address)

    def qualified_address(self, drive: Drive) -> str:
        """The drive's address, valid whatever is selected later; empty where only one drive can be meant."""
        return join_target(drive.link.name if len(self.buses) > 1 else "", drive.address)

    def display_name(self, drive: Drive) -> str:
        """The drive's name for a person: `b`, or `press:b` where several buses are open; valid as an address."""
        name = drive.label or drive.address
        return join_target(drive.link.name if len(self.buses) > 1 else "", name) if name else drive.link.name

    # Stop

    def stop_ahead(self) -> None:
        """Write the stop onto every wire, from any thread, whatever the loop does; `stop` must follow in the loop."""
        exits: list[SystemExit] = []  # of a byte pipe by others; the thread of the key goes on
        for name, bus in list(self.buses.items()):
            with isolated(f"the stop of {name}", exits=exits):
                bus.stop_ahead()
        self.doubted = ""  # the key comes

    def stop(self, why: str = "stop", follows: bool = True) -> None:
        """Stop every drive and everything that runs, and latch. Synchronous; at any time, any number of times.

        `follows`: it may be the one that follows a call of `stop_ahead`.
        """
        self.stops, self.stopped_at = self.stops + 1, self.now()
        self._closed_in_doubt.clear()
        halts: list[Halt] = []
        exits: list[SystemExit] = []
        for bus in list(self.buses.values()):  # each wire by itself
            with isolated(f"the stop of {bus.name}", exits=exits):
                halts.append(bus.halt(follows=follows))
        self.latched = True
        self.tasks.stop()
        self.questions.open.stop()
        for halt in halts:
            with isolated(f"the stop of {halt.link.name}", exits=exits):
                self.buses[halt.link.name].halted(halt)
        for drive in (each for bus in self.buses.values() for each in bus.all_drives):
            drive.motions.stopped(None)
        with isolated("the notice of a stop", exits=exits):
            unreached = stop_report.unreached(halts, self.now())
            opening = _still_opening(self.opening, self.stops)
            sent = "stop" if not (unreached or opening) and len(halts) == len(self.buses) else "stop not"
            to_all = f"{sent} sent to every drive" if halts or unreached or opening else "no drive is open"
            self.notify(f"{why}: {to_all}; macros and scripts wait for /resume")
            for text in (*unreached, *map(stop_report.not_open, opening)):
                self.notify(text, warning=True)
            for bus, record in self._open.items():
                if record.raw is not None:
                    name = bus.name
                    text = f"{name}: raw, so the stop of {bus.roster.family.name} was sent, and no drive was asked"
                    self.notify(text, bus=name, warning=True)
            for name, bus in self.buses.items():
                if name in self.reconnections.trying and bus.link.lost is not None:
                    text = f"{name}: the stop is the first to be sent when the line is back"
                    self.notify(text, bus=name, warning=True)
            self.changed()
        if exits:
            raise exits[0]

    def resume(self) -> None:
        """Let automation run again. A person who types it agrees to a stop key that did not come."""
        self.latched, self.doubted = False, ""
        self._closed_in_doubt.clear()
        self.changed()

    def tally(self) -> stop_report.FateTally:
        """The state of every drive since the last stop, as far as it was read."""
        # While a search has the port of a line, the stop reaches it there.
        buses = [bus for bus, record in self._open.items() if record.searched_until < float("inf")]
        tally = _tally_of(self, buses, _still_opening(self.opening, self.stops))
        closed = tuple(fate for fate in self._closed_in_doubt if fate.bus not in self.buses)
        return replace(tally, found=(*tally.found, *closed))

    # Activity

    @property
    def busy(self) -> bool:
        """True if anything runs that a stop would end: a script, a macro, a wait, a download."""
        return self.tasks.busy

    @property
    def recording(self) -> str:
        """The name of the macro that is being recorded, or an empty string."""
        return self.recorder.name

    def _on_bus(self, bus: Bus, event: BusEvent) -> None:
        name, record = bus.link.name, self._open.get(bus)
        if record is not None and record.annotators and isinstance(event, Unsolicited):
            for annotate in record.annotators:
                event = event._replace(lines=tuple(map(annotate, event.lines)))
        shown_as_bytes = record is not None and record.raw is not None and isinstance(event, Unsolicited)
        if self.subscribers[type(event)] and not shown_as_bytes:
            self.subscribers.call(type(event), OnBus(name, event))
        if isinstance(event, Lost):
            if self.reconnections.lost(self.buses[name]):  # wanted and possible: tried again
                self.notify(f"{name}: {event.error}; trying again", bus=name, warning=True)
            else:
                self.publish(Failed(event.at, str(event.error), name))
        elif isinstance(event, Notice):
            text = event.text if event.text.startswith(name) else f"{name}: {event.text}"
            self.publish(Notified(event.at, text, name, event.warning, address=event.address, rested=event.rested))
        elif isinstance(event, Changed):
            self.publish(StateChanged(event.at))
            self.hooks.tell(self.hooks.changed, bus)


def _tally_of(workspace: Workspace, buses: Iterable[Bus], opening: Iterable[str] = ()) -> stop_report.FateTally:
    at = workspace.wall(workspace.stopped_at if workspace.stops else workspace.now())
    return stop_report.of_buses(buses, at, workspace.stopped_at, len(workspace.buses) > 1, opening)


def _in_order(opened: dict[Bus, OpenBus]) -> tuple[dict[Bus, OpenBus], dict[str, Bus]]:
    """The open buses in the order of their places, by bus and by name."""
    ordered = dict(sorted(opened.items(), key=lambda each: each[1].place))
    return ordered, {bus.name: bus for bus in ordered}


def _still_opening(opening: list[BeingOpened], number: int) -> list[str]:
    """The URLs that were being opened at the last stop and still are. `number`: of stops so far."""
    return [each.url for each in opening if each.stops != number]


async def _close(bus: Bus, reconnections: Reconnections) -> None:
    await reconnections.remove(bus.name)
    await bus.close()


def address_of(workspace: Workspace, drive: Drive) -> str:
    """The drive's name for a program: `b`, or `press:b` where several buses are open, whatever a person calls it."""
    return workspace.qualified_address(drive) if drive.address else drive.link.name


def _present(bus: Bus, drive: Drive | None) -> Drive | None:
    """The drive, if it is on the bus, under whatever address it has by now (DN, PY)."""
    return drive if drive is not None and bus.drives.get(drive.address) is drive else None


def _find(bus: Bus, address: str) -> Drive | None:
    if address in bus.drives:
        return bus.drives[address]
    return next((drive for drive in bus.drives.values() if drive.label == address), None)
