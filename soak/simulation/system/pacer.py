"""The thread that writes the pieces of a stop while the loop is held up: a timer that no starved loop delays."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from random import Random

from soak.simulation.system.clock import SimulatedLoop

LATE = 0.002
"""The longest time, s, that such a thread wakes up late."""


class Pacer:
    """In place of `multidrop.drives.pacing.Pacer`."""

    def __init__(self, loop: SimulatedLoop, rng: Random) -> None:
        self._loop, self._rng = loop, rng
        self._due: dict[object, asyncio.TimerHandle] = {}

    def begin(self) -> None:
        """Begin nothing: the loop is there."""

    def after(self, owner: object, seconds: float, work: Callable[[], None]) -> None:
        """Call `work` so many seconds from now, in place of what this owner has asked for before."""
        if (before := self._due.pop(owner, None)) is not None:
            before.cancel()
        self._due[owner] = self._loop.call_later(seconds + self._rng.random() * LATE, self._run, owner, work)

    def _run(self, owner: object, work: Callable[[], None]) -> None:
        self._due.pop(owner, None)
        work()
