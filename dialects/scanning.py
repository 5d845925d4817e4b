"""The search for drives of which nothing is known: the record of a family for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from multidrop.dialects.codec import Procedure
from multidrop.dialects.state import DriveState

S = TypeVar("S", bound=DriveState)
WINDOW = 0.02
"""The silence after a question that shows that no drive has its address, s."""


@dataclass(frozen=True)
class Reach:
    """How a line is searched."""

    window: float = WINDOW
    """The silence that shows that no drive has an address, s."""
    alone: bool = False
    """One drive at most, as over UDP: no addresses are tried."""
    hasty: bool = False
    """A search for names ends where a program prints all the time."""
    known: tuple[str, ...] = ()
    """Addresses that are not tried: their drives are known."""
    cut: str = ""
    """The line that our last use of the port may have sent by half."""
    first_mark: int = 0
    """The number after which sync marks begin."""


@dataclass(frozen=True)
class Outcome:
    """What a search shows beside the drives that it found."""

    remarks: tuple[str, ...] = ()
    """Replies that could not be read, in words."""
    echo: bool = False
    """The adapter repeats what it sends: the search ended, to begin again with `echo=local`."""


Found = Callable[[S], None]
"""Called with each drive as soon as it is identified."""
Step = Callable[[], None]
"""Called after each address that was tried."""


@dataclass(frozen=True)
class Scan(Generic[S]):
    """The search for the drives of a family. It moves nothing and raises no error in a drive of that family."""

    title: str
    """The name of the language for a person."""
    bauds: tuple[int, ...]
    """The baud rates that its drives can be set to."""
    places: Callable[[Reach], int]
    """The number of steps of a search."""
    search: Callable[[Reach, Found[S], Step], Procedure[Outcome]]
    """Search a line at its baud rate."""
    clear: Callable[[], Procedure[None]]
    """Clear what keeps drives from replying; it may be an error in them, and erases nothing."""
    clears: str
    """What `clear` does, for a person."""
    erase: Callable[[], Procedure[None]] | None = None
    """Set every drive on the line to its factory defaults; None: the language has no word for it."""
    names: tuple[str, ...] = ()
    """The addresses that a stop names for drives that have not replied."""
