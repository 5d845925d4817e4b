"""What a screen of settings asks of a session: a reading that is published, and a save that asks first."""

from __future__ import annotations

import asyncio

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Conditioned
from multidrop.shell.events import Notified, OnBus, SettingsRead
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual


async def test_a_reading_is_published_and_prints_nothing(tmp_path):
    async with CellSession(tmp_path, bus("line", party("a", VM=512000), party("b"))) as cell:
        await cell.session.run("/params read")
        await cell.session.run("/params read b")
        found = [event for event in cell.events if isinstance(event, SettingsRead)]
        assert [(each.bus, each.address) for each in found] == [("line", "a"), ("line", "b")]
        assert found[0].readings.values["VM"] == 512000
        assert cell.printed() == []


async def test_a_save_asks_first_and_each_family_does_it_its_way(tmp_path):
    async with CellSession(tmp_path, bus("line", party("a")), bus("pmx", pmx("00"))) as cell:
        asked = []

        async def no(question):
            asked.append(question)
            return False

        cell.session.questions.agreed, cell.session.front.ask = False, no
        with pytest.raises(Diagnostic):
            await cell.session.run("/params save line:a")
        assert len(asked) == 1 and b"aS" not in cell.written("line")
        cell.session.questions.agreed = True
        await cell.session.run("/params save line:a")
        await cell.session.run("/params save pmx:00")
        assert b"aS" in cell.written("line") and b"@00STORE\r" in cell.written("pmx")


@pytest.mark.parametrize("line", ["/params read a b", "/params save --save", "/params read --with VM", "/params reads"])
async def test_a_wrong_line_sends_nothing(tmp_path, line):
    async with CellSession(tmp_path, bus("line", party("a"))) as cell:
        with pytest.raises(Diagnostic):
            await cell.session.run(line)
        assert cell.written("line") == b""


# Conditions under attack


async def test_conditions_come_back_after_a_loss(tmp_path):
    async with CellSession(tmp_path, bus("line", party("a")), reconnect=True) as cell:
        telemetry = cell.session.buses["line"].telemetry
        telemetry.subscribe(["a"], 0.5)
        telemetry.watch(["a"], 1.0)
        await asyncio.sleep(3)
        cell.world("unplug line")
        await asyncio.sleep(5)
        cell.events.clear()
        cell.world("plug line")
        await asyncio.sleep(30)
        assert any(isinstance(event, OnBus) and isinstance(event.event, Conditioned) for event in cell.events)
        assert not any("defect" in event.text for event in cell.events if isinstance(event, Notified))


async def test_a_drive_without_power_is_asked_ever_less_and_a_stop_goes_first(tmp_path):
    async with CellSession(tmp_path, bus("line", party("a"), party("b"))) as cell:
        telemetry = cell.session.buses["line"].telemetry
        telemetry.watch(["a", "b"], 1.0)
        await asyncio.sleep(3)
        cell.world("power a off")
        cell.events.clear()
        await asyncio.sleep(30)
        assert cell.written("line").count(b"aPR") < 12
        assert any(
            isinstance(e, OnBus) and isinstance(e.event, Conditioned) and e.event.address == "b" for e in cell.events
        )
        cell.events.clear()
        cell.session.stop()
        await asyncio.sleep(0)
        assert b"PR" not in cell.written("line").split(b"\x1b")[0]


async def test_a_typed_line_is_answered_within_a_part(tmp_path):
    async with CellSession(tmp_path, bus("line", party("a"))) as cell:
        cell.session.buses["line"].telemetry.watch(["a"], 0.1)
        loop = asyncio.get_running_loop()
        worst = 0.0
        for _ in range(30):
            await asyncio.sleep(0.137)
            begun = loop.time()
            await cell.session.run("@a PR P")
            worst = max(worst, loop.time() - begun)
        assert worst < 0.3


async def test_an_ethernet_drive_is_watched_over_both_languages(tmp_path):
    async with CellSession(tmp_path, bus("line", ETHERNET)) as cell:
        cell.session.buses["line"].telemetry.watch([""], 1.0)
        await asyncio.sleep(2)
        (found,) = [e.event for e in cell.events if isinstance(e, OnBus) and isinstance(e.event, Conditioned)][
            -1
        ].conditions
        assert found.modes == "EM0 CK0" and found.pace is not None
