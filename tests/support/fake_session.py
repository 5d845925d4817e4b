"""A small Session for the screen's tests: fixed buses, a clock that stands still, and a list of the lines that were
run.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from textual.pilot import Pilot

from multidrop.base.errors import Diagnostic, DriveError, Stopped, TransportLost
from multidrop.dialects import DriveState
from multidrop.dialects.families import FAMILIES, family_of
from multidrop.dialects.family import Family
from multidrop.dialects.units import Basis
from multidrop.dialects.units import scale as scale_of
from multidrop.dialects.values import UNREAD, Conditions, Lamp, Pace
from multidrop.drives.events import Conditioned, Sample, Silent, Unsolicited
from multidrop.drives.stopping import Fate
from multidrop.drives.telemetry import DriveValue
from multidrop.shell.channel import Front
from multidrop.shell.configuration import Settings
from multidrop.shell.events import By, Entered, Failed, Notified, OnBus, Printed, SessionEvent, StateChanged
from multidrop.shell.line_syntax import Place, TypedLine, VerbLine
from multidrop.shell.origin import PERSON, Origin
from multidrop.shell.prompt.complete import Completion
from multidrop.shell.roles import RunningPlot, Series
from multidrop.shell.state.backups import Drafts
from multidrop.shell.stop_report import DriveFate, FateTally
from multidrop.shell.units import ScaledAxis, SessionUnits
from multidrop.transports import Unreachable
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist, StartEntry
from multidrop.tui.screens.dialogs import Over
from multidrop.tui.screens.page import Framed
from multidrop.tui.widgets.theme import Signs


@dataclass
class FakeDrive:
    address: str
    label: str = ""
    product: str = "LMDCM"
    version: str = "6.002"
    link: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(name="press"))
    programming: bool = False
    stores: bool = False
    unreferenced: frozenset[str] = frozenset()

    def check_line(self, text: str) -> None:
        """Take any line."""

    @property
    def family(self) -> Family:
        return family_of(self.state)

    @property
    def state(self) -> DriveState:
        family = FAMILIES["mcode"]
        state = family.new_state(family.codec, self.address)
        state.reference_lost(self.unreferenced)
        return state


@dataclass
class FakeSubscription:
    telemetry: FakeTelemetry
    addresses: tuple[str, ...]
    period: float

    def close(self) -> None:
        for held in (self.telemetry.held, self.telemetry.watches):
            if self in held:
                held.remove(self)


@dataclass
class FakeTelemetry:
    held: list[FakeSubscription] = field(default_factory=list)
    watches: list[FakeSubscription] = field(default_factory=list)

    def watch(self, addresses: Sequence[str], period: float = 0.0) -> FakeSubscription:
        watch = FakeSubscription(self, tuple(addresses), period)
        self.watches.append(watch)
        return watch

    def subscribe(self, addresses: Sequence[str], period: float = 0.0) -> FakeSubscription:
        subscription = FakeSubscription(self, tuple(addresses), period)
        self.held.append(subscription)
        return subscription

    def read(self, values: Sequence[DriveValue], period: float = 0.0) -> FakeSubscription:
        subscription = FakeSubscription(self, tuple(f"{each.address}.{each.word}" for each in values), period)
        self.held.append(subscription)
        return subscription

    @property
    def watched(self) -> dict[str, float]:
        return {address: watch.period for watch in self.watches for address in watch.addresses}

    @property
    def polled(self) -> dict[str, float]:
        return {address: held.period for held in self.held for address in held.addresses}


@dataclass(eq=False)
class FakeBus:
    name: str
    drives: dict[str, FakeDrive]
    lost: Exception | None = None
    silent: str = ""
    telemetry: FakeTelemetry = field(default_factory=FakeTelemetry)


@dataclass(frozen=True)
class FakeMacro:
    name: str
    key: str = ""
    note: str = ""
    page: str = "1"
    lines: tuple[str, ...] = ("MA 0", "/wait stopped", "MA 51200")
    values: str = ""

    @property
    def length(self) -> str:
        return f"{len(self.lines)} lines"


class FakeMacros:
    def __init__(self, *macros: FakeMacro) -> None:
        self.kept = {macro.name: macro for macro in macros}

    def names(self) -> list[str]:
        return list(self.kept)

    def load(self, name: str) -> FakeMacro:
        if name not in self.kept:
            raise Diagnostic(f"no macro {name}")
        return self.kept[name]

    def path(self, name: str) -> Path:
        return Path("/nowhere") / f"{name}.toml"


class FakeUnits(SessionUnits):
    """The scales of drives, by address and axis, with what they rest on: 51200 steps a turn."""

    def __init__(self) -> None:
        self.shown = True
        self.given_axes: dict[tuple[str, str], ScaledAxis] = {}

    def give(self, address: str, scale: str | dict[str, Any], axis: str = "", turn: int = 51200) -> ScaledAxis:
        found = self.given_axes[address, axis] = ScaledAxis(scale_of(scale))
        found.accept(Basis((("MS", "256"),), Fraction(turn)))
        return found

    def last_read(self, drive: Any, axis: str, full_steps: int | None) -> Basis | None:
        return Basis((("MS", "256"),), Fraction(51200))

    def of(self, drive: Any, axis: str = "") -> ScaledAxis | None:
        return self.given_axes.get((drive.address, axis))

    @property
    def own(self) -> tuple[str, ...]:
        return ()

    def referenced(self, drive: Any, axis: str) -> bool:
        return not drive.unreferenced & {axis, ""}


class FakeTabs:
    def __init__(self, session: FakeSession) -> None:
        self._session = session

    @property
    def shown(self) -> list[FakeBus]:
        return list(self._session.buses.values())

    def missing(self, bus: FakeBus) -> bool:
        return bus.lost is not None


class FakeSession:
    """A session whose `lines` were run; a line in `refuses` fails; `gate` holds every line until it is set."""

    def __init__(self, *buses: FakeBus, macros: Sequence[FakeMacro] = ()) -> None:
        self.buses = {bus.name: bus for bus in buses}
        self.shown: list[object] = []
        """What a person was shown of the files of the lines that were started with it."""
        self.selected_bus = buses[0].name if buses else ""
        self.addresses = {bus.name: next(iter(bus.drives), "") for bus in buses}
        self.tabs = FakeTabs(self)
        self.reconnections = SimpleNamespace(trying=[])
        self.openings = SimpleNamespace(url_of=lambda bus: f"sim:#{bus.name}")
        self.units = FakeUnits()
        self.scaled = True
        self.settings = Settings()
        self.raw: set[str] = set()
        self.latched = False
        self.recording = ""
        self.playing: list[SimpleNamespace] = []
        self.log = None
        self.busy = False
        self.quitting = False
        self.macros = FakeMacros(*macros)
        self.time = 67.0
        self.lines: list[tuple[str, By]] = []
        self.sent: list[str] = []
        """Each line with the drive that was selected at its start."""
        self.refuses: dict[str, str] = {}
        self.gate: asyncio.Event | None = None
        self.slow = 0
        """Number of turns of the loop that a line takes."""
        self.stops = self.ahead = 0
        self.interrupts = 0
        self.fates: dict[str, Fate] = {}
        self.moves: list[str] = []
        """The result of `in_motion`."""
        self.front = Front()
        self.plots: list[RunningPlot] = []
        self.plotted: tuple[Series, ...] = ()
        self.predicted: set[object] = set()
        self.openable: dict[str, FakeBus] = {}
        self._callbacks: list[Callable[[SessionEvent], None]] = []
        self._tasks: set[asyncio.Task[bool]] = set()

    @property
    def selected(self) -> FakeDrive | None:
        bus = self.buses.get(self.selected_bus)
        return bus.drives.get(self.addresses.get(self.selected_bus, "")) if bus else None

    @property
    def place(self) -> Place:
        selected = self.selected
        return Place(self.selected_bus, selected.address if selected is not None else "")

    def of_demo(self, bus: str) -> str:
        return bus if bus in self.buses else ""

    def of(self, bus: FakeBus) -> SimpleNamespace:
        return SimpleNamespace(connection=None)

    def qualified_address(self, drive: FakeDrive) -> str:
        return f"{self.selected_bus}:{drive.address}"

    async def open(self, url: str, name: str | None = None, *, raw: bool = False) -> list[FakeBus]:
        if url not in self.openable:
            raise Unreachable(f"{url}: no such port")
        bus = self.openable[url]
        self.buses[bus.name] = bus
        self.addresses[bus.name] = next(iter(bus.drives), "")
        self.selected_bus = self.selected_bus or bus.name
        if raw:
            self.raw.add(bus.name)
        self.emit(StateChanged(self.time))
        return [bus]

    async def open_all(self, urls: Sequence[str], failed: Callable[[int, BaseException], None] | None = None) -> None:
        for number, url in enumerate(urls):
            try:
                await self.open(url)
            except Unreachable as failure:
                if failed is None:
                    raise
                failed(number, failure)

    async def run(self, line: str, origin: Origin = PERSON, since: int | None = None) -> None:
        if since is not None and since != self.stops:
            raise Stopped(f"a stop came after '{line}' was typed; it was not sent")
        if line == "/stop":
            self.stop(line)
        elif line.startswith("/use ") and line.split()[1] in self.buses:
            self.select("", line.split()[1])
        elif line.startswith("/page ") and self.front.screen is not None:
            await self.front.screen(line.split()[1])
        address = self.selected.address if self.selected else ""
        self.emit(Entered(self.time, line, origin.by, self.selected_bus, address))
        self.lines.append((line, origin.by))
        self.sent.append(f"{self.selected_bus}:{address} {line}")
        if self.gate is not None:
            await self.gate.wait()
        for _ in range(self.slow):
            await asyncio.sleep(0)
        if line.startswith("/record"):
            self.recording = "" if line.endswith(" stop") else line.split()[1]
            self.emit(StateChanged(self.time))
        if line in self.refuses:
            self.emit(Failed(self.time, self.refuses[line], self.selected_bus, address))
            raise DriveError(self.refuses[line])

    def start(self, line: str | TypedLine, origin: Origin = PERSON, since: int | None = None) -> asyncio.Task[bool]:
        text = line if isinstance(line, str) else line.typed
        if isinstance(line, VerbLine):
            self.shown.append(line.shown)
        typed = self.stops if since is None else since

        async def quietly() -> bool:
            try:
                await self.run(text, origin, typed)
            except (DriveError, Diagnostic, TransportLost):
                return False
            return True

        task = asyncio.get_running_loop().create_task(quietly())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def enter_alone(self) -> str:
        return "/bytes 0D" if self.selected_bus in self.raw else ""

    def stop_ahead(self) -> None:
        self.ahead += 1

    def stop(self, why: str = "stop", follows: bool = True) -> None:
        self.stops += 1
        self.latched = True
        self.busy = False
        self.emit(Notified(self.time, f"{why}: all drives are told to stop", warning=True))
        self.emit(StateChanged(self.time))

    def interrupt(self) -> None:
        self.interrupts += 1
        self.busy = False

    def tally(self) -> FateTally:
        found = [
            DriveFate(
                self.fates.get(f"{bus.name}:{each}", Fate.SENT), f"{bus.name}:{each}".rstrip(":"), bus.name, "lost"
            )
            for bus in self.buses.values()
            for each in bus.drives
        ]
        return FateTally(self.wall(self.time), tuple(found))

    async def in_motion(self) -> list[str]:
        return self.moves

    def quit(self) -> None:
        self.quitting = True
        self.emit(StateChanged(self.time))

    def resume(self) -> None:
        self.latched = False
        self.emit(StateChanged(self.time))

    def select(self, address: str, bus: str = "") -> None:
        self.selected_bus = bus or self.selected_bus
        if address:
            self.addresses[self.selected_bus] = address
        self.emit(StateChanged(self.time))

    def subscribe(self, callback: Callable[[SessionEvent], None], *kinds: type) -> Callable[[], None]:
        self._callbacks.append(callback)
        return lambda: self._callbacks.remove(callback)

    def now(self) -> float:
        return self.time

    def wall(self, at: float) -> datetime:
        return datetime(2026, 11, 21, 12, 40, 0) + timedelta(seconds=at)

    def emit(self, *happened: SessionEvent) -> None:
        for event in happened:
            for callback in list(self._callbacks):
                callback(event)


WORDS = {
    "MA": "move to an absolute position",
    "MR": "move relative to where it stands",
    "MS": "microsteps to a full step",
    "MV": "whether the motor moves",
    "PR": "print what stands behind it",
}


class FakeAssist(Assist):
    def __init__(self) -> None:
        self.kept = ["VM=600000", "MR 512000", "PR P"]
        self.found_ports = [StartEntry("port", "/dev/ttyUSB0", "/dev/ttyUSB0", "FTDI USB-RS422")]

    def complete(self, text: str, learned: Callable[[], None] | None = None) -> Sequence[Completion]:
        head, _, word = text.rpartition(" ")
        start = len(text) - len(word)
        return [Completion(each, WORDS[each], start) for each in WORDS if word and each.startswith(word.upper())]

    def hint(self, text: str) -> str:
        return "MR distance   move relative to where it stands" if text.startswith("MR") else ""

    def history(self) -> Sequence[str]:
        return self.kept

    def keep(self, line: str) -> None:
        self.kept.append(line)

    def saved(self) -> Sequence[StartEntry]:
        return [StartEntry("saved", "press", "press", "serial:/dev/ttyUSB0?drives=a,b,c")]

    def wrong(self) -> Sequence[StartEntry]:
        return ()

    async def ports(self) -> Sequence[StartEntry]:
        return self.found_ports

    def lately(self) -> Sequence[StartEntry]:
        return ()

    async def opened(self, url: str) -> None:
        pass

    async def scan(self, url: str, found: Callable[[str], None]) -> str:
        return url

    def verbs(self) -> Sequence[tuple[str, str, str]]:
        return ()

    def drafts(self) -> Drafts | None:
        return None

    async def prepare(self) -> None:
        pass


MOVING_TO = Conditions(
    lamps=(
        *(Lamp(str(n), function, n == 1) for n, function in enumerate(("home", "lim+", "lim-", ""), 1)),
        Lamp("ai", "2048"),
        *(Lamp(str(n), "moving" if n == 2 else "", on, output=True) for n, on in enumerate((None, True, None), 1)),
    ),
    program="running",
    runs=True,
    target=6_000_000,
    limits=(-400_000, 6_400_000),
    run_current=25,
    hold_current=5,
    pace=Pace(1000, 600_000, 1e6, 1e6),
    modes="EM1 CK1",
)
AT_LIMIT = replace(
    MOVING_TO,
    error=UNREAD,
    error_text="PR ER shows and clears it",
    program="",
    runs=False,
    target=None,
    lamps=(Lamp("1", "home", False), Lamp("2", "lim+", True)),
)


def demo_session() -> FakeSession:
    """Three buses: a party line of three, one drive on Ethernet, one that was lost."""
    party = {
        "a": FakeDrive("a", "gantry"),
        "b": FakeDrive("b", "clamp"),
        "c": FakeDrive("c"),
    }
    return FakeSession(
        FakeBus("press", party),
        FakeBus("eth", {"": FakeDrive("", "", "LMDCE")}),
        FakeBus("pmx", {"00": FakeDrive("00", "", "PMX-2ED-SA", "")}, TransportLost("tcp://10.0.0.5:503: closed")),
        macros=[FakeMacro("home-all", "F2", "all axes to their switches"), FakeMacro("shuttle", "F3")],
    )


def a_move(session: FakeSession, *, still_moving: bool = True) -> list[SessionEvent]:
    """Twelve seconds of samples: `a` at rest, accelerating to 600,000 steps/s, cruising; `b` and `c` at rest."""
    found: list[SessionEvent] = []
    position = 0.0
    for n in range(480):
        at = session.time - 12 + n * 0.025
        share = min(1.0, max(0.0, (n - 120) / 80))
        speed = 600_000 * (1 - math.cos(math.pi * share)) / 2
        position += speed * 0.025
        if not still_moving and n == 479:
            speed = 0
        found.append(OnBus("press", Sample(at, "a", int(position), int(speed))))
    found.append(OnBus("press", Sample(session.time - 0.9, "b", -51_200, 0)))
    found.append(OnBus("press", Silent(session.time - 3, "c")))
    found.append(OnBus("press", Conditioned(session.time - 0.4, "a", (MOVING_TO,))))
    found.append(OnBus("press", Conditioned(session.time - 2.4, "b", (AT_LIMIT,))))
    return found


def a_talk(session: FakeSession) -> list[SessionEvent]:
    """A short session on `press`."""
    at = session.time - 10
    return [
        Entered(at, "VM=600000", By.OPERATOR, "press", "a"),
        Entered(at + 0.4, "MR 512000", By.OPERATOR, "press", "a"),
        Entered(at + 4, "PR P", By.OPERATOR, "press", "a"),
        Printed(at + 4, "press", "a", "384112"),
        Entered(at + 7, "@b PR VX", By.OPERATOR, "press", "b"),
        Failed(at + 7, "b: 20 unknown variable or flag: VX", "press", "b"),
        OnBus("press", Unsolicited(at + 8, ("at home\x06",))),
        Entered(at + 9, "@* SL 0", By.MACRO, "press", "*"),
        Notified(at + 9, "no drive answers a global command", "press"),
    ]


def make_app(
    session: FakeSession | None = None, *urls: str, theme: str = "multidrop-dark", assist: Assist | None = None
) -> MultidropApp:
    """The app on a session; an empty theme lets the app choose."""
    app = MultidropApp(session or demo_session(), urls, assist or FakeAssist())
    app.theme = theme or app.theme
    app.act.show_signs(Signs.FULL)
    return app


@asynccontextmanager
async def on_screen(
    session: FakeSession | None = None, width: int = 80, height: int = 24
) -> AsyncIterator[tuple[Pilot[int], MultidropApp, FakeSession]]:
    """The app on a session, that of the demo unless another is given, while it runs."""
    session = session or demo_session()
    app = make_app(session)
    async with app.run_test(size=(width, height)) as pilot:
        yield pilot, app, session


async def press(pilot: Pilot[int], *keys: str) -> None:
    """Press keys, and let the screen take in what follows from them."""
    await pilot.press(*keys)
    await settle(pilot)


async def emit(pilot: Pilot[int], *happened: SessionEvent) -> None:
    """Publish events of the session, and let the screen take them in."""
    pilot.app.session.emit(*happened)  # type: ignore[attr-defined]
    await settle(pilot)


def driver_of(app: Any) -> Any:
    """The driver of an app that runs; Textual has no public name for it."""
    return app._driver


def compositor_of(screen: Any) -> Any:
    """What lays a screen out and paints it; Textual has no public name for it."""
    return screen._compositor


def painted(screen: Any) -> list[Any]:
    """The rows of a screen as they are painted."""
    return compositor_of(screen).render_strips(screen.app.size)  # type: ignore[no-any-return]


def binding_of(app: MultidropApp, key: str) -> Any:
    """What a key does now: its binding, the node of its action, and whether that is possible; None: nothing."""
    return app.keyboard._binding(key)


def toasts(app: MultidropApp) -> list[str]:
    """The notes that are shown on the screen, that in front first."""
    return [each.told for each in reversed(app.screen_stack) if isinstance(each, Over | Framed) and each.told]


def readable(pilot: Pilot[int]) -> None:
    """Keys have paused after the screen changed by itself: they count from here on."""
    pilot.app.keyboard.hear()  # type: ignore[attr-defined]


async def settle(pilot: Pilot[int]) -> None:
    """Let the screen take in everything that has happened."""
    await pilot.pause()
    for _ in range(6):
        pilot.app.tick()  # type: ignore[attr-defined]
    await pilot.pause()
