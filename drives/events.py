"""What a bus tells its watchers: frozen facts with the time (the event loop's clock, s) at which they happened."""

from __future__ import annotations

from dataclasses import dataclass

from dialects import Reply, Request


@dataclass(frozen=True)
class Transaction:
    """A request and its answer, with both times and how it ended (`reply.end`)."""

    request: Request
    reply: Reply
    sent_at: float
    ended_at: float
    transmitted_at: float
    """When the request's last byte had left, as far as the baud rate tells: when the drive had it all."""
    sent: bool = True
    """Whether it was written at all; what is stopped before that was not."""


@dataclass(frozen=True)
class Sent:
    """A request went onto the wire."""

    at: float
    request: Request


@dataclass(frozen=True)
class Ended:
    """A transaction ended, well or not."""

    at: float
    transaction: Transaction


@dataclass(frozen=True)
class Unsolicited:
    """A line came that nobody asked for: a running program's print, a name at a move's end, a sign-on."""

    at: float
    text: str


@dataclass(frozen=True)
class Notice:
    """Something a person should know: a drive was taken out of program mode, a stop was seen to work."""

    at: float
    text: str
    address: str = ""
    warning: bool = False


@dataclass(frozen=True)
class Traffic:
    """Raw bytes, `outgoing` or not."""

    at: float
    outgoing: bool
    data: bytes


@dataclass(frozen=True)
class Sample:
    """Position (steps, or counts with EE=1) and velocity (the same a second) of one axis of one drive."""

    at: float
    address: str
    position: int
    velocity: int
    axis: str = ""
    trouble: str = ""
    """What is wrong with it, in words; empty: nothing, as far as this reading tells."""


@dataclass(frozen=True)
class Silent:
    """A polled drive did not answer."""

    at: float
    address: str


@dataclass(frozen=True)
class Changed:
    """The state of a drive or of the bus changed: opened, lost, in or out of program mode, renamed."""

    at: float
    address: str = ""


BusEvent = Sent | Ended | Unsolicited | Notice | Traffic | Sample | Silent | Changed
