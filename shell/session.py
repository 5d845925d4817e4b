"""Session: everything that is open, and the one path of a command.

A front end holds one Session, hands it typed lines and shows the events that it is told; it adds nothing of its
own. Buses, drives and their events belong to `drives`; macros to `macros`; verbs stand in `shell.verbs`.

What takes time (a verb, a script, a macro, a wait) runs as a task that `stop` knows. `stop` is synchronous: first the
bytes go onto every wire, then the latch falls, then those tasks are cancelled; whoever waits for one is told Stopped.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any, TypeVar

from dialects import Diagnostic, DriveError, NoAnswer, Stopped
from drives.events import BusEvent, Changed, Heard, Told
from shell.addressing import EVERYONE, DriveLine, VerbLine, join_target, parse
from shell.events import (
    By,
    Entered,
    Failed,
    Narrated,
    OnBus,
    Output,
    Printed,
    SessionEvent,
    StateChanged,
)
from transports import TransportLost

if TYPE_CHECKING:
    from drives.bus import Bus
    from drives.drive import Drive
    from macros import MacroStore, Recorder
    from shell.opening import Opened
    from shell.settings import Settings
    from shell.urls import Connection

T = TypeVar("T")
Callback = Callable[[SessionEvent], None]
Opener = Callable[["Connection"], Awaitable[list["Opened"]]]
FAILURES = (DriveError, Diagnostic, TransportLost)
"""What `Session.run` raises, each with one line for a person; anything else is a bug."""


class Session:
    """Everything that is open. Needs a running event loop, and is used from its thread only."""

    buses: dict[str, Bus]
    """By name, in the order in which they were opened."""
    selected_bus: str
    """The selected bus's name; empty while nothing is open."""
    latched: bool
    """A stop stands: macros and scripts are refused until `resume`."""
    moved: set[tuple[str, str]]
    """(bus, address) of every drive that this session has addressed; `/wait` waits for them."""

    def __init__(self, settings: Settings | None = None, opener: Opener | None = None) -> None: ...

    # What is open

    async def open(self, url: str, name: str | None = None) -> list[Bus]:
        """Open a URL or saved connection, find its drives; `sim:` may open several buses. Moves nothing.

        Raises Diagnostic for a wrong URL, Unreachable (a TransportLost) where there is no connection.
        """
        raise NotImplementedError

    async def close_bus(self, name: str) -> None:
        """Close one bus; moves nothing, stops nothing. Raises Diagnostic for a name that is not open."""

    async def close(self) -> None:
        """Close everything: recordings, plots, log, buses. Closing twice does no harm."""

    # The path of a command

    async def run(self, line: str, by: By = By.OPERATOR) -> None:
        """Run one line, as DESIGN's path of a command has it. What it prints goes out as events.

        Raises DriveError, Diagnostic or TransportLost, after a Failed event has told of it.
        """

    def start(self, line: str, by: By = By.OPERATOR) -> asyncio.Task[None]:
        """Run one line in the background. A failure goes out as a Failed event and is not raised."""
        raise NotImplementedError

    def stop(self, why: str = "stop") -> None:
        """Stop every drive and everything that runs, and latch. Synchronous; at any time, any number of times."""

    def resume(self) -> None:
        """Let automation run again."""

    # Selection

    @property
    def selected(self) -> Drive | None:
        """The drive that plain text goes to."""
        raise NotImplementedError

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive by address or label on a bus (the selected one where none is named).

        An empty address selects the bus's first drive. Raises Diagnostic for a bus that is not open.
        """

    # What goes on

    @property
    def recording(self) -> str:
        """The name of the macro that is being recorded, or an empty string."""
        raise NotImplementedError

    @property
    def macros(self) -> MacroStore:
        """The macros kept in the user's configuration folder."""
        raise NotImplementedError

    @property
    def busy(self) -> bool:
        """Whether anything runs that `stop` would end: a script, a macro, a wait, a download, a plot."""
        raise NotImplementedError

    def subscribe(self, callback: Callback) -> Callable[[], None]:
        """Call back with every event, from the event loop; what is returned ends it."""
        raise NotImplementedError

    def now(self) -> float:
        """The session's clock, s: the event loop's."""
        return asyncio.get_running_loop().time()

    def wall(self, at: float) -> datetime:
        """The time of day of a session time, in the local zone."""
        return datetime.now().astimezone() - timedelta(seconds=self.now() - at)

    # For verbs and front ends

    def output(self, text: str) -> None:
        """A line of a verb's result: it goes where replies go."""

    def narrate(self, text: str, *, bus: str = "", warning: bool = False) -> None:
        """A line about what goes on, for a person."""

    async def stoppable(self, work: Coroutine[Any, Any, T]) -> T:
        """Await work that `stop` ends; Stopped is raised then."""
        raise NotImplementedError
