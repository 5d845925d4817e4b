"""A command that was typed, and what the host said of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Outcome(Enum):
    """The host's word about a command."""

    OPEN = "no word yet"
    OK = "ok"
    REFUSED = "refused"
    NOT_SENT = "not sent"
    UNKNOWN = "unknown"


@dataclass
class Command:
    """A line that was typed. `stops`: the number of stops that were typed before it."""

    text: str
    line: str
    """The line of drives."""
    drive: str
    typed: float
    stops: int
    outcome: Outcome = Outcome.OPEN
    said: str = ""
    who: str = ""
    """Who typed it; empty: this person."""
    times: int = 1
    """How often it may be executed: a macro that is being recorded plays it once more."""
    began: float = -1.0
    ended: float = -1.0
