"""The ends of twins that do not run yet, and what fails while several drives are read."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.dialects import DriveError
from tests.support.cell_session import CellSession, bus, party
from tests.support.twin_cell import run

pytestmark = pytest.mark.virtual


async def nothing_is_read(cell: CellSession) -> None:
    assert list(cell.session.twins.rows()) == []
    cell.events.clear()
    await asyncio.sleep(2)
    assert cell.written("press") == b"" and not cell.session.buses["press"].witnesses


async def test_off_while_drives_are_read_begins_no_twin_more(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as cell:
        task = cell.session.start("/twin on")
        await asyncio.sleep(2.5)
        assert len(list(cell.session.twins.rows())) == 1, "the second is being read"
        await run(cell, "/twin off")
        assert not await task
        assert not any(each.startswith("b: a twin runs") for each in cell.told())
        await nothing_is_read(cell)


async def test_off_ends_twins_that_each_drive_was_to_get(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        cell.session.twins.wanted = True
        cell.session.twins.identified(cell.session.buses["press"])
        await asyncio.sleep(0.5)
        await run(cell, "/twin off")
        cell.session.twins.identified(cell.session.buses["press"])
        await asyncio.sleep(5)
        await nothing_is_read(cell)


async def test_off_while_the_line_is_lost_counts_once_it_is_back(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a")), reconnect=True) as cell:
        await run(cell, "/twin on")
        cell.world("unplug press")
        await asyncio.sleep(1)
        await run(cell, "/twin off")
        cell.world("plug press")
        await asyncio.sleep(8)
        await nothing_is_read(cell)


async def test_each_drive_that_gets_no_twin_is_said(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"), party("c"))) as cell:
        await run(cell, "@a SL 500", "@b SL 500")
        with pytest.raises(DriveError, match="^a: it moves"):
            await cell.session.run("/twin on")
        assert [each[:21] for each in cell.warned()] == ["press: no twin: b: it"]
        assert len(list(cell.session.twins.rows())) == 1


async def test_a_drive_may_get_another_name_while_others_are_read(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as cell:
        task = cell.session.start("/twin on")
        await asyncio.sleep(0.5)
        await run(cell, '@b DN="k"')
        assert await task
        assert [each[:2] for each in cell.session.twins.rows()] == ["a:", "k:"]
