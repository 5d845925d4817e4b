"""The parts that a session plays for what is below it, as Protocols: its commands, a log, a plot, an observer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, Protocol

from multidrop.shell.events import By

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Drive
    from multidrop.macros import Macro


NO_ROLES: Mapping[str, str] = MappingProxyType({})
"""No bus plays a role."""


DIFFERENCE = "difference"
"""The word of a series: the measured minus the predicted position of a drive with a twin, steps."""


class Series(NamedTuple):
    """A plotted drive: its position and velocity; with a `word`, the value of that word instead."""

    bus: str
    address: str
    word: str = ""

    @property
    def of_motion(self) -> bool:
        """Whether it needs samples of position and velocity."""
        return self.word in ("", DIFFERENCE)

    @property
    def text(self) -> str:
        """The text that a person types for it: `press:b.I1`."""
        target = f"{self.bus}:{self.address}"
        return f"{target}.{self.word}" if self.word else target


class Commands(Protocol):
    """The operations of the running session that a verb may use."""

    async def open(self, url: str, name: str | None = None, *, raw: bool = False) -> object:
        """Open a URL or a saved connection; `raw`: look for no drives."""

    async def close_bus(self, name: str) -> None:
        """Close a bus."""

    def url_of(self, bus: Bus) -> str:
        """The URL that opens a bus again."""

    async def run(self, line: str, by: By = By.OPERATOR, since: int | None = None) -> None:
        """Run a line."""

    async def play(
        self,
        macro: Macro,
        values: Mapping[str, str],
        *,
        times: int | None = 1,
        fast: bool = False,
        roles: Mapping[str, str] = NO_ROLES,
    ) -> None:
        """Play a macro to its end; `times` None: until it is ended. `roles`: the bus for each role."""

    async def raw_on(self, bus: Bus) -> None:
        """Put a bus into raw mode."""

    async def raw_off(self, bus: Bus) -> None:
        """End raw mode, and find the drives of a bus."""

    async def send_bytes(self, bus: Bus, data: bytes, by: By) -> None:
        """Write bytes on a bus in raw mode."""

    async def guard(self, drive: Drive, text: str, by: By = By.OPERATOR) -> None:
        """Ask before a guarded line."""

    def starting(self, drive: Drive) -> None:
        """Note that the next request can start motion or a program."""

    def quit(self) -> None:
        """Ask the front end to end."""


class Observer(Protocol):
    """The observation of a drive's program."""

    def close(self) -> None:
        """End it, and say what is left in the drive."""


class OpenLog(Protocol):
    """A log that a session writes."""

    path: Path

    @property
    def size(self) -> int:
        """Bytes in the file."""

    def last(self, number: int) -> list[str]:
        """The last entries without traffic, a line each."""

    def close(self) -> None:
        """Close the file."""


class RunningPlot(Protocol):
    """A plot that a session feeds."""

    @property
    def where(self) -> str:
        """The file or address of the plot, for a person."""

    @property
    def desk(self) -> str:
        """The line that a person types at another desk to see it; empty where that is not needed."""

    @property
    def rate(self) -> str:
        """The rate of its samples that was asked for, in words."""

    async def end(self) -> str:
        """End the plot; one line about the result. Raises Diagnostic where the plot could not be written."""


class RunningTwins(Protocol):
    """The simulated twins of drives."""

    wanted: bool
    """Each bus whose drives are found gets twins."""
    limit: int
    """The limit of a difference at rest, steps."""

    def running(self, bus: Bus) -> bool:
        """Whether a drive of a bus has a twin."""

    async def start(self, bus: Bus, addresses: Sequence[str] | None = None) -> None:
        """Read drives of a bus (None: all), and begin a twin beside each, in place of one that runs."""

    def stop(self, bus: Bus) -> None:
        """End the twins of a bus."""

    def off(self) -> bool:
        """End all twins, also those that are about to begin; return whether there were any."""

    def rows(self) -> Iterator[str]:
        """A line for each twin that runs."""

    def identified(self, bus: Bus) -> None:
        """Note that the drives of a bus are found."""

    def changed(self, bus: Bus) -> None:
        """Note that a bus has changed."""
