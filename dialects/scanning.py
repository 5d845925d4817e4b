"""The search for drives of which nothing is known: the record of a family for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from multidrop.dialects.codec import Procedure, StopPiece
from multidrop.dialects.state import DriveState

S = TypeVar("S", bound=DriveState)
WINDOW = 0.02
"""The silence after a question that shows that no drive has its address, s."""


BYTES = 20
"""The mean size of the questions to one address, bytes; for the estimate."""


@dataclass(frozen=True)
class Reach:
    """How a line is searched."""

    window: float = WINDOW
    """The silence that shows that no drive has an address, s."""
    alone: bool = False
    """One drive at most, as over UDP: no addresses are tried."""
    hasty: bool = False
    """A search for names ends where a program prints all the time."""
    everything: bool = False
    """Every address is tried, also where the family expects its drives at one."""
    asks: Callable[[str], None] = lambda address: None
    """Called with an address before anything is sent to it."""
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
    clear: Callable[[], Procedure[None]] | None = None
    """Clear what keeps drives from replying; it may be an error in them, and erases nothing. None: nothing does."""
    clears: str = ""
    """What `clear` does, for a person."""
    erase: Callable[[], Procedure[None]] | None = None
    """Set every drive on the line to its factory defaults; None: the language has no word for it."""
    names: tuple[str, ...] = ()
    """The addresses that a stop names for drives that have not replied."""
    asked: Callable[[Reach], str] = lambda reach: "all names, with and without a checksum"
    """The addresses that a search asks, in words."""
    hazard: str = ""
    """What its bytes may do in other drives, for the question before it: nothing else searches for its drives."""
    waits: float = 0.0
    """The time of a search beside that of its steps, s."""
    slow: float = 0.0
    """The time by which a step may take longer than the window and its bytes, s."""
    stop: Callable[[Sequence[str]], Sequence[StopPiece]] = lambda asked: ()
    """The stop for addresses that were asked and have not replied; where one replies, its whole stop follows."""

    def seconds(self, reach: Reach, baud: int | None) -> float:
        """Estimate the time of a search."""
        return self.waits + self.places(reach) * (reach.window + self.slow + BYTES * 10 / (baud or 1_000_000))
