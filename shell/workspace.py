"""What is open: buses and their drives, the selection, macros, log, plots; and the stop of all of it.

Verbs, plots, log, transfers and waits work on a `Workspace`. They reach the session that runs them through
`shell.roles.Commands`.

The stop has two phases. First its bytes go onto every wire, each wire by itself. Then the latch falls, running tasks
are cancelled, and the stop is published. A step that fails holds back none of the others.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic, NoAnswer
from multidrop.drives.apart import apart
from multidrop.drives.events import BusEvent, Changed, Lost, Notice, Unsolicited
from multidrop.macros import MacroStore, Recorder
from multidrop.shell import stops
from multidrop.shell.asking import Asking
from multidrop.shell.connect.reconnect import Reconnections
from multidrop.shell.connect.settings import Settings
from multidrop.shell.events import Failed, Notified, OnBus, StateChanged
from multidrop.shell.known_names import KnownNames
from multidrop.shell.lately import Lately
from multidrop.shell.lines import EVERYONE, join_target
from multidrop.shell.observing import Observing
from multidrop.shell.playing import Playing, played_by
from multidrop.shell.tasks import Tasks

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Drive
    from multidrop.drives.halt import Halt
    from multidrop.shell.connect.opening import Opened
    from multidrop.shell.raw import RawLine, Watched
    from multidrop.shell.roles import Observer, OpenLog, RunningPlot, RunningTwins, Series
    from multidrop.shell.transcripts import Transcripts
    from multidrop.simulator.serving.running import RunningFloor

LATCHED = "stopped; /resume lets macros and scripts run again"
"""The refusal of automation after a stop."""


@dataclass(frozen=True, eq=False)
class BeingOpened:
    """A URL that is being opened, and the number of stops when that began."""

    url: str
    stops: int


class Workspace(Asking):
    """What is open. Needs a running event loop, and belongs to its thread."""

    twins: RunningTwins
    """The twins of drives, which the session makes."""

    def __init__(self, settings: Settings, reconnect: bool = False) -> None:
        """Open nothing yet. `reconnect`: a bus that is lost is tried again until it is back or closed."""
        super().__init__()
        self.settings = settings
        self.buses: dict[str, Bus] = {}
        """By name, in the order of opening."""
        self.selected_bus = ""
        """The name of the selected bus; empty while nothing is open."""
        self.latched = False
        """After a stop: macros and scripts are refused until `resume`."""
        self.stops = 0
        """The number of stops. A front end notes it as a line is typed; a line older than a stop is never sent."""
        self.stopped_at = float("-inf")
        """The time of the last stop, s of the session's clock."""
        self.opening: list[BeingOpened] = []
        """What is being opened, and no stop reaches yet."""
        self.tasks = Tasks(self.changed)
        self.addressed: set[tuple[str, str]] = set()
        """(bus, address) of every drive that this session sent a line to; `/wait` waits for them."""
        self.macros = MacroStore(settings.macros, settings.project_macros)
        self.recorder = Recorder()
        self.lately = Lately()
        """What drives printed lately."""
        self.subscribe(self.lately.take)
        self.subscribe(Observing(self.recorder, lambda: self.buses).take)
        self.names = KnownNames()
        """The labels and variables that were read, for completion."""
        self.log: OpenLog | None = None
        self.plots: list[RunningPlot] = []
        self.plotted: tuple[Series, ...] = ()
        """What the screen plots; empty: the selected drive."""
        self.raw: dict[str, RawLine] = {}
        """The buses in raw mode, by name."""
        self.byte_views: dict[str, Watched] = {}
        """The buses that are not in raw mode, and whose bytes are shown."""
        self.cells: dict[str, RunningFloor] = {}
        """The running cells of simulated buses, by bus."""
        self.playing: list[Playing] = []
        """The macros that play; a macro follows the one that plays it."""
        self.dropped: list[str] = []
        """The macros whose `on_stop` lines a stop dropped; `/resume` says so."""
        self.quitting = False
        """After `/quit`: front ends end, scripts too."""
        self.ready: Callable[[], Awaitable[None]] | None = None
        """Awaited before each line: a front end holds back lines while its output is not read."""
        self.before_quit: Callable[[], Awaitable[bool]] | None = None
        """Asked by `/quit` at a terminal: True ends now."""
        self.renamed: Callable[[str, str], None] | None = None
        """Called when a bus gets another name, with the name before and the name now."""
        self.edit: Callable[[str], Awaitable[None]] | None = None
        """The front end's editor of files, in which Ctrl+X stops; None: it has none."""
        self.screen: Callable[[str], Awaitable[None]] | None = None
        """Shows a page of the screen by its name, or `tour`, or raises Diagnostic; None: there is no screen."""
        self.transcripts: Transcripts | None = None
        """The transcripts on a screen; None: there is no screen."""
        self.ports: dict[str, str] = {}
        """The name of each bus's port, the same in every session; empty for a simulated one."""
        self.places: dict[Bus, float] = {}
        """The place of each bus among the others."""
        self.reconnections = Reconnections(lambda bus, text: self.notify(text, bus=bus, warning=True), reconnect)
        """The buses that are tried again when they are lost."""
        self._selected: dict[Bus, Drive | None] = {}
        """The drive selected on each bus; None: none has replied there."""
        self._unwatch: dict[Bus, Callable[[], None]] = {}
        self.annotators: dict[str, list[Callable[[str], str]]] = {}
        """By bus: functions that add to its unsolicited lines, such as the remark of a traced line."""
        self.debuggers: dict[Drive, Observer] = {}
        """The observation of a drive's program, for the verbs that do that."""
        self._closing: set[asyncio.Future[None]] = set()

    # Buses

    def adopt(self, opened: Opened, place: int) -> None:
        """Add a bus and begin to read it; from here on a stop reaches it. Buses keep the order of their places."""
        bus = opened.bus
        self.places[bus] = place
        self.buses = dict(sorted([*self.buses.items(), (bus.name, bus)], key=lambda each: self.places[each[1]]))
        if opened.floor is not None:
            self.cells[bus.name] = opened.floor
        self._unwatch[bus] = bus.watch(partial(self._on_bus, bus))
        for text in opened.warnings:
            self.notify(f"{bus.name}: {text}", bus=bus.name, warning=True)
        bus.start()

    async def forget(self, bus: Bus) -> None:
        """Close a bus and drop everything known of it. A stop that ends the caller does not leave the port open."""
        for drive in bus.all_drives:
            if observer := self.debuggers.pop(drive, None):
                observer.close()
        self.twins.stop(bus)
        self.buses.pop(bus.name, None)
        self.cells.pop(bus.name, None)
        self._selected.pop(bus, None)
        self.places.pop(bus, None)
        self.ports.pop(bus.name, None)
        self.addressed = {key for key in self.addressed if key[0] != bus.name}
        if unwatch := self._unwatch.pop(bus, None):
            unwatch()
        for shown in (self.raw.pop(bus.name, None), self.byte_views.pop(bus.name, None)):
            if shown is not None:
                shown.close()
        if self.selected_bus == bus.name:
            self.selected_bus = next(iter(self.buses), "")
        closing = asyncio.ensure_future(_close(bus, self.reconnections))
        self._closing.add(closing)
        closing.add_done_callback(self._closing.discard)
        await asyncio.shield(closing)

    def bus(self, name: str = "") -> Bus:
        """Find an open bus by name or role; the selected one where no name is given. Raises Diagnostic."""
        name = played_by(name)
        if not self.buses:
            raise Diagnostic("nothing is open", hint="/open URL opens a line of drives")
        found = self.buses.get(name or self.selected_bus)
        if found is None and not name:
            raise Diagnostic("no bus is ready yet", hint=f"{', '.join(self.buses)} is being opened")
        if found is None:
            raise Diagnostic(f"no bus {name}", hint=f"open: {', '.join(self.buses)}")
        return found

    @property
    def cell(self) -> RunningFloor | None:
        """The simulated cell of the selected bus, or the only one that is open."""
        if self.selected_bus in self.cells:
            return self.cells[self.selected_bus]
        different = {id(cell): cell for cell in self.cells.values()}
        return next(iter(different.values())) if len(different) == 1 else None

    def of_demo(self, bus: str) -> str:
        """The name under which a bus of the demo cell is open; empty: it is not."""
        return next((name for name, each in self.buses.items() if each.link.transport.name == f"sim:#{bus}"), "")

    # Selection and addresses

    @property
    def selected(self) -> Drive | None:
        """The drive that plain text goes to."""
        bus = self.buses.get(self.selected_bus)
        return _present(bus, self._selected.get(bus)) if bus is not None else None

    @property
    def place(self) -> tuple[str, str]:
        """The names of the selected bus and of the selected drive on it; empty where there is none."""
        selected = self.selected
        return self.selected_bus, selected.address if selected is not None else ""

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive by address or label on a bus (by default the selected one).

        An empty address selects the bus and the drive that was last selected there. Raises Diagnostic.
        """
        chosen = self.bus(bus)
        if address:
            found = _find(chosen, address)
            if found is None:
                raise Diagnostic(f"no drive {address} on {chosen.name}", hint=_valid(chosen.drives))
            self._selected[chosen] = found
        self.selected_bus = chosen.name
        self.changed()

    def identified(self, bus: Bus) -> None:
        """Note that the drives of a bus are found; its first one is selected there."""
        self._selected[bus] = next(iter(bus.drives.values()), None)
        self.changed()
        self.twins.identified(bus)

    def select_first(self, bus: Bus) -> None:
        """Select a bus where no other one is selected."""
        self.selected_bus = self.selected_bus or bus.name

    def drive(self, bus: str = "", address: str | None = None) -> Drive:
        """Find the drive at an address (or label) of a bus, known or not; by default the selected one."""
        chosen = self.bus(bus)
        if address is None:
            selected = _present(chosen, self._selected.get(chosen))
            if selected is None:
                raise NoAnswer(f"{chosen.name}: no drive has replied; @ADDR TEXT sends to one all the same")
            return selected
        found = _find(chosen, address)
        sole = chosen.drives.get("")
        if found is None and sole is not None:
            if address in EVERYONE:
                return sole
            hint = f"@{chosen.name}: TEXT goes to it"
            raise Diagnostic(f"no address {address}: the drive on {chosen.name} takes none", hint=hint)
        return found or chosen.at(address)

    def addressed_drives(self) -> list[Drive]:
        """The drives that this session sent a line to, else the selected one; `*` means all of a bus."""
        found: dict[tuple[str, str], Drive] = {}
        for bus, address in sorted(self.addressed):
            drives = self.buses[bus].drives
            for each in drives if address in EVERYONE else [address]:
                if each in drives:
                    found[bus, each] = drives[each]
        return list(found.values()) or [self.drive()]

    def qualified_address(self, drive: Drive) -> str:
        """The drive's address, valid whatever is selected later; empty where only one drive can be meant."""
        return join_target(drive.link.name if len(self.buses) > 1 else "", drive.address)

    def display_name(self, drive: Drive) -> str:
        """The drive's name for a person: `b`, or `press:b` where several buses are open."""
        return self.qualified_address(drive) if drive.address else drive.link.name

    # Stop

    def stop_ahead(self) -> None:
        """Write the stop onto every wire, from any thread, whatever the loop does; `stop` must follow in the loop."""
        for bus in list(self.buses.values()):
            with apart(f"the stop of {bus.name}"):
                bus.stop_ahead()

    def stop(self, why: str = "stop") -> None:
        """Stop every drive and everything that runs, and latch. Synchronous; at any time, any number of times."""
        self.stops, self.stopped_at = self.stops + 1, self.now()
        halts = _write_stops(list(self.buses.values()))
        self.latched = True
        self.tasks.stop()
        self.questions.stop()
        for halt in halts:
            with apart(f"the stop of {halt.link.name}"):
                self.buses[halt.link.name].halted(halt)
        with apart("the notice of a stop"):
            self._publish_stop(why, halts)

    def _publish_stop(self, why: str, halts: list[Halt]) -> None:
        unreached = stops.unreached(halts, self.now())
        opening = _still_opening(self.opening, self.stops)
        sent = "stop" if not (unreached or opening) and len(halts) == len(self.buses) else "stop not"
        to_all = f"{sent} sent to every drive" if halts or unreached or opening else "no drive is open"
        self.notify(f"{why}: {to_all}; macros and scripts wait for /resume")
        for text in (*unreached, *map(stops.not_open, opening)):
            self.notify(text, warning=True)
        for name, raw in self.raw.items():
            family = raw.bus.roster.family.name
            self.notify(
                f"{name}: raw, so the stop of {family} was sent, and no drive was asked", bus=name, warning=True
            )
        for name, bus in self.buses.items():
            if name in self.reconnections.trying and bus.link.lost is not None:
                self.notify(f"{name}: the stop is the first to be sent when the line is back", bus=name, warning=True)
        self.changed()

    def resume(self) -> None:
        """Let automation run again."""
        self.latched = False
        self.changed()

    def tally(self) -> stops.Tally:
        """The state of every drive since the last stop, as far as it was read."""
        at = self.wall(self.stopped_at if self.stops else self.now())
        opening = _still_opening(self.opening, self.stops)
        return stops.of_buses(self.buses.values(), at, self.stopped_at, len(self.buses) > 1, opening)

    # Activity

    @property
    def busy(self) -> bool:
        """Whether anything runs that a stop would end: a script, a macro, a wait, a download."""
        return self.tasks.busy

    @property
    def at_rest(self) -> bool:
        """Whether nothing runs, and the last reading of every drive showed velocity 0."""
        readings = [drive.seen for bus in self.buses.values() for drive in bus.all_drives if drive.seen is not None]
        return not self.busy and not any(reading.velocity for reading in readings)

    @property
    def recording(self) -> str:
        """The name of the macro that is being recorded, or an empty string."""
        return self.recorder.name

    def _on_bus(self, bus: Bus, event: BusEvent) -> None:
        name = bus.name
        if self.annotators and isinstance(event, Unsolicited):
            for annotate in self.annotators.get(name, ()):
                event = event._replace(lines=tuple(map(annotate, event.lines)))
        if not (name in self.raw and isinstance(event, Unsolicited)):  # its bytes are shown
            self.publish(OnBus(name, event))
        if isinstance(event, Lost):
            self._lost(name, event)
        elif isinstance(event, Notice):
            text = event.text if event.text.startswith(name) else f"{name}: {event.text}"
            self.publish(Notified(event.at, text, name, event.warning))
        elif isinstance(event, Changed):
            self.publish(StateChanged(event.at))
            self.twins.changed(bus)

    def _lost(self, name: str, event: Lost) -> None:
        """Publish the loss of a bus, and begin to try it again where that is wanted and possible."""
        if self.reconnections.lost(self.buses[name]):
            self.notify(f"{name}: {event.error}; trying again", bus=name, warning=True)
        else:
            self.publish(Failed(event.at, str(event.error), name))


def _write_stops(buses: list[Bus]) -> list[Halt]:
    """Write the stop onto every wire, each wire by itself."""
    halts: list[Halt] = []
    for bus in buses:
        with apart(f"the stop of {bus.name}"):
            halts.append(bus.halt())
    return halts


def _still_opening(opening: list[BeingOpened], number: int) -> list[str]:
    """The URLs that were being opened at the last stop and still are. `number`: of stops so far."""
    return [each.url for each in opening if each.stops != number]


async def _close(bus: Bus, reconnections: Reconnections) -> None:
    await reconnections.remove(bus.name)
    await bus.close()


def _present(bus: Bus, drive: Drive | None) -> Drive | None:
    """The drive, if it is on the bus, under whatever address it has by now (DN, PY)."""
    return drive if drive is not None and bus.drives.get(drive.address) is drive else None


def _find(bus: Bus, address: str) -> Drive | None:
    if address in bus.drives:
        return bus.drives[address]
    return next((drive for drive in bus.drives.values() if drive.label == address), None)


def _valid(names: Mapping[str, object]) -> str:
    return f"valid: {', '.join(names)}" if names else "no drive has replied there"
