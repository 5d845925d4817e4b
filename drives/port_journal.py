"""Record of a port beyond this process, for the next one that opens it if this one does not end properly."""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.dialects import DriveState, Owed
from multidrop.dialects.state import Remembered

GLOBAL = ("*", "^")
"""Addresses that several drives hear: all of them, and all that are queued ."""


class Keeper:
    """Keeps nothing, as for a port that needs no record; `shell.state.port_state` keeps one. No method raises."""

    baud = 0
    """The baud rate of the port; 0 where it has none."""
    owed: tuple[Owed, ...] = ()
    """What is written down, also for drives that were not found yet."""

    async def owes(self, state: DriveState) -> None:
        """Write down what is to be restored in this drive (`state.restore`), if anything; done on return."""

    def remember(self, drives: Mapping[str, Remembered | None]) -> None:
        """Remember drives by address for the next use of the port; None forgets one."""

    def begun(self, line: str) -> None:
        """A line that may move something begins to leave."""

    def ended(self) -> None:
        """The drives have received it whole, or have overflowed."""

    def close(self) -> None:
        """The port is closed; a line that has begun and not ended was cut off."""


class Departure:
    """The command on its way, as the keeper knows it: a part of it would do something else if only that left."""

    def __init__(self, keeper: Keeper) -> None:
        self._keeper = keeper
        self.under_way = ""
        """The command that has begun to leave, with its address; empty once it is answered."""

    def begins(self, text: str) -> None:
        self.under_way = text
        self._keeper.begun(text)

    def arrived(self) -> None:
        """Note that a request was answered or followed by a whole line."""
        if self.under_way:
            self.cleared()

    def cleared(self) -> None:
        """Note that no part of a command is left in a drive."""
        self.under_way = ""
        self._keeper.ended()
