"""Waiting for a condition on the clock of the loop, real or virtual."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

PATIENCE = 120.0
"""The longest wait in real time, s: it ends a test that hangs on a busy machine, and judges no speed."""


async def until(done: Callable[[], Any], limit: float = PATIENCE) -> float:
    """Wait until it is done; return how long that took, s."""
    loop = asyncio.get_running_loop()
    begun = loop.time()
    while not done():
        assert loop.time() < begun + limit, "in vain"
        await asyncio.sleep(0.005)
    return loop.time() - begun
