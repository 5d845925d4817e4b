"""A descriptor that never blocks, for an event loop (`transports.descriptor`) and for the relay."""

from __future__ import annotations

from typing import Protocol


class Endpoint(Protocol):
    """A descriptor that never blocks: `read` and `write` raise BlockingIOError instead."""

    @property
    def name(self) -> str:
        """The name for a person."""

    def fileno(self) -> int:
        """The descriptor."""

    def read(self) -> bytes | None:
        """Bytes that arrived; empty: only bytes for the endpoint itself; None: the end."""

    def write(self, data: bytes | memoryview) -> int:
        """Write, and return how many bytes the system took."""

    def unsent(self) -> int:
        """Number of bytes that the system reports as held and not sent."""

    def drop(self) -> int:
        """Take back what the system holds, if possible; return how many bytes that was."""

    def explain(self, error: OSError | None) -> str:
        """Reason of a break, and the remedy; None: the other end closed the pipe."""

    def close(self) -> None:
        """Close the descriptor; may block."""
