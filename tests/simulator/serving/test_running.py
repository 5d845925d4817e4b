"""The floor's time beside the clock."""

from __future__ import annotations

import asyncio

import pytest

from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import LATEST, RunningFloor
from tests.support.virtual import in_virtual_time

CELL = '[[bus]]\nname = "w"\nbaud = 1200\n[[bus.drive]]\npersonality = "LMDCM"\n'


class Heard:
    """A client that keeps what it hears."""

    def __init__(self) -> None:
        self.data = b""

    def receive(self, data: bytes) -> None:
        self.data += data


@in_virtual_time
async def test_a_process_that_stood_still_makes_up_for_a_tenth_of_a_second_and_serves_on() -> None:
    loop, floor, client = asyncio.get_running_loop(), RunningFloor(Floor(read(CELL, "cell"))), Heard()
    floor.attach("w", client)  # type: ignore[arg-type]
    await asyncio.sleep(10.0)
    assert floor.now() == pytest.approx(loop.time())
    floor.write("w", b"PR 5\r")
    begun = floor.now()
    loop._impatient.skipped += 60.0  # type: ignore[attr-defined]
    stood = floor.now()
    assert begun < stood <= begun + LATEST + 0.1
    await asyncio.sleep(1.0)
    assert b"5" in client.data
    assert floor.now() == pytest.approx(stood + 1.0)
    floor.close()
