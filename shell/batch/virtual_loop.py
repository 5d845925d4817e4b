"""An event loop in virtual time: where nothing is ready, time goes on to the next timer."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor, wait
from typing import Any


class _Impatient(selectors.DefaultSelector):
    """Takes what is ready, and counts how long it would have waited."""

    def __init__(self) -> None:
        super().__init__()
        self.skipped = 0.0

    def select(self, timeout: float | None = None) -> list[Any]:
        ready = super().select(0)
        if ready or timeout is None:
            return ready or super().select(timeout)
        self.skipped += max(0.0, timeout)
        return ready


class VirtualLoop(asyncio.SelectorEventLoop):
    """Runs an hour of timers in no time. A call in a thread takes none either."""

    def __init__(self) -> None:
        self._impatient = _Impatient()
        super().__init__(self._impatient)
        self._clock_resolution = 1e-9  # that of the real clock, 16 ms on Windows, would let timers pass one another

    def time(self) -> float:
        return self._impatient.skipped

    def run_in_executor(  # type: ignore[override]
        self, executor: Executor | None, func: Callable[..., Any], *arguments: Any
    ) -> Any:
        """Wait for a thread's end here, so that time does not run on meanwhile."""
        with ThreadPoolExecutor(1) as threads:
            done = threads.submit(func, *arguments)
            wait([done])
        return asyncio.wrap_future(done, loop=self)
