"""What a session tells its front ends: the facts of its buses, and what it did itself.

Times are seconds of the session's clock (`session.now()`); `session.wall(at)` gives the time of day.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from dialects import Diagnostic, DriveError
from drives.events import BusEvent
from transports import TransportLost

FAILURES = (DriveError, Diagnostic, TransportLost)
"""The failures that `Session.run` raises, each with one line for a person; anything else is a bug."""


class By(Enum):
    """Who entered a line. A stop latches against everything but an operator."""

    OPERATOR = "operator"
    MACRO = "macro"
    SCRIPT = "script"


@dataclass(frozen=True)
class Entered:
    """A line was handed to `Session.run`. `bus` and `address` are where it goes; empty for a verb."""

    at: float
    line: str
    by: By
    bus: str = ""
    address: str = ""


@dataclass(frozen=True)
class Printed:
    """A drive printed a line; `solicited` when it answers a request of ours."""

    at: float
    bus: str
    address: str
    text: str
    solicited: bool = True


@dataclass(frozen=True)
class Output:
    """A line of a verb's result (`/drives`, `/list`): it goes where replies go.

    `columns`: it is text in columns, and a screen breaks it between words.
    """

    at: float
    text: str
    columns: bool = False


@dataclass(frozen=True)
class Notified:
    """What goes on, for a person; never part of an output that a program reads."""

    at: float
    text: str
    bus: str = ""
    warning: bool = False


@dataclass(frozen=True)
class Failed:
    """A line failed; `text` is the one line for a person."""

    at: float
    text: str
    bus: str = ""
    address: str = ""


@dataclass(frozen=True)
class OnBus:
    """A bus's own event: samples, traffic, transactions."""

    bus: str
    event: BusEvent


@dataclass(frozen=True)
class StateChanged:
    """Buses, drives, selection, recording, latch: look again."""

    at: float


SessionEvent = Entered | Printed | Output | Notified | Failed | OnBus | StateChanged
