"""When a frame is painted: soon after something happened, thirty times a second at most, and seldom otherwise.

Frames come in beats. One of three paints all; the others paint new records only. While nothing happens, a frame is
painted now and then for the clock and the ages of values.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

FRAMES = 30
"""Paints a second, at most."""
PANELS = 3
"""Frames of which one paints all."""
AGEING = 1.0
"""Seconds between two paints while nothing happens."""


class Frames:
    """Decides when to paint.

    `paint(True)` paints all, `paint(False)` new records; it returns whether the terminal takes it. `later` runs a
    function in the app's own queue. `behind` is true while records wait for another paint.
    """

    def __init__(
        self,
        paint: Callable[[bool], bool],
        later: Callable[[Callable[[], None]], bool],
        behind: Callable[[], bool],
    ) -> None:
        self._paint, self._later, self._behind = paint, later, behind
        self._beat = 0
        self._due = False
        """A frame is about to be painted."""
        self._panels_owed = False
        """More than records has changed since all was painted."""
        self._painted_at = 0.0
        self._hurried = False
        """The reply to a typed line was painted early since the last frame."""
        self._owed = False
        """It is to be painted as soon as the terminal takes it."""

    def wake(self, panels: bool = True) -> None:
        """Paint soon: something has happened. `panels`: it may be more than a record."""
        self._panels_owed = self._panels_owed or panels
        if not self._due:
            self._due = True
            loop = asyncio.get_running_loop()
            delay = max(0.0, self._painted_at + 1 / FRAMES - loop.time())
            loop.call_later(delay, self._later, self._frame)

    def age(self) -> None:
        """Paint what changes by itself, unless a frame was painted just now."""
        if asyncio.get_running_loop().time() - self._painted_at > AGEING / 2:
            self.wake()

    def hurry(self) -> None:
        """Paint the reply to a typed line now, once between two frames."""
        if not self._hurried:
            self._hurried = self._later(self._hurry)

    def ready(self) -> None:
        """Paint what waits for the terminal, which has swallowed the last frame."""
        if self._owed:
            self._hurry()

    def tick(self) -> bool:
        """Paint one beat; return whether the terminal takes it."""
        if not self._paint(self._beat % PANELS == PANELS - 1):
            return False
        self._beat += 1
        return True

    def first(self) -> None:
        """Paint all, as the first frame: now, or once the terminal takes it."""
        self._beat = PANELS - 1
        self._hurry()

    def _frame(self) -> None:
        """Paint a frame, and another one until all is painted that has come."""
        self._due = self._hurried = self._owed = False
        now = asyncio.get_running_loop().time()
        if now - self._painted_at >= PANELS / FRAMES:  # the first for a while shows all
            self._beat += (PANELS - 1 - self._beat) % PANELS
        self._painted_at = now
        painted = self.tick()
        if painted and self._beat % PANELS == 0:
            self._panels_owed = False
        if not painted or self._panels_owed or self._behind():
            self.wake(panels=False)

    def _hurry(self) -> None:
        self._owed = not self.tick()
