"""TMCL programs from a session: what a download says, a running program, a stop in its middle, trace and step."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

from multidrop.base.errors import Stopped
from tests.support.cell_session import CellSession, bus, drive
from tests.support.transfers import kept

pytestmark = [pytest.mark.virtual, pytest.mark.slow]

FILE = "Loop: MVP ABS, 0, 20000 // far\n  WAIT POS, 0, 0\n  MVP ABS, 0, 0\n  WAIT POS, 0, 0\n  JA Loop\n"
LONG = "  CALC ADD, 1\n" * 200 + "  STOP\n"


def shop_of(folder: Path) -> CellSession:
    (folder / "p.tmc").write_text(FILE)
    return CellSession(folder, bus("slide", drive("TMCM")))


async def load(shop: CellSession, folder: Path, *options: str) -> list[str]:
    shop.events.clear()
    await shop.session.run(" ".join((f"/download {folder / 'p.tmc'} 1", *options)))
    return [text.replace(f"{folder}{os.sep}", "") for text in shop.told()]


async def test_a_download_says_what_it_has_done_and_its_backup_brings_back_what_was_there(tmp_path: Path) -> None:
    async with shop_of(tmp_path) as shop:
        told = await load(shop, tmp_path)
        (path,) = kept(tmp_path)
        assert told == [
            f"backup: data/backups/{path.name}",
            "1: p.tmc downloaded, 5 lines",
            "1: verified, 5 lines",
        ]
        assert path.read_text().startswith("// multidrop backup of slide, drive 1, ")
        (tmp_path / "p.tmc").write_text("STOP\n")
        told = await load(shop, tmp_path, "--save")
        assert "1: it keeps programs at once; --save sends nothing" in told
        assert any("3 lines from address 2 on stay as they were" in text for text in told)
        await shop.session.run(f"/download {kept(tmp_path)[-1]} 1")
        assert [call.command for call in shop.device("slide:1").program.memory] == [4, 27, 4, 27, 22]


async def test_a_running_program_is_ended_and_its_motor_stopped_before_the_download(tmp_path: Path) -> None:
    async with shop_of(tmp_path) as shop:
        await load(shop, tmp_path, "--run Loop")
        await asyncio.sleep(0.3)
        (tmp_path / "p.tmc").write_text("STOP\n")
        told = await load(shop, tmp_path)
        assert "1: its program ran and was ended" in told and told[-1] == "1: verified, 1 line"
        await shop.session.run("@1 GAP 3, 0")
        assert shop.printed()[-1] == "0"


async def test_a_stop_in_a_download_says_what_is_stored_and_leaves_no_download_mode(tmp_path: Path) -> None:
    async with shop_of(tmp_path) as shop:
        (tmp_path / "p.tmc").write_text(LONG)
        task = asyncio.get_running_loop().create_task(load(shop, tmp_path))
        program = shop.device("slide:1").program
        while len(program.memory) < 50:
            await asyncio.sleep(0.01)
        shop.session.stop("Ctrl+X")
        with pytest.raises(Stopped):
            await task
        await shop.session.buses["slide"].stopped()
        await asyncio.sleep(3.0)
        assert not program.storing and not shop.session.buses["slide"].drives["1"].programming
        told = shop.told()
        assert any("of 201 lines are stored: the program in module 1 is incomplete" in text for text in told), told
        assert any("what was in it before is in" in text for text in told)
        assert {call.command for call in program.memory} == {19}, "no frame of the stop became a line"


async def test_a_program_is_listed_traced_broken_and_stepped(tmp_path: Path) -> None:
    async with shop_of(tmp_path) as shop:
        await load(shop, tmp_path)
        await shop.session.run("/list 1")
        assert shop.printed()[0] == "0  Loop: MVP ABS, 0, 20000 // far"
        tracing = asyncio.get_running_loop().create_task(shop.session.run("/trace 1"))
        await asyncio.sleep(2.5)
        await shop.session.run("/break 1 now")
        await tracing
        assert any("the program waits" in text for text in shop.told())
        shop.session.stop()
        await shop.session.buses["slide"].stopped()
        await shop.session.run("/resume")
        await shop.session.run("/step 1 0")
        shop.events.clear()
        await shop.session.run("/step 1")
        assert shop.printed()[-1].startswith("0  Loop: MVP ABS, 0, 20000")
