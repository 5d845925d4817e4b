"""The operations on memory that lasts which the language needs."""

from __future__ import annotations

from typing import Protocol


class Storage(Protocol):
    """NVM, as the language sees it."""

    def save(self) -> None:
        """S. Raises Fault (73)."""

    def initialise(self) -> None:
        """IP. Raises Fault (74)."""

    def factory_defaults(self) -> None:
        """FD. Raises Fault (73)."""

    def program_changed(self) -> None:
        """Take note of a change of program memory; some products keep it at once, without S."""
