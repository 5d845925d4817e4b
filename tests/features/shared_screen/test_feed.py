"""What a watcher's stop does at the host of a shared screen: it is a stop of everything there."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import Stopped
from multidrop.features.shared_screen import feed
from multidrop.macros import Macro, MacroStep
from multidrop.shell.events import By
from tests.support.cell_session import CellSession, bus, party

pytestmark = [pytest.mark.virtual, pytest.mark.AF_UNIX]

FLOOR = bus("press", party("a"), party("b")), bus("gantry", party("c"))


async def test_a_watchers_stop_stops_every_drive_and_latches_macros_and_scripts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gates: list[Any] = []
    monkeypatch.setattr(feed, "Gate", lambda folder, loop, calls: gates.append(calls))
    async with CellSession(tmp_path, *FLOOR) as shop:
        session = shop.session
        app: Any = SimpleNamespace(
            session=session, presenter=SimpleNamespace(notes=[], on_records={}), stop_ahead=session.stop_ahead
        )
        feed.ScreenFeed(app, tmp_path)
        session.macros.save(Macro("m", (MacroStep(0.0, "@press:b SL 50000"), MacroStep(0.0, "/sleep 100"))))
        await session.run("@gantry:c SL 5000")
        playing = asyncio.create_task(session.run("/play m"))
        await asyncio.sleep(1.0)
        assert shop.moving() == {"press:b", "gantry:c"}
        (calls,) = gates
        calls.stop_ahead()
        calls.stop("ada")
        with pytest.raises(Stopped):
            await playing
        await asyncio.sleep(2.0)
        assert shop.moving() == set() and session.latched
        assert "stop by ada, who watches: stop sent to every drive; macros and scripts wait for /resume" in shop.told()
        with pytest.raises(Stopped):
            await session.run("/play m")
        for by in (By.MACRO, By.SCRIPT):
            with pytest.raises(Stopped):
                await session.run("@press:a MR 5", replace(session.origin, by=by))
        await session.run("/resume")
        await session.run("@press:a MR 5", replace(session.origin, by=By.SCRIPT))
