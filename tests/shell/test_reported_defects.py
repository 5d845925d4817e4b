"""A defect in work that nobody waits for: it is reported, and the rest goes on."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from multidrop.dialects import Procedure
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.events import Sample
from multidrop.shell.events import OnBus, StateChanged
from tests.support.cell_session import CellSession, bus, party
from tests.support.until import until

pytestmark = pytest.mark.virtual

LINE = bus("line", party("a"), party("b"))


def defective(*_: Any) -> Any:
    raise KeyError("a defect")


def failing() -> Procedure[Any]:
    raise KeyError("a defect")
    yield  # a procedure


async def lost_and_back(shop: CellSession) -> None:
    shop.world("/sim unplug line")
    await until(lambda: shop.session.buses["line"].lost)
    shop.events.clear()
    shop.world("/sim plug line")
    await until(lambda: not shop.session.reconnections.trying)


async def test_a_return_that_a_defect_ends_is_said_and_leaves_the_bus_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async with CellSession(tmp_path, LINE, reconnect=True) as shop:
        monkeypatch.setattr(Bus, "find_again", defective)
        await lost_and_back(shop)
        assert shop.session.buses["line"].lost
        assert shop.warned() == ["line is lost and not tried again (a defect: KeyError); /close it, then open it"]
        assert isinstance(shop.events[-1], StateChanged)  # a plot that waits for the bus ends
        assert "the return of line failed" in caplog.text and "KeyError: 'a defect'" in caplog.text
        monkeypatch.undo()
        await shop.session.run("/close line")
        await shop.session.open(shop.url)
        assert await shop.session.run("PR P") is None and shop.printed() == ["0"]


async def test_a_defect_behind_the_return_is_said_and_the_bus_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with CellSession(tmp_path, LINE, reconnect=True) as shop:
        await shop.session.run("@a SL 5000")
        monkeypatch.setattr(Drive, "motion", defective)
        await lost_and_back(shop)
        assert not shop.session.buses["line"].lost
        assert shop.warned()[-1] == "line is back, but whether a drive moves was not read (a defect: KeyError)"


async def test_a_poll_that_a_defect_ends_is_said_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async with CellSession(tmp_path, LINE) as shop:
        line = shop.session.buses["line"]
        a = line.drives["a"]
        monkeypatch.setattr(a, "start_motion", lambda priority, over: a.start(failing(), over))
        line.telemetry.subscribe(["a", "b"], 0.5)
        await asyncio.sleep(50)
        assert len(shop.warned()) == 1 and "Traceback" in caplog.text
        assert shop.warned()[0] == "line: a: the poll failed (a defect: KeyError); it is polled again in 60 s"
        monkeypatch.undo()
        await asyncio.sleep(12)
        sampled = [e.event.address for e in shop.events if isinstance(e, OnBus) and isinstance(e.event, Sample)]
        assert 120 <= sampled.count("b") <= 126 and 1 < sampled.count("a") < 8
