"""Lines that come while a download has its drive in program mode: they are judged as what they will be, executed."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.events import By
from tests.support.cell_session import CellSession, bus, party
from tests.support.transfers import FILE

pytestmark = pytest.mark.virtual


async def downloading(cell: CellSession, folder: Path) -> asyncio.Task[None]:
    """A download that has its drive in program mode."""
    (folder / "p.mxt").write_text(FILE)
    task = asyncio.create_task(cell.session.run(f"/download {folder / 'p.mxt'} a"))
    while not cell.session.drive("line", "a").programming:
        assert not task.done()
        await asyncio.sleep(0.001)
    return task


async def test_a_macro_sends_no_line_that_asks_first(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", party("a"))) as cell:
        task = await downloading(cell, tmp_path)
        cell.session.questions.agreed = False
        with pytest.raises(Diagnostic, match="DN"):
            await cell.session.run('@a DN="z"', replace(cell.session.origin, by=By.MACRO))
        await task
        assert b'DN="z"' not in cell.written("line")


async def test_a_move_counts_as_a_start(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", party("a"))) as cell:
        task = await downloading(cell, tmp_path)
        drive = cell.session.drive("line", "a")
        assert drive.programming and not drive.stores and drive.starts("SL 5000")
        await cell.session.run("@a SL 5000", replace(cell.session.origin, by=By.MACRO))
        await task
        assert cell.moving() == {"line:a"} and not drive.programming


async def test_a_line_behind_the_end_of_program_mode_counts_as_a_start(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", party("a"))) as cell:
        drive = cell.session.drive("line", "a")
        await cell.session.run("@a PG 1")
        assert drive.stores and not drive.starts("SL 5000")
        ends = asyncio.create_task(drive.send("PG"))
        await asyncio.sleep(0)
        assert drive.programming and drive.starts("SL 5000")
        await ends
