"""Work that a stop can end: how it ends, and what its caller gets."""

from __future__ import annotations

import asyncio

import pytest

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.shell.channel import Tasks


async def _forever() -> None:
    await asyncio.Event().wait()


async def _of_a_cancelled_one() -> None:
    other = asyncio.ensure_future(_forever())
    other.cancel()
    await other


async def test_work_that_a_stop_ends_is_stopped() -> None:
    tasks = Tasks(lambda: None)
    work = asyncio.ensure_future(tasks.run(_forever()))
    await asyncio.sleep(0)
    tasks.stop()
    with pytest.raises(Stopped, match="^stopped before it was done$"):
        await work


async def test_work_whose_caller_is_cancelled_is_cancelled() -> None:
    work = asyncio.ensure_future(Tasks(lambda: None).run(_forever()))
    await asyncio.sleep(0)
    work.cancel()
    with pytest.raises(asyncio.CancelledError):
        await work


async def test_work_that_awaits_what_was_cancelled_has_failed() -> None:
    with pytest.raises(Diagnostic, match="^cancelled before it was done$"):
        await Tasks(lambda: None).run(_of_a_cancelled_one())
