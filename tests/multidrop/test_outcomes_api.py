"""Motions that fail, in Python: `MotionFailed` with reason, position and target."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from multidrop import AsyncSession, MotionFailed, connect_async
from tests.support.cell_session import bus, drive

pytestmark = pytest.mark.virtual
CELL = bus(
    "line", drive("LMDCM", "a", 'set = { EM = 1, IS = ["1,2,0"] }', "world = { limit_plus = 30000 }", party=True)
)


@pytest.fixture
async def session(tmp_path: Path) -> AsyncIterator[AsyncSession]:
    (tmp_path / "cell.toml").write_text(CELL)
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}") as opened:
        yield opened


async def test_a_wait_for_a_value_raises_early(session: AsyncSession) -> None:
    axis = session.drive("a")
    await axis.move_to(90000)
    with pytest.raises(MotionFailed):
        await axis.wait_for("P>=90000")


async def test_the_next_move_of_a_failed_motion_raises(session: AsyncSession) -> None:
    axis = session.drive("a")
    await axis.move_to(90000)
    while await axis.moving():
        await asyncio.sleep(0.1)
    with pytest.raises(MotionFailed, match="'MA 0' was not sent"):
        await axis.move_to(0)
    await axis.move_to(0)  # it was reported once
    await axis.wait()


async def test_own_stops_and_reached_targets_do_not_raise(session: AsyncSession) -> None:
    axis = session.drive("a")
    await axis.move_to(20000)
    await axis.wait()
    await axis.run_at(-20000)
    await axis.run_at(0)
    await axis.wait()
    await axis.move_to(-900000)
    await axis.stop()
    await axis.wait()
