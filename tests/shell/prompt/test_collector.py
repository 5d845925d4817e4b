"""The garbage collector keeps out of the stop's way: it visits what is kept only while everything is at rest."""

import asyncio
import gc
import weakref

import pytest

from multidrop.shell.prompt import collector
from multidrop.shell.prompt.collector import collected_at_rest

pytestmark = pytest.mark.virtual


class Kept:
    """Holds itself, so that only the collector can take it away."""

    def __init__(self):
        self.itself = self


async def frozen_cycle():
    """A cycle that was alive when it was frozen and is garbage now."""
    kept = Kept()
    await asyncio.sleep(2 * collector.FREEZE)
    return weakref.ref(kept)


async def test_what_survives_is_frozen_each_second_and_visited_no_more():
    with collected_at_rest(lambda: False):
        kept = [Kept() for _ in range(1000)]
        await asyncio.sleep(1.5 * collector.FREEZE)
        assert len(kept) < gc.get_freeze_count()
        assert not [each for each in gc.get_objects() if isinstance(each, Kept)]
    assert gc.get_freeze_count() == 0


@pytest.mark.slow
async def test_everything_is_collected_while_all_is_at_rest():
    resting = False
    with collected_at_rest(lambda: resting):
        lost = await frozen_cycle()
        await asyncio.sleep(2 * collector.FULL)
        assert lost() is not None
        resting = True
        await asyncio.sleep(2 * collector.FREEZE)
        assert lost() is None


async def test_a_machine_that_never_rests_is_collected_all_the_same_in_the_end():
    with collected_at_rest(lambda: False):
        lost = await frozen_cycle()
        await asyncio.sleep(collector.LONGEST_UNCOLLECTED)
        assert lost() is None


async def test_what_runs_each_second_visits_the_youngest_generations_only():
    visited = []

    def collects(phase, info):
        if phase == "start":
            visited.append(info["generation"])

    gc.collect()  # no collection of the oldest is due by itself
    with collected_at_rest(lambda: False):
        gc.callbacks.append(collects)
        try:
            await asyncio.sleep(3.5 * collector.FREEZE)
        finally:
            gc.callbacks.remove(collects)
    assert len(visited) >= 3 and max(visited) == 1
