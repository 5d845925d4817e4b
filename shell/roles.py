"""The parts that a session plays for what is below it, as Protocols: a log, a plot, an observer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus


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
