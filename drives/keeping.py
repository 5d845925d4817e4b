"""What is kept of a port beyond this process, for the next one that opens it, should this one not end well."""

from __future__ import annotations

from typing import Protocol

from dialects import DriveState


class Keeper(Protocol):
    """Keeps it. None of its methods raises; what cannot be kept is told by the keeper, once."""

    async def owes(self, state: DriveState) -> None:
        """Write down what is to be put back in this drive (`known.restore`), or that nothing is; done on return."""

    def begun(self, line: str) -> None:
        """A line that may move something begins to leave."""

    def ended(self) -> None:
        """The drives have had it whole, or have overflowed."""

    def close(self) -> None:
        """The port is closed; a line that has begun and not ended was cut off."""
