"""A twin beside a drive whose requests are on their way for a time that varies: a loaded PC, a network."""

from __future__ import annotations

import asyncio
from pathlib import Path
from random import Random

import pytest

from multidrop.shell.events import Diverged
from multidrop.simulator.serving.in_process import SimPipe
from tests.support.cell_session import CellSession, bus, party
from tests.support.twin_cell import of, run

pytestmark = pytest.mark.virtual
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
