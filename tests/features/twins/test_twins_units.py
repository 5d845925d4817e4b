"""What a twin shows in units."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.shell.events import Notified, Output
from tests.support.cell_session import CellSession, bus, party
from tests.support.twin_cell import run

pytestmark = pytest.mark.virtual


async def test_a_twin_and_its_drive_are_apart_in_units_too(tmp_path: Path) -> None:
    stalled = party("a", 'units = "5 mm/turn"', 'world = { stall_at = "1 mm" }', EE=1)
    async with CellSession(tmp_path, bus("press", stalled)) as shop:
        await run(shop, "/twin on", "MR {4 mm}")
        await asyncio.sleep(5)
        said = [each.text for each in shop.events if isinstance(each, Notified) and "from its twin" in each.text]
        shop.events.clear()
        await run(shop, "/twin")
        rows = [each.text for each in shop.events if isinstance(each, Output)]
    assert said and " mm) from its twin since " in said[0]
    assert any("apart by -2400 steps (-3 mm)" in each for each in rows), rows
