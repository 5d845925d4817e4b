"""The part of a Session that the screen uses. Tests replace it with a small one."""

from __future__ import annotations

from asyncio import Task
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from multidrop.dialects.family import Language
from multidrop.dialects.parameters import Parameters
from multidrop.dialects.values import Controls
from multidrop.drives.telemetry import Value
from multidrop.shell.channel import Fill
from multidrop.shell.events import By, SessionEvent
from multidrop.shell.lines import TypedLine
from multidrop.shell.roles import RunningPlot, Series
from multidrop.shell.stop_report import Tally
from multidrop.shell.transcripts import Transcripts


class Closable(Protocol):
    """A subscription that runs until it is closed."""

    def close(self) -> None:
        """End it."""


class TelemetryView(Protocol):
    """The polling of a bus."""

    def subscribe(self, addresses: Sequence[str], period: float) -> Closable:
        """Poll these drives until the subscription is closed."""

    def watch(self, addresses: Sequence[str], period: float) -> Closable:
        """Read the conditions of these drives until the watch is closed."""

    def read(self, values: Sequence[Value], period: float) -> Closable:
        """Read these values until the subscription is closed."""


class FamilyView(Protocol):
    """The part of a family's record that the screen uses."""

    @property
    def parameters(self) -> Parameters[Any] | None:
        """Parameters of its drives; None: the host does not read them."""

    @property
    def language(self) -> Language:
        """Help on what a person types to its drives."""

    def controls(self, state: Any, axis: str) -> Controls:
        """The controls of an axis: the lines that each sends."""


class DriveView(Protocol):
    """The part of a drive that is shown."""

    @property
    def address(self) -> str:
        """Its address on the wire; empty if none is used."""

    @property
    def label(self) -> str:
        """The name that a person gave it."""

    @property
    def product(self) -> str:
        """Its product name."""

    @property
    def version(self) -> str:
        """Its firmware version."""

    @property
    def programming(self) -> bool:
        """True if the drive stores lines instead of running them."""

    @property
    def family(self) -> FamilyView:
        """The record of its family."""

    @property
    def state(self) -> Any:
        """Its state, as its family's conversations know it."""


class BusView(Protocol):
    """The part of a bus that is shown."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def drives(self) -> Mapping[str, DriveView]:
        """Its drives by address."""

    @property
    def lost(self) -> Exception | None:
        """The reason of its loss; None while it is open."""

    @property
    def telemetry(self) -> TelemetryView:
        """Its polling."""


class MacroView(Protocol):
    """The part of a macro that is shown."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def key(self) -> str:
        """`F3`, or empty."""

    @property
    def page(self) -> str:
        """The page of its key."""

    @property
    def note(self) -> str:
        """One line about it."""

    @property
    def length(self) -> str:
        """The number of its lines, in words."""

    @property
    def lines(self) -> tuple[str, ...]:
        """Its lines, with `{NAME}` for each value."""

    @property
    def values(self) -> str:
        """The values and roles that it takes, in words. Raises Diagnostic where they are declared wrong."""


class MacrosView(Protocol):
    """The stored macros. Both methods raise Diagnostic for a file that cannot be read."""

    def names(self) -> list[str]:
        """The names of all macros."""

    def load(self, name: str) -> MacroView:
        """Load one macro."""

    def path(self, name: str) -> Path:
        """The file of a macro."""


class LogView(Protocol):
    """The session log."""

    @property
    def path(self) -> Path:
        """Its file."""

    @property
    def size(self) -> int:
        """Bytes in the file."""

    def last(self, number: int) -> list[str]:
        """The last entries without traffic, a line each."""


class ReconnectionsView(Protocol):
    """The lost buses that are tried again."""

    @property
    def trying(self) -> Collection[str]:
        """The names of the lost buses."""


