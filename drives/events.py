"""Events of a bus: frozen facts with the time at which they happened (the event loop's clock, s)."""

from __future__ import annotations

from dataclasses import dataclass

from dialects import Reply, Request


@dataclass(frozen=True)
class Transaction:
    """A request and its reply, with both times and how it ended (`reply.end`)."""

    request: Request
    reply: Reply
    sent_at: float
    ended_at: float
    transmitted_at: float
    """When the last byte of the request had left, calculated from the baud rate."""
    sent: bool = True
    """Whether the request was written; one that was stopped before that was not."""


@dataclass(frozen=True)
class Sent:
    """A request went onto the wire."""

    at: float
    request: Request


@dataclass(frozen=True)
class Ended:
    """A transaction ended, successfully or not."""

    at: float
    transaction: Transaction


@dataclass(frozen=True)
class Unsolicited:
    """A line that answers no request: the print of a running program, a name at the end of a move, a sign-on."""

    at: float
    text: str


@dataclass(frozen=True)
class Notice:
    """A message for the user: a drive was taken out of program mode, a stop was seen to work."""

    at: float
    text: str
    address: str = ""
    warning: bool = False


@dataclass(frozen=True)
class Traffic:
    """Raw bytes, `outgoing` or incoming."""

    at: float
    outgoing: bool
    data: bytes


@dataclass(frozen=True)
class Sample:
    """Position (steps, or counts with EE=1) and velocity (per second) of one axis of one drive."""

    at: float
    address: str
    position: int
    velocity: int
    axis: str = ""
    trouble: str = ""
    """The fault that this reading reports, in words; empty if it reports none."""


@dataclass(frozen=True)
class Silent:
    """A polled drive did not answer."""

    at: float
    address: str


@dataclass(frozen=True)
class Changed:
    """A drive or the bus changed state: opened, lost, in or out of program mode, renamed."""

    at: float
    address: str = ""


BusEvent = Sent | Ended | Unsolicited | Notice | Traffic | Sample | Silent | Changed
