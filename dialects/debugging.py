"""Programs run under observation: trace, single step, break points, watched variables. What a family offers of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from multidrop.base.errors import Inexpressible
from multidrop.dialects.codec import Procedure
from multidrop.dialects.program_files import Held, Stored
from multidrop.dialects.state import DriveState

S = TypeVar("S", bound=DriveState)


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


def _never_broken(*_: object) -> Procedure[int | None]:
    return None
    yield  # a procedure


def lacking(who: Callable[[Any], str], what: str) -> Callable[..., Procedure[Any]]:
    """Make the conversation that stands for what the drives of a family lack: it raises Inexpressible."""

    def refuse(state: DriveState, *_: object) -> Procedure[Any]:
        raise Inexpressible(f"{who(state)}: {what}; nothing was sent")
        yield  # a procedure

    return refuse


@dataclass(frozen=True)
class Debugging(Generic[S]):
    """Observation of a program. Every conversation raises Refused, NoAnswer, Stopped or Inexpressible.

    What a family lacks raises Inexpressible and sends nothing.
    """

    listing: Callable[[S], Procedure[tuple[Stored, ...]]]
    """Read the program in the drive."""
    entry: Callable[[Sequence[Stored]], str]
    """The place at which a program begins if none is named."""
    address: Callable[[Sequence[Stored], str], int | None]
    """The address of the first line that is executed at a place; None where that is not known."""
    idle: Callable[[S, str, Neighbours | None], Procedure[None]]
    """Raise Refused unless a program can be started: traced beside these neighbours, or with None step by step."""
    trace: Callable[[S, str], Procedure[None]]
    """Start a program whose lines are shown."""
    begin: Callable[[S, str], Procedure[None]]
    """Start a program that waits for `step` before each line; a break point is removed before."""
    waits: Callable[[S, str, Stored | None], Procedure[None]]
    """Raise Refused unless it is known that a program waits, after this last line, for a step or to go on."""
    step: Callable[[S, Sequence[Stored]], Procedure[Stepped]]
    """Execute one line of this program. Call it after `waits`, with no other conversation in between."""
    go_on: Callable[[S, str], Procedure[None]]
    """Let a program run on at normal speed. Call it after `waits`."""
    look: Callable[[S, str], Procedure[Look]]
    """Read the state of a program."""
    break_at: Callable[[S, str, int], Procedure[None]]
    """Set the break point: a label or an address, and the number of passes."""
    break_off: Callable[[S], Procedure[None]]
    """Remove the break point."""
    break_now: Callable[[S, str], Procedure[None]]
    """Break a running program where it is."""
    names: Callable[[S, Sequence[str]], None]
    """Check names to watch, without a request. Raises Diagnostic."""
    values: Callable[[S, Sequence[str]], Procedure[Mapping[str, str]]]
    """Read variables; one that the drive does not have now is left out. Clears nothing."""
    rows: Callable[[Held], Sequence[Stored]] = lambda held: held.lines
    """Return the lines of what was read from a drive, as `listing` does."""
    forget: Callable[[S], None] = lambda state: None
    """Forget what proves that a program waits: a stop came."""
    broken: Callable[[S, Sequence[Stored], Stored, str], Procedure[int | None]] = _never_broken
    """Whether the drive waits at the break point after this last line of a quiet trace; its address, or None."""
    hold: Callable[[str], float | None] = lambda text: 0.0
    """Seconds for which a line holds its program, 0 for none and for motion; None: they are not known."""
    traced: Callable[[str], Stored | None] = lambda line: None
    """The executed line that a printed line shows; None for any other line."""
    no_step: str = ""
    """The reason why its drives have no single step; empty: they have."""
