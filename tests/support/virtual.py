"""An event loop whose clock does not wait: where nothing is ready, time goes on to the next timer."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Coroutine
from typing import Any

from multidrop.shell.batch.virtual_loop import VirtualLoop

LONGEST = 1e6
"""Virtual seconds after which a test has failed."""


def hold_up(seconds: float) -> None:
    """Let the running loop be held up for so long, as on a slow PC: its clock goes on, and nothing else."""
    loop: Any = asyncio.get_running_loop()
    loop._impatient.skipped += seconds


def in_virtual_time(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Run an async test on such a loop."""

    async def limited(*arguments: Any, **named: Any) -> None:
        async with asyncio.timeout(LONGEST):
            await test(*arguments, **named)

    @functools.wraps(test)
    def run(*arguments: Any, **named: Any) -> None:
        with asyncio.Runner(loop_factory=VirtualLoop) as runner:
            runner.run(limited(*arguments, **named))

    return run
