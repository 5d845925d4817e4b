"""A twin beside a drive: a second simulated cell is the real one, which stalls, slips or is set otherwise."""

from __future__ import annotations

import asyncio
from pathlib import Path
from random import Random

import pytest

from multidrop.base.errors import DriveError
from multidrop.features.twins.twins import Twins
from multidrop.shell.events import Agreed, Diverged, Predicted
from multidrop.simulator.serving.in_process import SimPipe
from tests.support.cell_session import CellSession, bus, party
from tests.support.twin_cell import encoder, of, run

pytestmark = pytest.mark.virtual


MOVES = ("@a MR 100000", "@b MA -51200", "@a SL 50000", "@a VM=100000", "@a SL 0", "@a MA 0")


async def test_a_drive_that_does_what_its_twin_does_agrees_to_the_step(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a", VM=200000), party("b"), baud=0)) as cell:
        await run(cell, "@a P=1234", "/twin on")
        for line in MOVES:
            await run(cell, line, "/sleep 0.9")
        await run(cell, "/sleep 1")
        assert len(of(cell, Predicted)) > 100
        assert {each.difference for each in of(cell, Predicted)} <= {-1, 0, 1}


async def test_bytes_that_take_their_time_are_no_reason_for_a_warning(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a", VM=200000))) as cell:
        await run(cell, "/twin on")
        for line in ("@a MR 100000", "@a SL 50000", "@a MA 0"):
            await run(cell, line, "/sleep 1.1")
        await run(cell, "/sleep 1")
        assert of(cell, Diverged) == []
        assert [each.difference for each in of(cell, Predicted)][-2:] == [0, 0], "after an absolute move"
        await run(cell, "@a SL 200000", "/sleep 0.6", "@a SL 0", "/sleep 0.8")
        assert [each.difference for each in of(cell, Predicted)][-2:] == [0, 0], "the twin took the place of the drive"


async def test_a_program_whose_lines_take_longer_is_kept_in_step(tmp_path: Path) -> None:
    lines = "PG 1\nLB G1\nMR 51200\nH\nMR -51200\nH\nBR G1\nE\nPG"
    drive = party("a", VM=200000) + f'\ninstruction_us = 900\nprogram_text = """\n{lines}\n"""'
    async with CellSession(tmp_path, bus("press", drive, baud=0)) as cell:
        await run(cell, "/twin on", "EX G1", "/sleep 13")
        assert of(cell, Diverged) == []
        cell.device("press:a").execute("VM=150000", cell.floor.now())
        await asyncio.sleep(3)
        assert of(cell, Diverged)[0].causes[0] == "settings changed"


@pytest.mark.parametrize(
    ("drive", "moves", "push", "cause"),
    [
        (encoder(world="stall_at = 20000"), ("MR 16000", "/sleep 3"), "", "stall"),
        (encoder(), ("MR 16000", "/sleep 0.7"), "push a -20000", "slip"),
        (encoder(), (), "push a 20000", "slip"),
        (encoder(world="load = 1.2", SF=60000), ("MR 16000", "/sleep 3"), "", "load"),
    ],
    ids=["a stall", "a push", "a push at rest", "a load that the motor does not turn"],
)
async def test_the_cause_is_named_first(
    tmp_path: Path, drive: str, moves: tuple[str, ...], push: str, cause: str
) -> None:
    async with CellSession(tmp_path, bus("press", drive)) as cell:
        await run(cell, "/twin on", *moves)
        if push:
            cell.world(push)
            await asyncio.sleep(1.0)
        (diverged,) = of(cell, Diverged)
        assert diverged.causes[0] == cause
        assert cause != "stall" or diverged.difference < -50


async def test_another_acceleration_is_named_a_setting(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a", VM=200000, A=400000))) as cell:
        await run(cell, "/twin on")
        cell.device("press:a").execute("A=150000", cell.floor.now())
        await run(cell, "MR 200000", "/sleep 3")
        diverged, *more = of(cell, Diverged)
        assert diverged.causes[0] == "settings changed"
        assert more == [] and len(of(cell, Agreed)) == 1


async def nothing_is_read(cell: CellSession) -> None:
    assert list(cell.session.hooks.part(Twins).rows()) == []
    cell.events.clear()
    await asyncio.sleep(2)
    assert cell.written("press") == b"" and not cell.session.buses["press"].witnesses.all


async def test_off_while_drives_are_read_begins_no_twin_more(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as cell:
        task = cell.session.start("/twin on")
        await asyncio.sleep(2.5)
        assert len(list(cell.session.hooks.part(Twins).rows())) == 1, "the second is being read"
        await run(cell, "/twin off")
        assert not await task
        assert not any(each.startswith("b: a twin runs") for each in cell.told())
        await nothing_is_read(cell)


async def test_off_ends_twins_that_each_drive_was_to_get(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as cell:
        cell.session.hooks.part(Twins).wanted = True
        cell.session.hooks.part(Twins).identified(cell.session.buses["press"])
        await asyncio.sleep(0.5)
        await run(cell, "/twin off")
        cell.session.hooks.part(Twins).identified(cell.session.buses["press"])
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
        assert len(list(cell.session.hooks.part(Twins).rows())) == 1


async def test_a_drive_may_get_another_name_while_others_are_read(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as cell:
        task = cell.session.start("/twin on")
        await asyncio.sleep(0.5)
        await run(cell, '@b DN="k"')
        assert await task
        assert [each[:2] for each in cell.session.hooks.part(Twins).rows()] == ["a:", "k:"]


LATE = 0.15
SHARE = 0.2
"""The part of the requests that are late."""


class Way:
    """The way to a simulated bus: some requests come late, none overtakes another."""

    def __init__(self, seed: int) -> None:
        self._random, self._last, self._write = Random(seed), 0.0, SimPipe.write

    def write(self, pipe: SimPipe, data: bytes) -> bool:
        loop = asyncio.get_running_loop()
        late = self._random.uniform(0, LATE) if self._random.random() < SHARE else 0.0
        self._last = max(self._last, loop.time() + late)
        loop.call_at(self._last, self._write, pipe, data)
        return True


async def test_requests_that_come_late_are_no_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with CellSession(tmp_path, bus("press", party("a", VM=300000), baud=0)) as cell:
        way = Way(4)
        monkeypatch.setattr(SimPipe, "write", lambda pipe, data: way.write(pipe, data))
        await run(cell, "/twin on", "/sleep 1")
        for n in range(12):
            await run(cell, f"MR {300000 * (-1) ** n}", "/sleep 0.7")
            if n % 2:
                cell.session.stop()
            await run(cell, "/sleep 1.5", "/resume")
        assert of(cell, Diverged) == []
