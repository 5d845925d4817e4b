"""The search for drives of which nothing is known: the record of a family for it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from multidrop.dialects.codec import Procedure, StopPiece
from multidrop.dialects.state import DriveState

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
class SearchOutcome:
    """What a search shows beside the drives that it found."""

    remarks: tuple[str, ...] = ()
    """Replies that could not be read, in words."""


Found = Callable[[DriveState], None]
"""Called with each drive as soon as it is identified."""
Step = Callable[[], None]
"""Called after each address that was tried."""


class Scan(ABC):
    """The search for the drives of a family. It moves nothing and raises no error in a drive of that family."""

    title: ClassVar[str]
    """The name of the language for a person."""
    bauds: ClassVar[tuple[int, ...]]
    """The baud rates that its drives can be set to."""
    names: ClassVar[tuple[str, ...]] = ()
    """The addresses that a stop names for drives that have not replied."""
    clears: ClassVar[str] = ""
    """What `clear` does, for a person; empty: nothing keeps its drives from replying."""
    erases: ClassVar[bool] = False
    """The language has a word for `erase`."""
    hazard: ClassVar[str] = ""
    """What its bytes may do in other drives, for the question before it: nothing else searches for its drives."""
    waits: ClassVar[float] = 0.0
    """The time of a search beside that of its steps, s."""
    slow: ClassVar[float] = 0.0
    """The time by which a step may take longer than the window and its bytes, s."""

    @abstractmethod
    def places(self, reach: Reach) -> int:
        """The number of steps of a search."""

    @abstractmethod
    def search(self, reach: Reach, found: Found, step: Step) -> Procedure[SearchOutcome]:
        """Search a line at its baud rate."""

    def clear(self) -> Procedure[None]:
        """Clear what keeps drives from replying; it may be an error in them, and erases nothing."""
        return
        yield  # a conversation

    def erase(self) -> Procedure[None]:
        """Set every drive on the line to its factory defaults."""
        return
        yield

    def asked(self, reach: Reach) -> str:
        """The addresses that a search asks, in words."""
        return "all addresses"

    def stop(self, asked: Sequence[str]) -> Sequence[StopPiece]:
        """The stop for addresses that were asked and have not replied; where one replies, its whole stop follows."""
        return ()

    def seconds(self, reach: Reach, baud: int | None) -> float:
        """Estimate the time of a search."""
        return self.waits + self.places(reach) * (reach.window + self.slow + BYTES * 10 / (baud or 1_000_000))