class PlayingView(Protocol):
    """A macro that plays."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def step(self) -> int:
        """The step under way, from 1; 0 before the first one."""

    @property
    def steps(self) -> int:
        """The number of its steps."""

    @property
    def short(self) -> str:
        """The progress for a narrow place: `F3 2/5`."""


class Activity(Protocol):
    """The activity of a session."""

    @property
    def recording(self) -> str:
        """Name of the macro that is being recorded; empty if none is."""

    @property
    def playing(self) -> Sequence[PlayingView]:
        """The macros that play; a macro follows the one that plays it."""

    @property
    def log(self) -> LogView | None:
        """The session log; None while it is off."""

    @property
    def busy(self) -> bool:
        """True while automation runs."""

    @property
    def quitting(self) -> bool:
        """True after `/quit`."""


class SessionView(Activity, Protocol):
    """The part of a Session that the screen uses."""

    before_quit: Callable[[], Awaitable[bool]] | None
    """Called by `/quit`; returns False if the screen ends the app itself."""

    ask: Callable[[str], Awaitable[bool]] | None
    """Called for each question; returns whether the answer is yes."""

    fill: Fill | None
    """Called for each form; returns the values by name, None if it was closed."""

    renamed: Callable[[str, str], None] | None
    """Called with the name before and the name now of a bus that was renamed."""

    edit: Callable[[str], Awaitable[None]] | None
    """Called by `/macro edit` with the path of a file; raises Diagnostic."""

    screen: Callable[[str], Awaitable[None]] | None
    """Called by `/page` with the name of a page; raises Diagnostic for an unknown one."""

    transcripts: Transcripts | None
    """What the verbs for transcripts change; set by the screen."""

    plots: list[RunningPlot]
    """The plots to rerun that run."""

    plotted: tuple[Series, ...]
    """What the screen plots; empty: the selected drive."""

    @property
    def buses(self) -> Mapping[str, BusView]:
        """The open buses, in the order of opening."""

    @property
    def raw(self) -> Collection[str]:
        """The names of the buses in raw mode."""

    @property
    def reconnections(self) -> ReconnectionsView:
        """The lost buses that are tried again."""

    @property
    def selected_bus(self) -> str:
        """The name of the selected bus."""

    @property
    def selected(self) -> DriveView | None:
        """The drive that plain text goes to."""

    @property
    def latched(self) -> bool:
        """True while a stop is latched."""

    @property
    def stops(self) -> int:
        """Number of stops so far."""

    @property
    def macros(self) -> MacrosView:
        """The stored macros."""

    def of_demo(self, bus: str) -> str:
        """The name under which a bus of the demo cell is open; empty: it is not."""

    async def open(self, url: str, name: str | None = None, *, raw: bool = False) -> Any:
        """Open a URL; `raw`: look for no drives. Raises Diagnostic or TransportLost."""

    async def open_all(self, urls: Sequence[str], failed: Callable[[int, BaseException], None] | None = None) -> None:
        """Open URLs side by side; `failed` takes the number of a URL and its failure."""

    async def run(self, line: str, by: By = By.OPERATOR, since: int | None = None) -> None:
        """Run a line that was typed after `since` stops. Raises its failure."""

    def start(self, line: str | TypedLine, by: By = By.OPERATOR, since: int | None = None) -> Task[bool]:
        """Run a line in the background; the task returns whether it was done."""

    def enter_alone(self) -> str:
        """The line that Enter alone stands for on the selected bus; empty: none."""

    def stop_ahead(self) -> None:
        """Write the stop to every wire, from any thread; `stop` must follow in the loop."""

    def stop(self, why: str = "stop") -> None:
        """Stop everything, now."""

    def interrupt(self) -> None:
        """End what runs, and stop what automation has started."""

    def tally(self) -> Tally:
        """The facts about every drive since the last stop."""

    async def in_motion(self) -> list[str]:
        """A line for each drive that moves, or may; takes two seconds at most."""

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive. Raises Diagnostic."""

    def subscribe(self, callback: Callable[[SessionEvent], None]) -> Callable[[], None]:
        """Subscribe to all events; call the result to unsubscribe."""

    def now(self) -> float:
        """The session's clock in seconds."""

    def wall(self, at: float) -> datetime:
        """The time of day of a session time."""


class Place(NamedTuple):
    """A drive on a bus, as selected."""

    bus: str
    address: str


def selected_place(session: SessionView) -> Place:
    """The selected drive; an empty address if no drive is selected."""
    selected = session.selected
    return Place(session.selected_bus, selected.address if selected is not None else "")
