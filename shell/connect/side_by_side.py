"""Work that is done side by side, with results that count in its order."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, TypeVar

T = TypeVar("T")


async def side_by_side(
    works: Sequence[Coroutine[Any, Any, T]],
    ready: Callable[[T], None],
    failed: Callable[[int, BaseException], None] | None = None,
) -> None:
    """Await all work at once; call `ready` with each result, in the order of the work.

    A failure goes to `failed`, and the rest goes on; without `failed` the rest is cancelled and the failure raised.
    A cancellation of the caller cancels all work. Nothing is left running on return.
    """
    tasks = [asyncio.ensure_future(work) for work in works]
    pending, passed = set(tasks), 0
    try:
        while pending:
            done, pending = await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
            for number, task in enumerate(tasks):
                if task in done and (failure := task.exception()) is not None:
                    if failed is None:
                        raise failure
                    failed(number, failure)
            while passed < len(tasks) and tasks[passed].done():
                if tasks[passed].exception() is None:
                    ready(tasks[passed].result())
                passed += 1
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
