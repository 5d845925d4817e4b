"""When the next frame may go out: once the terminal has swallowed the one before.

It is asked for its cursor behind each frame, and answers when it has come so far. One that was never known to answer,
or has ceased to, is not waited for: there a frame goes out when the writer has handed the one before to the system.
"""

from __future__ import annotations

from collections.abc import Callable

PATIENCE = 2.0
"""Seconds that an answer is waited for."""
TRIES = 3
"""Answers in a row that may fail to come before none is waited for."""


class Pace:
    """See the module. `clock` gives seconds; `handed_over` says whether the system has taken all that was written."""

    def __init__(self, clock: Callable[[], float], handed_over: Callable[[], bool]) -> None:
        self._clock, self._handed_over = clock, handed_over
        self._asked_at: float | None = None
        self._last = 0.0
        self._unanswered = 0
        self._answers = False
        """It answers: each answer is waited for."""
        self._known = False
        """It has answered at some time."""

    def ready(self) -> bool:
        """Whether a frame may go out."""
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
        """Whether the terminal is to be asked behind the frame that was just written."""
        now = self._clock()
        seldom = self._unanswered >= TRIES and (not self._known or now - self._last < PATIENCE)
        if self._asked_at is not None or seldom:
            return False
        self._asked_at = self._last = now
        return True

    def answered(self) -> None:
        """The terminal has answered."""
        self._asked_at, self._unanswered = None, 0
        self._answers = self._known = True
