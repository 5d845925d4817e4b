"""Connections: URLs, the user's configuration, opening; the pauses between attempts, for everything that is lost."""

from __future__ import annotations


class Pauses:
    """The pause before an attempt, s: each is twice the one before it and `more`, up to the longest."""

    def __init__(self, first: float, longest: float, more: float = 0.0) -> None:
        self._longest, self._more = longest, more
        self.now = first

    def lengthen(self, longest: float | None = None) -> None:
        """Take a longer pause after an attempt that failed; `longest`: for this one."""
        self.now = min(2 * self.now + self._more, self._longest if longest is None else longest)

    def begin(self, pause: float) -> None:
        """Begin again with a pause."""
        self.now = pause
