"""Programs run under observation: trace, single step, break points, watched variables. What a family offers of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from multidrop.base.errors import Inexpressible
from multidrop.dialects.codec import Procedure
from multidrop.dialects.program_files import Held, Stored
from multidrop.dialects.state import OfDrive, who

Neighbours = Sequence[str]
"""The addresses of the drives on a line."""


class Stepped(NamedTuple):
    """A line that was executed, and the seconds for which it holds its program; None: they are not known."""

    row: Stored
    hold: float | None = 0.0


class Look(NamedTuple):
    """The state of a program: whether it runs, whether it waits there, and its address where the drive reports it."""

    runs: bool
    paused: bool = False
    address: int | None = None


class Debugging(OfDrive, ABC):
    """Observation of the programs of a drive. Every conversation raises Refused, NoAnswer, Stopped or Inexpressible.

    What a family lacks raises Inexpressible and sends nothing.
    """

    no_step: ClassVar[str] = ""
    """The reason why its drives have no single step; empty: they have."""
    no_break: ClassVar[str] = ""
    """The reason why they have no break points; empty: they have."""

    @property
    def cannot_step(self) -> str:
        """The reason why this drive has no single step, with its present settings too; empty: it has."""
        return self.no_step

    def lacking(self, what: str) -> Procedure[Any]:
        """The conversation that stands for what the drives lack. Raises Inexpressible."""
        raise Inexpressible(f"{who(self.state)}: {what}; nothing was sent")
        yield  # a conversation

    @abstractmethod
    def listing(self) -> Procedure[tuple[Stored, ...]]:
        """Read the program in the drive."""

    @abstractmethod
    def entry(self, rows: Sequence[Stored]) -> str:
        """The place at which a program begins if none is named."""

    @abstractmethod
    def address(self, rows: Sequence[Stored], place: str) -> int | None:
        """The address of the first line that is executed at a place; None where that is not known."""

    @abstractmethod
    def idle(self, place: str, neighbours: Neighbours | None) -> Procedure[None]:
        """Raise Refused unless a program can be started: traced beside these neighbours, or with None step by step."""

    @abstractmethod
    def trace(self, place: str) -> Procedure[None]:
        """Start a program whose lines are shown."""

    def begin(self, place: str) -> Procedure[None]:
        """Start a program that waits for `step` before each line; a break point is removed before."""
        return self.lacking(self.no_step)

    def waits(self, place: str, last: Stored | None) -> Procedure[None]:
        """Raise Refused unless it is known that a program waits, after this last line, for a step or to go on."""
        return self.lacking(self.no_step)

    def step(self, rows: Sequence[Stored]) -> Procedure[Stepped]:
        """Execute one line of this program. Call it after `waits`, with no other conversation in between."""
        return self.lacking(self.no_step)

    def go_on(self, place: str) -> Procedure[None]:
        """Let a program run on at normal speed. Call it after `waits`."""
        return self.lacking(self.no_step)

    @abstractmethod
    def look(self, place: str) -> Procedure[Look]:
        """Read the state of a program."""

    def break_at(self, place: str, passes: int) -> Procedure[None]:
        """Set the break point: a label or an address, and the number of passes."""
        return self.lacking(self.no_break)

    def break_off(self) -> Procedure[None]:
        """Remove the break point."""
        return self.lacking(self.no_break)

    def break_now(self, place: str) -> Procedure[None]:
        """Break a running program where it is."""
        return self.lacking(self.no_break)

    def names(self, names: Sequence[str]) -> None:
        """Check names to watch, without a request. Raises Diagnostic."""

    @abstractmethod
    def values(self, names: Sequence[str]) -> Procedure[Mapping[str, str]]:
        """Read variables; one that the drive does not have now is left out. Clears nothing."""

    def rows(self, held: Held) -> Sequence[Stored]:
        """Return the lines of what was read from a drive, as `listing` does."""
        return held.lines

    def forget(self) -> None:
        """Forget what proves that a program waits: a stop came."""

    def broken(self, rows: Sequence[Stored], last: Stored, place: str) -> Procedure[int | None]:
        """Whether the drive waits at the break point after this last line of a quiet trace; its address, or None."""
        return None
        yield  # a conversation

    def hold(self, text: str) -> float | None:
        """Seconds for which a line holds its program, 0 for none and for motion; None: they are not known."""
        return 0.0

    def traced(self, line: str) -> Stored | None:
        """The executed line that a printed line shows; None for any other line."""
        return None
