"""Blocking work beside the event loop, in threads that may be abandoned."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


async def in_thread(work: Callable[[], T], timeout: float, name: str = "blocking work") -> T:
    """Run blocking work in a thread that the process does not wait for. Raises TimeoutError, and abandons the thread.

    Not `to_thread`: the interpreter joins its threads at the end, and a thread that waits for a frozen program never
    ends.
    """
    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()

    def settle(result: T | None, error: BaseException | None) -> None:
        if future.done():
            return
        if error is not None:
            future.set_exception(error)
        else:
            future.set_result(result)  # type: ignore[arg-type]

    def thread() -> None:
        result: T | None = None
        failure: BaseException | None = None
        try:
            result = work()
        except BaseException as error:  # raised again by the future
            failure = error
        with contextlib.suppress(RuntimeError):  # the loop was closed meanwhile
            loop.call_soon_threadsafe(settle, result, failure)

    threading.Thread(target=thread, name=name, daemon=True).start()
    return await asyncio.wait_for(future, timeout)
