"""The parts of a Session that the screen uses; tests put a small one of their own in its place."""

from __future__ import annotations

from asyncio import Task
from collections.abc import Awaitable, Callable, Mapping, Sequence
from datetime import datetime
from typing import Any, NamedTuple, Protocol

from shell.events import By, SessionEvent
from shell.stops import Tally


class Closable(Protocol):
    """Something that goes on until it is closed."""

    def close(self) -> None:
        """End it."""


class TelemetryView(Protocol):
    """Polling that can be asked for."""

    def subscribe(self, addresses: Sequence[str], period: float = 0.0) -> Closable:
        """Poll these drives until the subscription is closed."""


class DriveView(Protocol):
    """What is shown of a drive."""

    @property
    def address(self) -> str:
        """Its name on the wire, `""` where none is used."""

    @property
    def label(self) -> str:
        """What a person calls it."""

    @property
    def product(self) -> str:
        """The product."""

    @property
    def version(self) -> str:
        """Its firmware."""

    @property
    def programming(self) -> bool:
        """Whether lines are stored."""


class BusView(Protocol):
    """What is shown of a bus."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def drives(self) -> Mapping[str, DriveView]:
        """By address."""

    @property
    def lost(self) -> Exception | None:
        """Why it was lost, if it was."""

    @property
    def telemetry(self) -> TelemetryView:
        """Its polling."""


class MacroView(Protocol):
    """What is shown of a macro."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def key(self) -> str:
        """`F3`, or empty."""

    @property
    def note(self) -> str:
        """One line about it."""


class MacrosView(Protocol):
    """The macros that are kept. Both raise Diagnostic for a file that cannot be read."""

    def names(self) -> list[str]:
        """All of them."""

    def load(self, name: str) -> MacroView:
        """One of them."""


class SessionView(Protocol):
    """A Session, as far as the screen uses it."""

    before_quit: Callable[[], Awaitable[bool]] | None
    """Asked by `/quit`: whether to end now."""

    @property
    def buses(self) -> Mapping[str, BusView]:
        """What is open, in the order of opening."""

    @property
    def selected_bus(self) -> str:
        """The name of the selected bus."""

    @property
    def selected(self) -> DriveView | None:
        """The drive that plain text goes to."""

    @property
    def latched(self) -> bool:
        """Whether a stop stands."""

    @property
    def stops(self) -> int:
        """The stops so far."""

    @property
    def recording(self) -> str:
        """The macro that is being recorded."""

    @property
    def busy(self) -> bool:
        """Whether automation runs."""

    @property
    def quitting(self) -> bool:
        """Whether somebody said `/quit`."""

    @property
    def macros(self) -> MacrosView:
        """The macros."""

    async def open(self, url: str, name: str | None = None) -> Any:
        """Open a URL; raises Diagnostic or TransportLost."""

    async def run(self, line: str, by: By = By.OPERATOR, since: int | None = None) -> None:
        """Run a line typed when there were `since` stops; raises what its failure is."""

    def start(self, line: str, by: By = By.OPERATOR, since: int | None = None) -> Task[bool]:
        """Run a line in the background; whether it was done."""

    def stop_ahead(self) -> None:
        """Write the stop onto every wire, from any thread; `stop` must follow in the loop."""

    def stop(self, why: str = "stop") -> None:
        """Stop everything, now."""

    def interrupt(self) -> None:
        """End what runs, and stop what automation has started."""

    def tally(self) -> Tally:
        """What is known of every drive since the last stop."""

    async def in_motion(self) -> list[str]:
        """A line for each drive that moves, or may; takes two seconds at most."""

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive; raises Diagnostic."""

    def subscribe(self, callback: Callable[[SessionEvent], None]) -> Callable[[], None]:
        """Be told of everything."""

    def now(self) -> float:
        """The session's clock."""

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
