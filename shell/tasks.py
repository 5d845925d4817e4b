"""The tasks that a stop ends: verbs, scripts, macros, waits, downloads."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from multidrop.dialects import Stopped

T = TypeVar("T")


class Tasks:
    """Runs work so that a stop or an interruption can end it. `changed` is called at each begin and end."""

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._running: set[asyncio.Task[Any]] = set()
        self._stopped: set[asyncio.Task[Any]] = set()

    @property
    def busy(self) -> bool:
        """Whether any work runs."""
        return bool(self._running)

    async def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Await the work. Raises Stopped if a stop ended it."""
        task = asyncio.get_running_loop().create_task(work)
        self._running.add(task)
        self._changed()
        try:
            return await task
        except asyncio.CancelledError:
            if task in self._stopped:
                raise Stopped("stopped before it was done") from None
            raise
        finally:
            self._running.discard(task)
            self._stopped.discard(task)
            self._changed()

    def stop(self) -> None:
        """Cancel all work except the caller's; each `run` raises Stopped."""
        for task in self._others():
            self._stopped.add(task)
            task.cancel()

    async def stopped(self, limit: float) -> None:
        """Wait for the work that a stop has ended: it reads where drives stand, or leaves program mode."""
        if self._stopped:
            await asyncio.wait(self._stopped, timeout=limit)

    def cancel(self) -> None:
        """Cancel all work except the caller's."""
        for task in self._others():
            task.cancel()

    def _others(self) -> set[asyncio.Task[Any]]:
        return self._running - {_current()}


def _current() -> asyncio.Task[Any] | None:
    """The running task; None in a signal handler or a callback."""
    try:
        return asyncio.current_task()
    except RuntimeError:
        return None
