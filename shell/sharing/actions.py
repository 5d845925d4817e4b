"""The actions that an `Exchange` returns to its caller."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Send:
    """Send bytes to a client."""

    client: int
    data: bytes


@dataclass(frozen=True)
class Close:
    """Close a client's connection, after the bytes that give the reason."""

    client: int
    farewell: bytes


@dataclass(frozen=True)
class Write:
    """Write bytes to the port, for a client."""

    client: int
    data: bytes


@dataclass(frozen=True)
class Stop:
    """Drop what the port has not sent, and write a stop: `mended` where something was dropped."""

    data: bytes
    mended: bytes


@dataclass(frozen=True)
class Purge:
    """Drop what the port has not sent."""


@dataclass(frozen=True)
class Set:
    """Change a setting of the port for a client; `applied` follows."""

    client: int
    setting: int
    value: int


@dataclass(frozen=True)
class Say:
    """Report an event to a person: the client, the event, and more about it."""

    client: str
    event: str
    detail: str = ""


Action = Send | Close | Write | Stop | Purge | Set | Say
