"""The pace of frames: a frame goes out once the terminal has swallowed the one before.

After each frame the terminal is asked for its cursor position; its reply shows that it has processed the frame. A
terminal that never replied, or has ceased to, is not waited for. Then a frame goes out when the system has taken the
one before.
"""

from __future__ import annotations

from collections.abc import Callable

PATIENCE = 2.0
"""Seconds to wait for a reply."""
TRIES = 3
"""Number of missing replies in a row after which none is waited for."""


class Pace:
    """The state of a terminal's replies. `clock` returns seconds; `handed_over` is true once the system took all
    output.
    """

    def __init__(self, clock: Callable[[], float], handed_over: Callable[[], bool]) -> None:
        self._clock, self._handed_over = clock, handed_over
        self._asked_at: float | None = None
        self._last = 0.0
        self._unanswered = 0
        self._answers = False
        """The terminal replies: wait for each reply."""
        self._known = False
        """The terminal has replied at some time."""

    def ready(self) -> bool:
        """True if a frame may go out."""
        if not self._handed_over():
            return False
        if self._asked_at is None:
            return True
        if self._answers and self._clock() - self._asked_at < PATIENCE:
            return False
        self._asked_at = None
        self._unanswered += 1
        self._answers = self._answers and self._unanswered < TRIES
        return True

    def ask(self) -> bool:
        """Return True if the terminal should be asked after the frame that was just written."""
        now = self._clock()
        seldom = self._unanswered >= TRIES and (not self._known or now - self._last < PATIENCE)
        if self._asked_at is not None or seldom:
            return False
        self._asked_at = self._last = now
        return True

    def answered(self) -> None:
        """Note a reply."""
        self._asked_at, self._unanswered = None, 0
        self._answers = self._known = True
