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

from multidrop.shell.workspace import Workspace

FREEZE = 1.0
"""The time between two freezes, s."""
FULL = 60.0
"""The shortest time between two full collections, s."""
LONGEST_UNCOLLECTED = 3600.0
"""The longest time between two full collections, s."""
YOUNG = 1
"""The oldest generation collected before each freeze."""


def at_rest(workspace: Workspace) -> bool:
    """True if nothing runs, and the last reading of every drive showed velocity 0."""
    readings = [drive.seen for bus in workspace.buses.values() for drive in bus.all_drives if drive.seen is not None]
    return not workspace.busy and not any(reading.velocity for reading in readings)


@contextlib.contextmanager
def collected_at_rest(resting: Callable[[], bool]) -> Iterator[None]:
    """Freeze survivors each second; collect everything only while `resting()`. Needs a running event loop."""
    loop = asyncio.get_running_loop()
    full_at = loop.time()
    timer: asyncio.TimerHandle
    gc.freeze()  # what the imports made is no garbage, and a collection would delay the first frame

    def again() -> None:
        nonlocal full_at, timer
        waited = loop.time() - full_at
        if waited >= LONGEST_UNCOLLECTED or (waited >= FULL and resting()):
            full_at = loop.time()
            gc.unfreeze()
            gc.collect()
        else:
            gc.collect(YOUNG)
        gc.freeze()
        timer = loop.call_later(FREEZE, again)

    timer = loop.call_later(FREEZE, again)
    try:
        yield
    finally:
        timer.cancel()
        gc.unfreeze()
