"""Lines, stops, outages and power cuts at random moments, in virtual time: every bus comes back, nothing runs twice."""

from __future__ import annotations

import asyncio
from pathlib import Path
from random import Random

import pytest

from multidrop.base.errors import DriveError, TransportLost
from tests.support.cell_session import ETHERNET, CellSession, bus, party
from tests.support.mcode_drives import Witness

pytestmark = pytest.mark.virtual

ORDINARY, ALL = 2, 60
WAITS = (0.001, 0.01, 0.05, 0.3, 1.0, 3.0)
DRIVES = ("line:a", "line:b", "eth:!")


class Day:
    """One session and what happens to it. The numbers of the commands tell them apart."""

    def __init__(self, shop: CellSession, random: Random) -> None:
        self._shop, self._random = shop, random
        self.sent: list[tuple[str, str]] = []
        self.witnesses = {name: Witness(shop.device(name)) for name in DRIVES}
        self._tasks: list[asyncio.Task[bool]] = []
        self.stopped_last = False

    async def run(self) -> None:
        """Let things happen, then plug in all, and wait until every line has ended."""
        for _ in range(self._random.randrange(8, 25)):
            await getattr(
                self, self._random.choice(("command", "command", "outage", "outage", "stop", "wait", "cut"))
            )()
            await asyncio.sleep(self._random.choice((0.0, 0.003, 0.02)))
        for name in self._shop.session.buses:
            self._shop.world(f"/sim plug {name}")
        await asyncio.gather(*self._tasks)

    async def command(self) -> None:
        drive, number = self._random.choice(DRIVES), len(self.sent)
        text = self._random.choice((f"SL {10_000 + number}", f"MR {50_000 + number}", f"R1={number}"))
        self.sent.append((drive, text))
        self._tasks.append(asyncio.create_task(self.succeeds(drive, text)))
        self.stopped_last = False

    async def succeeds(self, drive: str, text: str) -> bool:
        name, _, address = drive.partition(":")
        try:
            await self._shop.session.run(f"@{name}:{address.strip('!')} {text}")
        except (DriveError, TransportLost):
            return False
        return True

    async def outage(self) -> None:
        what, name = self._random.choice(("plug", "unplug")), self._random.choice(("line", "eth"))
        self._shop.world(f"/sim {what} {name}")

    async def stop(self) -> None:
        self._shop.session.stop()
        self._shop.session.resume()
        self.stopped_last = True

    async def wait(self) -> None:
        await asyncio.sleep(self._random.choice(WAITS))

    async def cut(self) -> None:
        drive = self._random.choice(DRIVES)
        self._shop.world(f"/sim power {drive} off")
        await self.wait()
        self._shop.world(f"/sim power {drive} on")


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=() if n < ORDINARY else pytest.mark.nightly) for n in range(ALL)]
)
async def test_every_bus_comes_back_and_nothing_is_executed_twice(tmp_path: Path, seed: int) -> None:
    random = Random(seed)
    modes = {"EM": random.randrange(3), "CK": random.randrange(2), "ES": random.choice((0, 1, 3))}
    cell = [bus("line", party("a", **modes), party("b", **modes)), bus("eth", ETHERNET, baud=0)]
    async with CellSession(tmp_path, *cell, reconnect=True) as shop:
        buses = shop.session.buses.values()
        for each in buses:
            each.telemetry.subscribe(list(each.drives), 0.05)
        day = Day(shop, random)
        await day.run()
        async with asyncio.timeout(120.0):
            while any(each.lost for each in buses) or shop.session.reconnections.trying:
                await asyncio.sleep(0.05)
            for each in buses:
                await each.settled()
        await asyncio.sleep(2.0)
        assert not (day.stopped_last and shop.moving())
        for drive, text in day.sent:
            assert len(day.witnesses[drive].executed(text)) <= 1, text
        for drive in DRIVES:
            assert any([await day.succeeds(drive, "PR P") for _ in range(3)]), drive
