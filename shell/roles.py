"""Parts that a session holds and others make: plots, a log, the observation of a program, transcripts on a screen."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from pathlib import Path

DIFFERENCE = "difference"
"""The word of a series: the measured minus the predicted position of a drive with a twin, steps."""


class Series(NamedTuple):
    """A plotted drive: its position and velocity; with a `word`, the value of that word instead."""

    bus: str
    address: str
    word: str = ""

    @property
    def of_motion(self) -> bool:
        """True if it needs samples of position and velocity."""
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
    viewer: str
    """The line that then shows it there."""
    rate: str
    """The rate of its samples that was asked for, in words."""
    shown: str
    """A line for a screen that plots, too: what takes the samples, and where."""
    end: Callable[[], Awaitable[str]]
    """Ends it, and returns one line about the result. Raises Diagnostic where it could not be written."""


TIMES: Mapping[str, str] = {
    "off": "no times: more room for the lines",
    "clock": "the time of day",
    "start": "seconds since the first line",
    "last": "seconds since the line above",
}
"""How the times of lines are shown, and what each form means."""


class Filter(NamedTuple):
    """A filter. An empty one shows all; each condition hides some lines.

    `address`: only the records of a drive. `errors`: only failures and warnings, each with the line that failed.
    `mine`: only what a person typed, with its replies, and warnings. `text`: only records that hold it.
    """

    address: str = ""
    errors: bool = False
    mine: bool = False
    text: str = ""

    def __bool__(self) -> bool:
        return self != EVERYTHING

    @property
    def words(self) -> str:
        """The filter in words: `only b, errors`; empty where it shows all."""
        parts = [self.address, "errors" * self.errors, "mine" * self.mine, f'"{self.text}"' if self.text else ""]
        return f"only {', '.join(filter(None, parts))}" if self else ""


EVERYTHING = Filter()


@dataclass
class Transcripts:
    """The functions of the transcripts on a screen."""

    times: Callable[[], str]
    """Returns the form of the times, a word of `TIMES`."""
    set_times: Callable[[str], None]
    """Shows times in another form."""
    choose: Callable[[Filter], None]
    """Shows only some lines of the selected bus."""
    save: Callable[[str], Awaitable[str]]
    """Writes the shown lines of the selected bus to a new file; returns what was written. Raises Diagnostic."""
    offer_unsent: Callable[[], Awaitable[None]]
    """Offers the lines that were held back or dropped last to a person, to be sent. Raises Diagnostic."""
