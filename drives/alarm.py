"""One deadline on the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Callable


class Alarm:
    """Calls a function at a time at the latest. A call that comes too early costs less than many timers."""

    def __init__(self, ring: Callable[[], None]) -> None:
        self._ring = ring
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None

    def set(self, deadline: float) -> None:
        """Ring then at the latest."""
        if self._timer is not None and self._timer.when() > deadline:
            self.cancel()
        if self._timer is None:
            self._timer = self._loop.call_at(deadline, self._rings)

    def cancel(self) -> None:
        """Ring no more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _rings(self) -> None:
        self._timer = None
        self._ring()
