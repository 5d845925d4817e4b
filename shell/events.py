"""The events of a session: the facts of its buses, and its own actions.

Times are seconds of the session's clock (`session.now()`); `session.wall(at)` gives the time of day.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import ceil
from typing import NamedTuple

from multidrop.base.errors import Diagnostic, DriveError, TransportLost
from multidrop.dialects.by_hand import Variable
from multidrop.dialects.values import Readings
from multidrop.drives.events import BusEvent, Rested

FAILURES = (DriveError, Diagnostic, TransportLost)
"""The failures that `Session.run` raises, each with one line for a person; anything else is a bug."""


class By(Enum):
    """The origin of a line. After a stop only an operator's lines are accepted."""

    OPERATOR = "operator"
    MACRO = "macro"
    SCRIPT = "script"


@dataclass(frozen=True)
class Entered:
    """A line passed to `Session.run`. `bus` and `address` are its target; empty for a verb."""

    at: float
    line: str
    by: By
    bus: str = ""
    address: str = ""


@dataclass(frozen=True)
class Printed:
    """A line of a drive's reply. Lines that answer no request are `OnBus` with `drives.events.Unsolicited`."""

    at: float
    bus: str
    address: str
    text: str
    by: By = By.OPERATOR
    """The origin of the line that it answers."""


@dataclass(frozen=True)
class Output:
    """A line of a verb's result (`/drives`, `/list`): it goes to the same place as replies.

    `columns`: the text is in columns, and a screen breaks it between words.
    """

    at: float
    text: str
    columns: bool = False


@dataclass(frozen=True)
class Notified:
    """A notice for a person; never part of output that a program reads.

    `outcome`: what was asked for has happened; a command shows it even where it shows no other notices.
    """

    at: float
    text: str
    bus: str = ""
    warning: bool = False
    outcome: bool = False
    address: str = ""
    rested: Rested | None = None
    """It confirms that the drive at the address came to rest after a stop."""


@dataclass(frozen=True)
class Failed:
    """The failure of a line; `text` is the one line for a person."""

    at: float
    text: str
    bus: str = ""
    address: str = ""
    by: By = By.OPERATOR
    """The origin of the line."""
    code: int | None = None
    """The drive's own error number, if it gave one."""


class Bytes(NamedTuple):
    """Rows of bytes on a line: as text, in hex, or both. `clock` is the time of day.

    `watched`: on a line that is not in raw mode, where they are no one's output.

    What was received at once is one event, as for `drives.events.Unsolicited`.
    """

    at: float
    bus: str
    outgoing: bool
    clock: str
    rows: tuple[str, ...]
    watched: bool = False


class Predicted(NamedTuple):
    """The prediction of a drive's twin at the time of a sample. `difference`: measured minus predicted, steps."""

    at: float
    address: str
    position: int
    velocity: int
    difference: int
    axis: str = ""


class Diverged(NamedTuple):
    """A drive and its twin are apart by more than the limit (steps). `causes`: in words, the likeliest first."""

    at: float
    address: str
    difference: int
    limit: int
    causes: tuple[str, ...]
    axis: str = ""


class Agreed(NamedTuple):
    """A drive and its twin agree again after they diverged; `after`: the twin took the position, as of this."""

    at: float
    address: str
    axis: str = ""
    after: str = ""


class TwinEnded(NamedTuple):
    """The twin of a drive has ended, and with it the predictions."""

    at: float
    address: str


TwinEvent = Predicted | Diverged | Agreed | TwinEnded
"""Events of a drive's twin. `at`: on the clock of `drives.events.Sample.at`; `axis`: as there."""


class OnBus(NamedTuple):
    """An event of a bus: unsolicited lines, samples, traffic, transactions, predictions of a twin."""

    bus: str
    event: BusEvent | TwinEvent


@dataclass(frozen=True)
class StateChanged:
    """A change of buses, drives, selection, recording or latch; a front end reads the new state."""

    at: float


@dataclass(frozen=True)
class Progressed:
    """The progress of a long job. The last event of a job has `done == total`, also after a failure.

    `what` names the job. `left`: the time that it probably still takes, s; None while that is not known.
    """

    at: float
    what: str
    done: int
    total: int
    left: float | None = None

    @property
    def over(self) -> bool:
        return self.done >= self.total

    @property
    def text(self) -> str:
        """The progress in words: `a: download: 120 of 400, 3 s left`."""
        counted = f": {self.done} of {self.total}" if self.total > 1 else ""
        left = "" if self.left is None else f", {_duration(self.left)} left"
        return f"{self.what}{counted}{left}"


def _duration(seconds: float) -> str:
    """A duration in words, rounded up to the unit that a person waits in."""
    whole = max(1, ceil(seconds))
    if whole < 120:
        return f"{whole} s"
    minutes = ceil(whole / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


class ProgramRead(NamedTuple):
    """The program of a drive was read: its lines with their addresses, and the remarks of its file where known."""

    at: float
    bus: str
    address: str
    lines: tuple[tuple[int, str], ...]
    known: bool = True
    """False: lines are sent that change it, and what was read before is not what it holds."""


class SettingsRead(NamedTuple):
    """Every setting of a drive was read."""

    at: float
    bus: str
    address: str
    readings: Readings
    known: bool = True
    """False: the drive was restarted, or may have been, and what was read before is not how it is set."""


class VariablesRead(NamedTuple):
    """The variables of the programs in a drive were read."""

    at: float
    bus: str
    address: str
    variables: tuple[Variable, ...]


class Phase(Enum):
    """The action of an observed program on a line."""

    EXECUTES = "executes"
    BEFORE = "waits before"
    AFTER = "waits after"

    @property
    def waits(self) -> bool:
        """True if the program goes on only at a command."""
        return self is not Phase.EXECUTES


class ProgramSeen(NamedTuple):
    """A program under observation, at the line with an address; and the break point of this session.

    `line` is None once no program runs, or where its place is not known.
    """

    at: float
    bus: str
    address: str
    line: int | None = None
    phase: Phase = Phase.EXECUTES
    break_point: str = ""


SessionEvent = (
    Bytes
    | Entered
    | Printed
    | Output
    | Notified
    | Failed
    | OnBus
    | Progressed
    | ProgramRead
    | ProgramSeen
    | SettingsRead
    | VariablesRead
    | StateChanged
)


def kind_of(event: SessionEvent) -> type:
    """The type of an event; for an event of a bus, the type of that."""
    return type(event.event if isinstance(event, OnBus) else event)
