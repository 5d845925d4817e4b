"""What a session holds and does not make: plots, a log, the observation of a program."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

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


@dataclass(eq=False)
class RunningPlot:
    """A plot that a session feeds."""

    where: str
    """Its file or address, for a person."""
    desk: str
    """The line that a person types at another desk to see it; empty where that is not needed."""
    rate: str
    """The rate of its samples that was asked for, in words."""
    end: Callable[[], Awaitable[str]]
    """Ends it, and returns one line about the result. Raises Diagnostic where it could not be written."""
