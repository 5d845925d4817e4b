"""Twins over a line whose bytes come late and in heaps: no false alarm, and each stall is found."""

from __future__ import annotations

import asyncio
from pathlib import Path
from random import Random

import pytest

from multidrop.shell.events import Diverged
from multidrop.simulator.serving.in_process import SimPipe
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx
from tests.support.twin_cell import of, run

pytestmark = pytest.mark.virtual


class SlowLine:
    """A way to a simulated bus and back: some milliseconds, and now and then some tenths of a second."""

    def __init__(self, seed: str) -> None:
        self._random = Random(seed)
        self._there = self._back = self._heard = 0.0
        self._write, self._receive = SimPipe.write, SimPipe.receive

    def _late(self) -> float:
        return self._random.uniform(0.1, 0.4) if self._random.random() < 0.02 else self._random.uniform(0.005, 0.03)

    def write(self, pipe: SimPipe, data: bytes) -> bool:
        loop = asyncio.get_running_loop()
        self._there = max(self._there + 1e-7, loop.time() + self._late())
        loop.call_at(self._there, self._write, pipe, data)
        return True

    def receive(self, pipe: SimPipe, data: bytes) -> None:
        """Bytes of one reply stay together."""
        loop = asyncio.get_running_loop()
        now, before = loop.time(), self._heard
        self._heard = now
        self._back = max(self._back + 1e-7, now + (self._late() if now - before > 0.004 else 0.0))
        loop.call_at(self._back, self._receive, pipe, bytes(data))


CELLS = {
    "TMCL": ('personality = "TMCM"\nname = "1"', 9600, []),
    "PMX": (pmx("00"), 9600, ["HSPD=20000", "LSPD=1000", "ACC=300", "EO=3"]),
    "MCode": (party("a", VM=200000), 9600, []),
    "Modbus": (ETHERNET, 0, []),
}


def moves(family: str, number: int, random: Random) -> list[str]:
    way = random.choice([300, 2000, 20000, 60000]) * (1 if number % 2 else -1)
    wait = f"/sleep {random.uniform(0.5, 3):.2f}"
    if family == "TMCL":
        jog = [f"{'ROR' if way > 0 else 'ROL'} 0, {abs(way) // 2 + 500}", wait]
        return random.choice([[f"MVP REL, 0, {way}"], [*jog, "MST 0"], [*jog, "ROR 0, 9000", wait, "MST 0"]])
    if family == "PMX":
        chosen = random.choice([[f"X{way}"], [f"Y{way}"], ["JX+" if way > 0 else "JX-", wait, "STOPX"]])
        return [*chosen, "/wait stopped"]  # a target is absolute: the way to it may be long
    return random.choice([[f"MR {way}"], [f"SL {way}", wait, "SL 0"], [f"SL {way}", wait, f"SL {way // 2}", "SL 0"]])


@pytest.mark.parametrize(
    ("family", "minutes"),
    [("TMCL", 1), *(pytest.param(each, 42, marks=pytest.mark.nightly) for each in CELLS)],
)
async def test_a_slow_line_is_no_alarm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, family: str, minutes: int
) -> None:
    way, random = SlowLine(f"{family} way"), Random(f"{family} moves")
    monkeypatch.setattr(SimPipe, "write", lambda pipe, data: way.write(pipe, data))
    monkeypatch.setattr(SimPipe, "receive", lambda pipe, data: way.receive(pipe, data))
    real, baud, settings = CELLS[family]
    async with CellSession(tmp_path, bus("b", real, baud=baud)) as cell:
        await run(cell, *settings, "/twin on")
        end, number = asyncio.get_running_loop().time() + 60 * minutes, 0
        while asyncio.get_running_loop().time() < end:
            number += 1
            await run(cell, *moves(family, number, random), f"/sleep {random.uniform(4, 7):.2f}")
            assert of(cell, Diverged) == []
            cell.events.clear()


async def test_a_stall_is_found_over_a_slow_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    way = SlowLine("stalls")
    monkeypatch.setattr(SimPipe, "write", lambda pipe, data: way.write(pipe, data))
    monkeypatch.setattr(SimPipe, "receive", lambda pipe, data: way.receive(pipe, data))
    async with CellSession(tmp_path, bus("b", CELLS["TMCL"][0])) as cell:
        await run(cell, "/twin on")
        for number in range(6):
            await run(cell, f"MVP ABS, 0, {(-1) ** number * 90000}", f"/sleep {0.3 + number / 10}")
            cell.device("b:1").motors[0].freeze(cell.floor.now())
            await asyncio.sleep(4)
            assert len(of(cell, Diverged)) == 1
            cell.events.clear()
            await run(cell, "MST 0", "/twin on")
