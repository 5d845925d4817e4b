"""An event loop in a thread of its own, and calls into it from any other thread."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import queue
import threading
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

T = TypeVar("T")
new_loop: Callable[[], asyncio.AbstractEventLoop] = asyncio.new_event_loop
END_TIMEOUT = 5.0
"""The longest wait for the thread to end, s."""


class LoopEnded(RuntimeError):
    """The loop has ended."""


class LoopThread:
    """A running event loop. It is a daemon: it never keeps a process from ending."""

    def __init__(self) -> None:
        self._loop = new_loop()
        self._ended, self._ending = False, threading.Lock()
        """Work begins before the end, or is refused: none is left in a loop that runs no more."""
        self._thread = threading.Thread(target=self._run, daemon=True, name="multidrop")
        self._thread.start()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_forever()
        if left := asyncio.all_tasks(self._loop):
            for task in left:
                task.cancel()
            self._loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    @property
    def alive(self) -> bool:
        """True if the loop runs."""
        return self._thread.is_alive() and not self._ended

    def begin(self, work: Coroutine[Any, Any, T]) -> concurrent.futures.Future[T]:
        """Begin work in the loop, from another thread. Raises RuntimeError from its own, LoopEnded after its end."""
        if threading.current_thread() is self._thread:
            work.close()
            raise RuntimeError("a blocking call in the thread of its session would wait for itself")
        with self._ending:
            if not self._ended:
                return asyncio.run_coroutine_threadsafe(work, self._loop)
        work.close()
        raise LoopEnded

    def soon(self, function: Callable[[], object]) -> None:
        """Call a function in the loop, from any thread; an exception of it is the loop's."""
        self._loop.call_soon_threadsafe(function)

    def enter(self, context: contextlib.AbstractContextManager[object], leaving: contextlib.ExitStack) -> None:
        """Enter a context in the loop; `leaving` leaves it there."""

        async def begin() -> None:
            context.__enter__()

        async def end() -> None:
            context.__exit__(None, None, None)

        self.begin(begin()).result()
        leaving.callback(lambda: self.begin(end()).result())

    def end(self) -> None:
        """End the loop and its thread."""
        if self.alive and threading.current_thread() is not self._thread:
            with self._ending:
                self._ended = True
                self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(END_TIMEOUT)


class Notices:
    """Passes lines on in a thread of its own, so that the loop never waits for their reader."""

    def __init__(self, take: Callable[[str, bool], object]) -> None:
        self._take = take
        self._lines: queue.SimpleQueue[tuple[str, bool] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True, name="multidrop notices")
        self._thread.start()

    def __call__(self, text: str, warning: bool) -> None:
        """Pass a line on."""
        self._lines.put((text, warning))

    def end(self) -> None:
        """Wait until all lines are passed on, END_TIMEOUT at most."""
        self._lines.put(None)
        self._thread.join(END_TIMEOUT)

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            self._take(*line)
