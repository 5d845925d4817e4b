"""The pace of a macro: as recorded, or as fast as its lines are done."""

from __future__ import annotations

from collections.abc import Callable

from shell import waits


class Pace:
    """Waits before each line. A line starts its time after the start of the line before it, or when that is done."""

    def __init__(self, now: Callable[[], float], fast: bool = False) -> None:
        """Begin now. `fast`: recorded pauses are left out."""
        self.fast = fast
        self._now = now
        self._begun = now()

    async def before(self, after: float) -> None:
        """Wait until a line may start that was recorded `after` seconds after the one before it."""
        wait = 0.0 if self.fast else self._begun + after - self._now()
        if wait > 0:
            await waits.sleep(wait)
        self._begun = self._now()
