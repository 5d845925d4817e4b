"""Record of a port beyond this process, for the next one that opens it if this one does not end properly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from multidrop.dialects import DriveState, Kind, Request
from multidrop.dialects.state import Remembered

GLOBAL = ("*", "^")
"""Addresses that several drives hear: all of them, and all that are queued (MCode QD=1)."""


class Keeper(Protocol):
    """Keeps the record. No method raises; the keeper reports once what it cannot keep."""

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


class NoKeeper:
    """Keeps nothing: the record of a port that needs none."""

    async def owes(self, state: DriveState) -> None:
        """Keep nothing."""

    def remember(self, drives: Mapping[str, Remembered | None]) -> None:
        """Keep nothing."""

    def begun(self, line: str) -> None:
        """Keep nothing."""

    def ended(self) -> None:
        """Keep nothing."""

    def close(self) -> None:
        """Keep nothing."""


class Departure:
    """The command on its way, as the keeper knows it: a part of it would do something else if only that left.

    A program's lines are stored and do nothing; a part of a setting or of a question moves nothing.
    """

    def __init__(self, keeper: Keeper) -> None:
        self._keeper = keeper
        self.under_way = ""
        """The command that has begun to leave, with its address; empty once it is answered."""

    def begins(self, request: Request) -> None:
        """Note a request that is written."""
        if request.kind is Kind.COMMAND or request.address in GLOBAL:
            self.under_way = f"{request.address}{request.text}"
            self._keeper.begun(self.under_way)

    def typed(self, data: bytes) -> None:
        """Note a person's own bytes that are written."""
        self.under_way = data.decode("latin-1")
        self._keeper.begun(self.under_way)

    def arrived(self) -> None:
        """Note that a request was answered or followed by a whole line."""
        if self.under_way:
            self.cleared()

    def cleared(self) -> None:
        """Note that no part of a command is left in a drive."""
        self.under_way = ""
        self._keeper.ended()
