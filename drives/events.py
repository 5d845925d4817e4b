"""Events of a bus: frozen facts with the time at which they happened (the event loop's clock, s).

They are named tuples, which take a third of the time of a frozen dataclass to make: each request makes four.
"""

from __future__ import annotations

from typing import NamedTuple

from multidrop.dialects import Reply, Request
from multidrop.dialects.values import Conditions
from multidrop.transports import TransportLost


class Transaction(NamedTuple):
    """A request and its reply, with both times and how it ended (`reply.end`)."""

    request: Request
    reply: Reply
    sent_at: float
    ended_at: float
    transmitted_at: float
    """When the last byte of the request had left, calculated from the baud rate."""
    sent: bool = True
    """Whether the request was written; one that was stopped before that was not."""


class Sent(NamedTuple):
    """A request went onto the wire."""

    at: float
    request: Request


class Ended(NamedTuple):
    """A transaction ended, successfully or not."""

    at: float
    transaction: Transaction


class Unsolicited(NamedTuple):
    """Lines that answer no request: prints of a running program, a name at the end of a move, a sign-on.

    What was received at once is one event, since a program may print a thousand lines at a time.
    """

    at: float
    lines: tuple[str, ...]


class Notice(NamedTuple):
    """A message for the user: a drive was taken out of program mode, a stop was seen to work."""

    at: float
    text: str
    address: str = ""
    warning: bool = False


class Traffic(NamedTuple):
    """Raw bytes, `outgoing` or incoming."""

    at: float
    outgoing: bool
    data: bytes


class Sample(NamedTuple):
    """Position (steps, or counts with EE=1) and velocity (per second) of one axis of one drive."""

    at: float
    address: str
    position: int
    velocity: int
    axis: str = ""
    trouble: str = ""
    """The fault that this reading reports, in words; empty if it reports none."""
    program: bool | None = None
    """Whether a program runs in the drive; None: not read with it."""


class Conditioned(NamedTuple):
    """The conditions of every axis of a drive."""

    at: float
    address: str
    conditions: tuple[Conditions, ...]


class Valued(NamedTuple):
    """A value that was read, by its word."""

    at: float
    address: str
    word: str
    value: float


class Silent(NamedTuple):
    """A polled drive did not answer."""

    at: float
    address: str


class Lost(NamedTuple):
    """The port is lost; all requests are refused until its drives are found again."""

    at: float
    error: TransportLost


class Changed(NamedTuple):
    """A drive or the bus changed state: opened, lost, in or out of program mode, renamed."""

    at: float
    address: str = ""


BusEvent = Sent | Ended | Unsolicited | Notice | Traffic | Sample | Valued | Conditioned | Silent | Lost | Changed
