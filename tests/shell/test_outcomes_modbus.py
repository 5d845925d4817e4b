"""How motions end over Modbus: the same rules by the registers."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest

from multidrop.base.errors import MotionFailed
from multidrop.drives.events import Conditioned, Traffic
from multidrop.shell.configuration import Settings
from multidrop.shell.events import OnBus, SessionEvent
from multidrop.shell.session import Session
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from tests.shell.test_outcomes import ENCODER, failed, noted, sent, value
from tests.support.cell_session import bus, drive
from tests.support.until import PATIENCE

STALLS = "[bus.drive.world]\nstall_at = 20000"
LIMIT = "[bus.drive.world]\nlimit_plus = 30000"


@asynccontextmanager
async def on(folder: Path, *lines: str, personality: str = "LMDCE", **settings: int) -> AsyncIterator[Session]:
    """A session on a drive that is served in real time."""
    cell = bus("eth", drive(personality, "", *lines, **settings), serve=["modbus://127.0.0.1:0"])
    async with AsyncExitStack() as stack:
        floor = RunningFloor(Floor(read(cell, "cell")))
        stack.callback(floor.close)
        [served] = await serve_bus(floor, floor.floor.cell.buses[0], stack)
        session = Session(Settings({}, folder / "config", folder / "state"))
        stack.push_async_callback(session.close)
        session.questions.agreed, session.events = True, []  # type: ignore[attr-defined]
        session.subscribe(session.events.append)  # type: ignore[attr-defined]
        await session.open(served.endpoint, "eth")
        yield session


@asynccontextmanager
async def at_limit(folder: Path) -> AsyncIterator[Session]:
    async with on(folder, LIMIT) as session:
        await session.run("IS=1,2,0")
        yield session


async def test_a_stall_fails_the_wait_and_the_next_line_is_not_sent(tmp_path: Path) -> None:
    async with on(tmp_path, STALLS, **ENCODER) as session:
        failure = await failed(session, "MA 4000", "/wait stopped", "R1=777")
        assert (failure.reason, failure.outcome, failure.target) == ("stalled", "stall", 4000)
        assert await value(session, "R1") == 0
        assert not any("old error" in each or "refused" in each for each in noted(session))


@pytest.mark.slow
@pytest.mark.parametrize("wait", ["/wait stopped", "/wait idle", "/wait P=90000"])
async def test_a_limit_fails_every_wait(tmp_path: Path, wait: str) -> None:
    async with at_limit(tmp_path) as session:
        assert (await failed(session, "MA 90000", wait, "R1=777")).reason == "error 83: plus limit reached"
        assert await value(session, "R1") == 0


async def test_the_line_after_a_failed_motion_is_executed_and_not_called_refused(tmp_path: Path) -> None:
    """Without a wait the reply to the next write is the first that shows the error."""
    async with at_limit(tmp_path) as session:
        failure = await failed(session, "MA 90000", "/sleep 1.5", "R1=777", "R2=5")
        assert str(failure).endswith("of 90000: error 83: plus limit reached; 'R1=777' was executed")
        assert (await value(session, "R1"), await value(session, "R2")) == (777, 0)
        assert not any("refused" in each for each in noted(session))


async def test_a_move_through_raw_registers_is_judged_too(tmp_path: Path) -> None:
    async with at_limit(tmp_path) as session:
        with pytest.raises(MotionFailed):
            await sent(session, "/register 0x43 =90000", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 0


@pytest.mark.slow
@pytest.mark.parametrize("personality", ["LMDCE", "LMDOE"])
async def test_moves_that_end_well_do_not_fail(tmp_path: Path, personality: str) -> None:
    async with on(tmp_path, personality=personality) as session:
        await sent(session, "MA 4000", "/wait stopped", "MR 500", "/wait idle", "SL 5000", "/sleep 0.3", "SL 0")
        await sent(session, "/wait stopped", "MA 9", "/wait P=9")
        assert await value(session, "P") == 9


async def test_a_device_that_is_no_lexium_is_asked_for_nothing_more(tmp_path: Path) -> None:
    async with on(tmp_path) as session:
        session.drive().state.identified("PLC-7", "")
        count: list[object] = []
        session.subscribe(count.append, Traffic)
        await sent(session, "MA 400")
        asked = [each for each in count if isinstance(each, OnBus) and each.event.outgoing]  # type: ignore[union-attr]
        assert len(asked) == 2  # the write, and its check of EF


async def test_a_stall_that_nobody_waits_for_is_among_the_conditions(tmp_path: Path) -> None:
    async with on(tmp_path, STALLS, EE=1) as session:
        causes: list[str] = []

        def take(event: SessionEvent) -> None:
            if isinstance(event, OnBus) and isinstance(event.event, Conditioned):
                causes.extend(each.cause for each in event.event.conditions)

        session.subscribe(take, Conditioned)
        watch = session.buses["eth"].telemetry.watch([""], 0.1)
        async with asyncio.timeout(PATIENCE):
            while not causes:
                await asyncio.sleep(0.02)
            await session.run("MA 4000")
            while "stalled" not in causes:
                await asyncio.sleep(0.02)
        watch.close()


@pytest.mark.slow
async def test_a_program_that_an_input_starts_may_end_a_slew(tmp_path: Path) -> None:
    program = "program_text = '''\nPG 1\nSL 0\nE\nPG\n'''"
    async with on(tmp_path, program, "[bus.drive.world]\ninputs = [[2.5, 2, 0]]") as session:
        await session.run("IS=2,4,0")
        await sent(session, "SL 5000", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777
