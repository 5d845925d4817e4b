"""The conditions of a drive beyond position and velocity, read in parts, each a short conversation.

A typed line for a drive waits for one part at most. A reading has no side effect: it starts and clears nothing, and
asks no word that the product refuses. A part that is `slow` reads settings, which change only when a line was sent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from multidrop.dialects.codec import Procedure
from multidrop.dialects.parameters import Value
from multidrop.dialects.state import DriveState

UNREAD = -1
"""An error is set, and to read its number would clear it."""
Facts = Mapping[str, Value]
"""What parts have read, by name."""


@dataclass(frozen=True)
class Lamp:
    """One input or output: its name on the drive, its function in one word, and whether it is active."""

    name: str
    function: str = ""
    on: bool | None = None
    """None: the drive does not report it."""
    output: bool = False


@dataclass(frozen=True)
class Pace:
    """The profile of a move: units/s and units/s2."""

    initial: float
    maximum: float
    acceleration: float
    deceleration: float


@dataclass(frozen=True)
class Conditions:
    """The conditions of one axis of a drive."""

    axis: str = ""
    lamps: tuple[Lamp, ...] = ()
    error: int = 0
    """The number of the error that is set; 0: none; UNREAD: its number is not known."""
    error_text: str = ""
    program: str = ""
    """The label of the program that runs, or `running`; empty: none runs."""
    runs: bool | None = None
    """Whether a program runs in the drive that can move it; None: this axis, or the family, does not report it."""
    line: str = ""
    """The place of the running program; empty where the drive does not report it."""
    target: int | None = None
    """The end of the move that is under way, where it is known."""
    limits: tuple[int, int] | None = None
    """The travel between software limits."""
    disabled: str = ""
    """The reason for which the output stage is off, `DE=0`; empty: it is on, or that is not known."""
    released: str = ""
    """The reason for which no current holds the motor at rest, although it can move: `HC=0`."""
    run_current: int | None = None
    hold_current: int | None = None
    more: tuple[tuple[str, str], ...] = ()
    """Names and values of what only this family has."""
    unit: str = "steps"
    pace: Pace | None = None
    modes: str = ""
    """How the drive is set to reply, as short as a person knows it: `EM1 CK1`."""

    @property
    def no_current(self) -> str:
        """The reason for which nothing holds the load at rest; empty: there is current, or that is not known."""
        return self.disabled or self.released


S = TypeVar("S", bound=DriveState)


@dataclass(frozen=True)
class Part(Generic[S]):
    """One short conversation that reads some facts, at the priority of polls. Raises Refused or NoAnswer."""

    name: str
    read: Callable[[S], Procedure[Facts]]
    slow: bool = False


@dataclass(frozen=True)
class Reader(Generic[S]):
    """Reads the conditions of the drives of a family."""

    parts: Callable[[S, Facts], Sequence[Part[S]]]
    """The parts to read of a drive, where these facts are known; none where its mode forbids it."""
    fold: Callable[[S, Facts], tuple[Conditions, ...]]
    """The conditions of each axis, from what the parts have read."""
