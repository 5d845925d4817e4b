"""The time that the drives get after a begun line of one client was made harmless, before the next client writes."""

from __future__ import annotations

NO_REPLY, QUIET_TIME, LONGEST_QUIET = 0.3, 0.1, 1.0
"""Seconds without any reply, and without a byte more after one, until the drives have replied to what made a line
harmless; and the longest wait. A client gives its own command up after 0.4 s without a reply, so the wait is shorter.
"""


class Settling:
    """The time after a begun line was made harmless: the drives' reply to that is no reply to the next command."""

    def __init__(self) -> None:
        self.until = 0.0
        """When the next writer's bytes are written, s; 0: at once."""
        self.heard = b""
        self._limit = 0.0

    def begin(self, now: float, size: int, baud: int) -> None:
        left = now + 10.0 * size / max(baud, 1)
        self.until, self._limit, self.heard = left + NO_REPLY, left + LONGEST_QUIET, b""

    def took(self, data: bytes, now: float) -> None:
        self.heard += data
        self.until = min(now + QUIET_TIME, self._limit)

    def over(self, now: float) -> bool:
        if now >= self.until:
            self.until = 0.0
        return not self.until
