"""Single step under attack: noise, stops, other work on the line. The simulated drive counts the keys that it takes."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest

from multidrop.base.errors import DriveError, Inexpressible, NoAnswer, Refused, Stopped
from multidrop.drives.stopping import Fate
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.debugging import MCodeDebugging
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.shell.events import FAILURES, By
from multidrop.simulator.cell.spec import Faults
from tests.support.automated import automated
from tests.support.cell_session import CellSession, bus
from tests.support.debugged import cell, ethernet, keys, out, run, serial

pytestmark = pytest.mark.virtual


class Taken:
    """The keys that a simulated drive took, and the lines of its program that it has executed."""

    def __init__(self, device: Any) -> None:
        self.keys: list[str] = []
        self._device, step = device, device.step

        def seen(key: str, now: float) -> None:
            self.keys.append(key)
            step(key, now)

        device.step = seen

    @property
    def executed(self) -> int:
        return int(self._device.thread.executed)


async def test_nothing_but_step_and_continue_presses_a_key(tmp_path: Path) -> None:
    it = CellSession(tmp_path, bus("line", ethernet(), baud=0), reconnect=True)
    async with it:
        await run(it, "/step G1")
        taken = Taken(it.device("line:!"))
        telemetry = it.session.bus().telemetry
        polling = telemetry.subscribe([""], 0.05)
        for line in ("PR P", "VM=500000", "Q1=1", "/status", "/list", "/drives", "/watch P Q1", "/break K1", "PR AL"):
            try:
                await run(it, line)
            except DriveError:
                continue
        await asyncio.sleep(2)
        polling.close()
        it.world("unplug line")
        await asyncio.sleep(0.5)
        it.world("plug line")
        await asyncio.sleep(5)
        assert taken.keys == [] and it.device("line:!").thread.stepping and taken.executed == 0


@pytest.mark.slow
@pytest.mark.wide
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("em", [0, 1, 2, 3])
async def test_noise_never_steps_twice(tmp_path: Path, em: int, seed: int) -> None:
    """A step that shows a line has executed it; one that is not known has executed one line or none, any other none."""
    async with CellSession(tmp_path, bus("line", ethernet(EM=em))) as it:
        taken = Taken(it.device("line:!"))
        wire = next(iter(it.session.cells.values())).floor.wires["line"]
        wire.disturb(Faults(flip=2e-3, drop=2e-3), Random(seed))
        for _ in range(16):
            told: Exception | None = None
            it.events.clear()
            before, pressed = taken.executed, len(taken.keys)
            try:
                await run(it, "/step")
                outcomes = {1}
            except NoAnswer:
                outcomes = {0, 1}  # or a value after the line could not be read
            except FAILURES as failure:
                told, outcomes = (
                    failure,
                    {sum(MCodeDebugging(MCodeState(MCode())).traced(line) is not None for line in out(it))},
                )
            assert taken.executed - before in outcomes, told
            assert len(taken.keys) - pressed <= 1 and "\r" not in taken.keys[pressed:]
            if outcomes != {1}:
                await _again(it)


async def _again(it: CellSession) -> None:
    """End the program and begin again, whatever the noise does."""
    for line in ("E", "/step K3"):
        try:
            await run(it, line)
        except FAILURES:
            continue


async def test_a_stop_while_a_key_is_in_flight_leaves_the_step_unknown(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", ethernet(EM=1), baud=1200)) as it:
        await run(it, "/step G1", "/step")
        it.events.clear()
        step = asyncio.ensure_future(it.session.run("/step"))
        while not keys(it):
            await asyncio.sleep(0.005)
        it.session.stop()
        with pytest.raises(Stopped):
            await step
        await asyncio.sleep(10)
        assert keys(it) == 1 and not it.moving() and not it.device("line:!").running
        with pytest.raises(Refused, match="none was sent|no key was sent"):
            await it.session.run("/step")


async def test_after_a_stop_a_refused_step_does_not_count_as_started(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", ethernet(), baud=0)) as it:
        await run(it, "/step G1", "/step", "/step")
        it.session.stop()
        await asyncio.sleep(2)
        with pytest.raises(Refused):
            await it.session.run("/step")
        assert [each.fate for each in it.session.tally().found] == [Fate.STANDING]


async def test_a_script_that_ends_early_stops_the_drive_that_it_stepped(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", serial("!", party=False), baud=0)) as it:
        session = it.session
        with pytest.raises(Refused):
            async with automated(session):
                for line in ("/step K2", "/step", "/step", "/step"):
                    await session.run(line, replace(session.origin, by=By.SCRIPT))
        await asyncio.sleep(1)
        assert not it.moving() and not it.device("line:!").running
        assert any(text.startswith("stopped line") for text in it.told())


async def test_a_script_that_only_tried_to_step_stops_nothing(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", ethernet(), baud=0)) as it:
        await run(it, "SL 20000")
        with pytest.raises(Refused):
            async with automated(it.session):
                await it.session.run("/step", replace(it.session.origin, by=By.SCRIPT))
        await asyncio.sleep(1)
        assert it.moving() == {"line:!"}


async def test_a_latched_session_steps_for_a_person_only(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", ethernet(), baud=0)) as it:
        it.session.stop()
        await asyncio.sleep(2)
        with pytest.raises(Stopped):
            await it.session.run("/step G1", replace(it.session.origin, by=By.SCRIPT))
        await run(it, "/step G1", "/step")
        assert it.device("line:!").thread.stepping


async def test_a_program_that_begins_by_itself_after_a_stop_is_sent_no_key(tmp_path: Path) -> None:
    """A trip, an input or another host starts it: BY=1, and nothing waits for a key."""
    async with CellSession(tmp_path, bus("line", ethernet(), baud=0)) as it:
        await run(it, "/step G1", "/step")
        it.session.stop()
        await asyncio.sleep(2)
        device = it.device("line:!")
        device.execute("EX K3", device.now)
        it.events.clear()
        with pytest.raises(Refused, match="it is not known that it waits for a key"):
            await it.session.run("/step")
        assert keys(it) == 0 and device.running


async def test_a_drive_that_went_into_party_mode_is_sent_no_key(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", serial("!", party=False), baud=0)) as it:
        await run(it, "/step G1", "/step", "CK=1")
        taken = Taken(it.device("line:!"))
        for line in ("/step", "/continue"):
            with pytest.raises((Refused, Inexpressible)):
                await it.session.run(line)
        assert taken.keys == []


@pytest.mark.slow
async def test_a_bus_that_is_closed_ends_its_trace(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", ethernet(), baud=0)) as it:
        trace = asyncio.ensure_future(it.session.run("/trace K3"))
        await asyncio.sleep(1)
        await it.session.run("/close line")
        with pytest.raises(FAILURES):
            await trace
        assert not any(each.annotators or each.debuggers for each in map(it.session.of, it.session.buses.values()))


async def test_a_macro_records_the_drive_and_plays_the_steps(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("line", ethernet(), baud=0), bus("other", ethernet(), baud=0)) as it:
        await run(it, "/use line:", "/record walk", "/step G1", "/step", "/record stop")
        macro = it.session.macros.load("walk")
        assert [each.line for each in macro.steps] == ["/step line: G1", "/step line:"]


async def test_a_lost_line_ends_the_proof_and_the_break_point_is_named(tmp_path: Path) -> None:
    it = CellSession(tmp_path, bus("line", ethernet(), baud=0), reconnect=True)
    async with it:
        await run(it, "/break K1", "/trace", "/step")
        it.events.clear()
        it.world("unplug line")
        await asyncio.sleep(0.5)
        assert any("may go on waiting for /step or /continue" in text for text in it.told())
        assert any("the break point at K1 stays in the drive" in text for text in it.told())
        it.world("plug line")
        await asyncio.sleep(5)
        it.events.clear()
        with pytest.raises(Refused, match="it is not known that it waits for a key"):
            await it.session.run("/step")
        assert keys(it) == 0
        await run(it, "/break now")
        assert (await run(it, "/sleep 1", "/step"))[0].startswith("26  H")


async def test_a_restart_ends_the_proof(tmp_path: Path) -> None:
    async with cell(tmp_path, serial("!", party=False)) as it:
        await run(it, "/step G1", "/step")
        it.world("power ! off")
        it.world("power ! on")
        await asyncio.sleep(1)
        await run(it, "EX K3")
        it.events.clear()
        with pytest.raises(Refused, match="it is not known that it waits for a key"):
            await it.session.run("/step")
        assert keys(it) == 0


async def test_raw_bytes_end_the_proof(it: CellSession) -> None:
    await run(it, "/step K3", "/raw on", " ", "/raw off")
    with pytest.raises(Refused, match="it is not known that it waits for a key"):
        await it.session.run("/step")


async def test_a_lost_line_after_a_key_is_not_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with cell(tmp_path, ethernet(EM=1), baud=9600) as it:
        await run(it, "/step G1", "/step")
        device: Any = it.device("line:!")
        step = device.step

        def swallowed(key: str, now: float) -> None:
            step(key, now)
            device.advance(now)
            device.prints()

        monkeypatch.setattr(device, "step", swallowed)
        it.events.clear()
        with pytest.raises(NoAnswer, match="it is not known whether it stepped; the key was sent once"):
            await it.session.run("/step")
        with pytest.raises(Refused, match="it is not known that it waits for a key"):
            await it.session.run("/step")
        assert keys(it) == 1 and device.position(device.now) == 51200
