"""Garbage collection that does not delay the stop.

Theory of operation. A collection of the oldest generation visits every object, and nothing else runs meanwhile: half a
second with half a million transcript lines (measured). So each second the youngest generations are collected, and the
survivors are frozen: later collections do not visit them. Objects without cycles are still freed with their last
reference. Cycles among frozen objects wait for a full collection. It runs while everything is at rest, when half a
second of delay does no harm. On a machine that never rests it runs once an hour.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
from collections.abc import Callable, Iterator

FREEZE = 1.0
"""The time between two freezes, s."""
FULL = 60.0
"""The shortest time between two full collections, s."""
LONGEST = 3600.0
"""The longest time between two full collections, s."""
YOUNG = 1
"""The oldest generation collected before each freeze."""


@contextlib.contextmanager
def collected_at_rest(resting: Callable[[], bool]) -> Iterator[None]:
    """Freeze survivors each second; collect everything only while `resting()`. Needs a running event loop."""
    collector = _Collector(resting)
    collector.begin()
    try:
        yield
    finally:
        collector.end()


class _Collector:
    def __init__(self, resting: Callable[[], bool]) -> None:
        self._resting = resting
        self._loop = asyncio.get_running_loop()
        self._full_at = self._loop.time()
        self._timer: asyncio.TimerHandle | None = None

    def begin(self) -> None:
        """Freeze what the imports made: none of it is garbage, and a collection would delay the first frame."""
        self._freeze()

    def end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        gc.unfreeze()

    def _freeze(self) -> None:
        gc.freeze()
        self._timer = self._loop.call_later(FREEZE, self._again)

    def _again(self) -> None:
        waited = self._loop.time() - self._full_at
        if waited >= LONGEST or (waited >= FULL and self._resting()):
            self._full_at = self._loop.time()
            gc.unfreeze()
            gc.collect()
        else:
            gc.collect(YOUNG)
        self._freeze()
