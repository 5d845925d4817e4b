"""What runs of program files on simulated drives, in virtual time, have in common: their limits and their events."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from dialects.problems import Problem
from simulator.cell.spec import DriveSpec

LONGEST = 3600.0
"""Virtual seconds after which a run without a time of its own is given up."""
MOST_LINES = 20_000_000
"""Executed lines after which it is given up as well: a program that never waits, on a drive set up to be fast."""
SLICE = 1.0
"""Virtual seconds between two looks at what the drive has done: some thousand lines."""


class Line(NamedTuple):
    """A line for a person. `problem`: it belongs on standard error."""

    text: str
    problem: bool = False


@dataclass(frozen=True)
class Debugging:
    """Wishes of a person who debugs a program.

    `trace`: report every executed line; otherwise only those that change a watched value. `breaks` are `LINE`, `LABEL`,
    or either with `,PASSES`. `watch` names variables.
    """

    trace: bool = False
    breaks: Sequence[str] = ()
    watch: Sequence[str] = ()

    @property
    def wanted(self) -> bool:
        """Whether there is anything to follow."""
        return bool(self.trace or self.breaks or self.watch)


NO_DEBUGGING = Debugging()


class Event(Protocol):
    """Something that a run reports. The last event is the summary."""

    @property
    def failed(self) -> bool:
        """Whether the test has failed; only a summary says so."""

    def fact(self, real: float) -> dict[str, Any]:
        """Give the JSON object; `real` is how many seconds the run has taken."""

    def lines(self, file: str, real: float) -> Iterator[Line]:
        """Yield the lines for a person about a run of this file."""


class ProgramRun(Protocol):
    """A program file that is loaded into a simulated drive."""

    def run(self, start: str = "", until: float | None = None, debugging: Debugging = NO_DEBUGGING) -> Iterator[Event]:
        """Run it from `start`, for `until` virtual seconds at most. Raises Diagnostic if there is nothing to run."""


Load = Callable[[DriveSpec], ProgramRun]
"""Loads a program file, which was read once, into a simulated drive, as often as it is called. Raises Diagnostic."""


class Programs(NamedTuple):
    """The runs of a family's program files on a simulated drive, in virtual time.

    `drive` is the default drive. `read` takes a text and its file's name. `refusals` finds the lines that a drive
    refuses. It takes a text, its file's name, the personality, and the problems found already. None: the check of the
    text finds them all.
    """

    drive: DriveSpec
    read: Callable[[str, str], Load]
    refusals: Callable[[str, str, str, Sequence[Problem]], list[Problem]] | None = None


def remark(*, stuck: bool, given_up: bool, turning: str = "") -> str:
    """Explain how a run ended where that needs a remark; `turning` is the one for a motor that still turns."""
    if stuck:
        return "the program waits here for ever: no further event is possible"
    if given_up:
        return "the program still runs; --until SECONDS sets the time limit"
    return turning
