"""Session: everything that is open, and the one path of a command.

A front end holds one Session, hands it typed lines and shows the events that it is told; it adds nothing of its
own. Buses, drives and their events belong to `drives`; macros to `macros`; verbs stand in `shell.verbs.commands`.

What takes time (a verb, a script, a macro, a wait) runs as a task that `stop` knows. `stop` is synchronous: first the
bytes go onto every wire, each by itself; then the latch falls, those tasks are cancelled, and last it is told of. None
of these steps is kept back by one that fails. Whoever waits for such a task is told Stopped.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Coroutine
from contextvars import ContextVar
from datetime import datetime, timedelta
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from dialects import Diagnostic, DriveError, NoAnswer, Stopped
from drives.apart import apart
from drives.events import BusEvent, Changed, Notice, Unsolicited
from shell import stops
from shell.automation import Automations
from shell.events import (
    By,
    Entered,
    Failed,
    Notified,
    OnBus,
    Output,
    Printed,
    SessionEvent,
    StateChanged,
)
from shell.lines import EVERYONE, DriveLine, VerbLine, join_target, parse
from shell.naming import described, free, named
from transports import TransportLost

if TYPE_CHECKING:
    from drives.bus import Bus
    from drives.drive import Drive
    from drives.stopping import Halt
    from macros import MacroStore, Recorder
    from shell.connect.opening import Opened, Opener
    from shell.connect.settings import Settings
    from shell.log import SessionLog
    from shell.plots.plotting import Plotting

T = TypeVar("T")
Callback = Callable[[SessionEvent], None]
FAILURES = (DriveError, Diagnostic, TransportLost)
"""What `Session.run` raises, each with one line for a person; anything else is a bug."""
_told: ContextVar[list[BaseException] | None] = ContextVar("told", default=None)
"""The failures that were told of while the outermost `run` of this task goes on."""


class Session:
    """Everything that is open. Needs a running event loop, and is used from its thread only."""

    def __init__(self, settings: Settings | None = None, opener: Opener | None = None) -> None:
        from macros import MacroStore, Recorder
        from shell.connect.opening import open_buses
        from shell.connect.settings import Settings

        self.settings = settings or Settings()
        self.buses: dict[str, Bus] = {}
        """By name, in the order in which they were opened."""
        self.selected_bus = ""
        """The selected bus's name; empty while nothing is open."""
        self.latched = False
        """A stop stands: macros and scripts are refused until `resume`."""
        self.stops = 0
        """Stops so far. A front end notes the count as a line is typed: no line from before a stop is sent after it."""
        self.stopped_at = float("-inf")
        """When the last stop was, s of the session's clock."""
        self.automations = Automations(self)
        self.moved: set[tuple[str, str]] = set()
        """(bus, address) of every drive that this session has addressed; `/wait` waits for them."""
        self.macros: MacroStore = MacroStore(self.settings.macros)
        """The macros kept in the user's configuration folder."""
        self.recorder: Recorder = Recorder()
        self.log: SessionLog | None = None
        self.plots: list[Plotting] = []
        """What is being plotted; ended when the session closes."""
        self.floors: dict[str, Any] = {}
        """The shop floors of simulated buses, by bus."""
        self.playing: list[str] = []
        """The macros that are playing; one within another stands behind it."""
        self.quitting = False
        """Somebody said `/quit`: front ends end, scripts too."""
        self.ready: Callable[[], Awaitable[None]] | None = None
        """Awaited before each line is run: a front end whose output is not taken holds back what would print more."""
        self.before_quit: Callable[[], Awaitable[bool]] | None = None
        """Asked by `/quit` at a terminal: whether to end now."""
        self._opener = opener or partial(open_buses, state=self.settings.state)
        self._addresses: dict[str, str] = {}
        self._callbacks: list[Callback] = []
        self._unwatch: dict[str, Callable[[], None]] = {}
        self._stoppable: set[asyncio.Task[Any]] = set()
        self._stopped: set[asyncio.Task[Any]] = set()
        self._background: set[asyncio.Task[Any]] = set()

    # What is open

    async def open(self, url: str, name: str | None = None) -> list[Bus]:
        """Open a URL or saved connection and find its drives; `sim:` may open several buses. Moves nothing.

        Raises Diagnostic for a wrong URL, Unreachable (a TransportLost) where there is no connection, DriveError
        where drives that the URL names do not answer.
        """
        from shell.connect.urls import parse as parse_url

        connection = parse_url(url, self.settings.connections)
        taken = set(self.buses)

        def naming(base: str) -> str:
            chosen = free(named(base, name, taken, set(self.buses)), taken)
            taken.add(chosen)
            return chosen

        found = await self._opener(connection, naming)
        async with contextlib.AsyncExitStack() as failing:
            for each in found:
                failing.push_async_callback(self._forget, each.bus)
            for each in found:
                self._adopt(each)
            for each in found:
                await self._identify(each, connection.labels)
            failing.pop_all()
        self.changed()
        return [each.bus for each in found]

    def _adopt(self, opened: Opened) -> None:
        """From here on a stop reaches it."""
        bus = opened.bus
        self.buses[bus.name] = bus
        if opened.floor is not None:
            self.floors[bus.name] = opened.floor
        self._unwatch[bus.name] = bus.watch(partial(self._on_bus, bus.name))
        for text in opened.warnings:
            self.notify(f"{bus.name}: {text}", bus=bus.name, warning=True)
        bus.start()

    async def _identify(self, opened: Opened, labels: Any) -> None:
        bus = opened.bus
        found = await bus.identify(opened.hints)
        for drive in found:
            sole = next(iter(labels.values()), "") if len(found) == len(labels) == 1 else ""
            drive.label = labels.get(drive.address, sole)
        self._addresses[bus.name] = next(iter(bus.drives), "")
        self.selected_bus = self.selected_bus or bus.name
        self.notify(described(bus), bus=bus.name)

    async def close_bus(self, name: str) -> None:
        """Close one bus; moves nothing, stops nothing. Raises Diagnostic for a name that is not open."""
        await self._forget(self._bus(name))
        self.changed()

    async def _forget(self, bus: Bus) -> None:
        self.buses.pop(bus.name, None)
        self.floors.pop(bus.name, None)
        self._addresses.pop(bus.name, None)
        self.moved = {key for key in self.moved if key[0] != bus.name}
        if unwatch := self._unwatch.pop(bus.name, None):
            unwatch()
        if self.selected_bus == bus.name:
            self.selected_bus = next(iter(self.buses), "")
        await bus.close()

    async def close(self) -> None:
        """Close everything: what runs, plots, log, buses. Moves nothing, stops no drive. Twice does no harm."""
        for task in [*self._background]:
            task.cancel()
        await asyncio.gather(*self._background, return_exceptions=True)
        for plotting in list(self.plots):
            with contextlib.suppress(Diagnostic):  # why it ended was told when it did
                await plotting.end()
        if self.log is not None:
            self.log.close()
            self.log = None
        for bus in list(self.buses.values()):
            await self._forget(bus)

    # The path of a command

    async def run(self, line: str, by: By = By.OPERATOR, since: int | None = None) -> None:
        """Run one line, as DESIGN's path of a command has it. What it prints goes out as events.

        `since` is what `stops` was when the line was typed; a line older than the last stop is refused with Stopped.
        Raises DriveError, Diagnostic or TransportLost, after a Failed event has told of it once.
        """
        if self.ready is not None:
            await self.ready()
        target = DriveLine("")
        token = None if _told.get() is not None else _told.set([])
        try:
            if since is not None and since != self.stops:
                raise Stopped(f"a stop came after '{line.strip()}' was typed; it was not sent")
            parsed = parse(line)
            if isinstance(parsed, DriveLine):
                target = parsed
                await self._run_text(line.strip(), parsed, by)
            elif parsed is not None:
                await self._run_verb(line.strip(), parsed, by)
        except FAILURES as failure:
            bus = target.bus or self.selected_bus
            self._fail(failure, bus, target.address or "")
            if isinstance(failure, DriveError) and target.text and len(self.buses) > 1:
                failure.add_note(bus)
            raise
        finally:
            if token is not None:
                _told.reset(token)

    async def _run_verb(self, line: str, parsed: VerbLine, by: By) -> None:
        from shell.verbs.commands import Call, find

        self._emit(Entered(self.now(), line, by))
        verb = find(parsed.name)
        call = Call(self, verb, parsed.rest, by)
        self._allow(by)
        if verb.recorded is not None and by is not By.MACRO:
            self.recorder.keep(verb.recorded(call), self.now())
        work = verb.function(call)
        await (work if verb.immediate else self.stoppable(work))

    async def _run_text(self, line: str, parsed: DriveLine, by: By) -> None:
        bus = self._bus(parsed.bus)
        drive = self.drive(bus.name, parsed.address)
        self._emit(Entered(self.now(), line, by, bus.name, drive.address))
        self._allow(by)
        if by is not By.MACRO:
            target = self.qualified_address(drive)
            self.recorder.keep(f"@{target} {parsed.text}" if target else parsed.text, self.now())
        if self.recording:
            self.changed()
        self.moved.add((bus.name, drive.address))
        printed = await self._sent(drive, parsed.text)
        if drive.address not in (*EVERYONE, *bus.drives):
            bus.drives[drive.address] = drive  # it answered, so it is there: a stop and a wait must know it
            self.changed()
        for text in printed:
            self._emit(Printed(self.now(), bus.name, drive.address, text))

    async def _sent(self, drive: Drive, text: str) -> tuple[str, ...]:
        """Send a line; what it printed. Automation notes first what it may start by that."""
        noted, before = drive.starts(text) and self.automations.starts(drive), drive.commands
        try:
            return await drive.send(text)
        except DriveError:
            if noted and drive.commands == before and drive.address not in EVERYONE:
                self.automations.spares(drive)
            raise

    def _allow(self, by: By) -> None:
        if self.latched and by is not By.OPERATOR:
            raise Stopped("stopped; /resume lets macros and scripts run again")

    def qualified_address(self, drive: Drive) -> str:
        """A drive's address so that it means the same whatever is selected later; empty where only one can be meant."""
        return join_target(drive.bus.name if len(self.buses) > 1 else "", drive.address)

    def start(self, line: str, by: By = By.OPERATOR, since: int | None = None) -> asyncio.Task[bool]:
        """Run one line in the background; whether it was done. A failure goes out as a Failed event and is not raised.

        `since` as for `run`; unless given, the line counts as typed now.
        """
        task = asyncio.get_running_loop().create_task(self._quietly(line, by, self.stops if since is None else since))
        self._background.add(task)
        task.add_done_callback(self._background.discard)
        return task

    async def _quietly(self, line: str, by: By, since: int) -> bool:
        try:
            await self.run(line, by, since)
        except FAILURES:
            return False  # told by the Failed event
        return True

    def stop_ahead(self) -> None:
        """Write the stop onto every wire, from any thread, whatever the loop does; `stop` must follow in the loop."""
        for bus in list(self.buses.values()):
            with apart(f"the stop of {bus.name}"):
                bus.stop_ahead()

    def stop(self, why: str = "stop") -> None:
        """Stop every drive and everything that runs, and latch. Synchronous; at any time, any number of times."""
        self.stops, self.stopped_at = self.stops + 1, self.now()
        halts: list[Halt] = []
        for bus in list(self.buses.values()):
            with apart(f"the stop of {bus.name}"):
                halts.append(bus.halt())
        self.latched = True
        for task in self._stoppable - {_current()}:
            self._stopped.add(task)
            task.cancel()
        for halt in halts:
            with apart(f"the stop of {halt.bus.name}"):
                halt.bus.halted(halt)
        with apart("telling of a stop"):
            self._tell_of_stop(why, halts)

    def _tell_of_stop(self, why: str, halts: list[Halt]) -> None:
        unreached = stops.unreached(halts, self.now())
        every = "every drive is" if not unreached and len(halts) == len(self.buses) else "not every drive is"
        self.notify(f"{why}: {every} told to stop; macros and scripts wait for /resume")
        for text in unreached:
            self.notify(text, warning=True)
        self.changed()

    def resume(self) -> None:
        """Let automation run again."""
        self.latched = False
        self.changed()

    def interrupt(self) -> None:
        """End everything that runs, and stop at once what automation has started, nothing else. Does not latch."""
        self.automations.interrupt()
        for task in self._stoppable - {_current()}:
            task.cancel()

    def tally(self) -> stops.Tally:
        """What is known of every drive since the last stop."""
        buses = self.buses.values()
        at = self.wall(self.stopped_at if self.stops else self.now())
        return stops.of_buses(buses, at, self.stopped_at, len(self.buses) > 1)

    async def stoppable(self, work: Coroutine[Any, Any, T]) -> T:
        """Await work that `stop` ends; Stopped is raised then."""
        task = asyncio.get_running_loop().create_task(work)
        self._stoppable.add(task)
        self.changed()
        try:
            return await task
        except asyncio.CancelledError:
            if task in self._stopped:
                raise Stopped("stopped before it was done") from None
            raise
        finally:
            self._stoppable.discard(task)
            self._stopped.discard(task)
            self.changed()

    @property
    def busy(self) -> bool:
        """Whether anything runs that `stop` would end: a script, a macro, a wait, a download."""
        return bool(self._stoppable)

    @property
    def at_rest(self) -> bool:
        """Whether nothing runs, and every drive that was ever read stood when it was last."""
        drives = [drive for bus in self.buses.values() for drive in bus.all_drives]
        return not self.busy and not any(drive.seen is not None and drive.seen.velocity for drive in drives)

    # Selection

    @property
    def selected(self) -> Drive | None:
        """The drive that plain text goes to."""
        bus = self.buses.get(self.selected_bus)
        if bus is None:
            return None
        return bus.drives.get(self._addresses.get(self.selected_bus, ""))

    @property
    def place(self) -> tuple[str, str]:
        """The names of the selected bus and of the selected drive on it; empty where there is none."""
        selected = self.selected
        return self.selected_bus, selected.address if selected is not None else ""

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive by address or label on a bus (the selected one where none is named).

        An empty address selects the bus and the drive that was last selected there. Raises Diagnostic.
        """
        chosen = self._bus(bus)
        if address:
            found = self._find(chosen, address)
            if found is None:
                known = ", ".join(chosen.drives) or "none"
                raise Diagnostic(f"no drive {address} on {chosen.name}", hint=f"its drives are {known}")
            self._addresses[chosen.name] = found.address
        self.selected_bus = chosen.name
        self.changed()

    def drive(self, bus: str = "", address: str | None = None) -> Drive:
        """The drive at an address (or label) of a bus, known or not; the selected one where none is given."""
        chosen = self._bus(bus)
        if address is None:
            selected = chosen.drives.get(self._addresses.get(chosen.name, ""))
            if selected is None:
                raise NoAnswer(f"{chosen.name}: no drive has answered here; @ADDR TEXT sends to one all the same")
            return selected
        found = self._find(chosen, address)
        sole = chosen.drives.get("")
        if found is None and sole is not None:
            if address in EVERYONE:
                return sole
            hint = f"@{chosen.name}: TEXT goes to it"
            raise Diagnostic(f"the drive on {chosen.name} takes no address, so {address} is none", hint=hint)
        return found or chosen.at(address)

    def addressed(self) -> list[Drive]:
        """The drives that this session has sent anything to, else the selected one; `*` means all of a bus."""
        found: dict[tuple[str, str], Drive] = {}
        for bus, address in sorted(self.moved):
            drives = self.buses[bus].drives
            for each in drives if address in EVERYONE else [address]:
                if each in drives:
                    found[bus, each] = drives[each]
        return list(found.values()) or [self.drive()]

    def _bus(self, name: str) -> Bus:
        if not self.buses:
            raise Diagnostic("nothing is open", hint="/open URL opens a line of drives")
        found = self.buses.get(name or self.selected_bus)
        if found is None and not name:
            raise Diagnostic("nothing is open yet", hint=f"{', '.join(self.buses)} is being opened")
        if found is None:
            raise Diagnostic(f"no bus {name} is open", hint=f"open are {', '.join(self.buses)}")
        return found

    @staticmethod
    def _find(bus: Bus, address: str) -> Drive | None:
        if address in bus.drives:
            return bus.drives[address]
        return next((drive for drive in bus.drives.values() if drive.label == address), None)

    def display_name(self, drive: Drive) -> str:
        """What a drive is called where several may be meant: `b`, or `press:b` where several buses are open."""
        if not drive.address:
            return drive.bus.name
        return self.qualified_address(drive)

    # What goes on

    async def in_motion(self) -> list[str]:
        """A line for each drive that moves, or may; takes two seconds at most."""
        from shell.leaving import in_motion

        return await in_motion(self)

    def quit(self) -> None:
        """Ask the front end to end; drives go on as they are."""
        self.quitting = True
        self.changed()

    @property
    def recording(self) -> str:
        """The name of the macro that is being recorded, or an empty string."""
        return self.recorder.name

    def subscribe(self, callback: Callback) -> Callable[[], None]:
        """Call back with every event, from the event loop; what is returned ends it."""
        self._callbacks.append(callback)

        def leave() -> None:
            if callback in self._callbacks:
                self._callbacks.remove(callback)

        return leave

    def now(self) -> float:
        """The session's clock, s: the event loop's."""
        return asyncio.get_running_loop().time()

    def wall(self, at: float) -> datetime:
        """The time of day of a session time, in the local zone."""
        return datetime.now().astimezone() - timedelta(seconds=self.now() - at)

    def output(self, text: str, *, columns: bool = False) -> None:
        """A line of a verb's result: it goes where replies go. `columns`: a screen breaks it between words."""
        self._emit(Output(self.now(), text, columns))

    def notify(self, text: str, *, bus: str = "", warning: bool = False) -> None:
        """A line about what goes on, for a person."""
        self._emit(Notified(self.now(), text, bus, warning))

    def changed(self) -> None:
        """Tell the front ends to look again."""
        self._emit(StateChanged(self.now()))

    def _fail(self, failure: BaseException, bus: str, address: str) -> None:
        """Tell of a failure once, however many lines (a macro's, the `/play` around it) it passes through."""
        told = _told.get()
        if told is None or failure not in told:
            self._emit(Failed(self.now(), str(failure), bus, address))
        if told is not None:
            told.append(failure)

    def _lost(self, name: str) -> str:
        bus = self.buses.get(name)
        return str(bus.lost) if bus is not None and bus.lost is not None else ""

    def _on_bus(self, name: str, event: BusEvent) -> None:
        self._emit(OnBus(name, event))
        if isinstance(event, Unsolicited):
            self._emit(Printed(event.at, name, "", event.text, solicited=False))
        elif isinstance(event, Notice) and self._lost(name) == event.text:
            self._emit(Failed(event.at, event.text, name))
        elif isinstance(event, Notice):
            text = event.text if event.text.startswith(name) else f"{name}: {event.text}"
            self._emit(Notified(event.at, text, name, event.warning))
        elif isinstance(event, Changed):
            self._emit(StateChanged(event.at))

    def _emit(self, event: SessionEvent) -> None:
        for callback in list(self._callbacks):
            with apart("a front end"):
                callback(event)


def _current() -> asyncio.Task[Any] | None:
    """The task that runs now; None from a signal handler or a callback."""
    try:
        return asyncio.current_task()
    except RuntimeError:
        return None
