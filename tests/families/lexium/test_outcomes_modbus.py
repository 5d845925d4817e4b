"""How motions end over Modbus: the same rules by the registers."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from multidrop.base.errors import MotionFailed
from multidrop.contract.desk import Desk
from multidrop.drives.events import Conditioned, Traffic
from multidrop.shell.events import OnBus, SessionEvent
from multidrop.shell.session import Session
from tests.families.lexium import test_contract
from tests.shell.test_outcomes import ENCODER, failed, noted, sent, value
from tests.support.cell_session import drive
from tests.support.until import PATIENCE

pytestmark = pytest.mark.virtual

STALLS = "[bus.drive.world]\nstall_at = 20000"
LIMIT = "[bus.drive.world]\nlimit_plus = 30000"


@asynccontextmanager
async def on(folder: Path, *lines: str, personality: str = "LMDCE", **settings: int) -> AsyncIterator[Session]:
    """A session on the registers of a drive."""
    with pytest.MonkeyPatch.context() as patch:
        desk = Desk(test_contract.TestModbus.sample, folder, patch, drive(personality, "", *lines, **settings))
        async with desk.session() as opened:
            opened.session.events = opened.events  # type: ignore[attr-defined]
            yield opened.session


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
        watch = session.buses["line"].telemetry.watch([""], 0.1)
        async with asyncio.timeout(PATIENCE):
            while not causes:
                await asyncio.sleep(0.02)
            await session.run("MA 4000")
            while "stalled" not in causes:
                await asyncio.sleep(0.02)
        watch.close()


async def test_a_program_that_an_input_starts_may_end_a_slew(tmp_path: Path) -> None:
    program = "program_text = '''\nPG 1\nSL 0\nE\nPG\n'''"
    async with on(tmp_path, program, "[bus.drive.world]\ninputs = [[2.5, 2, 0]]") as session:
        await session.run("IS=2,4,0")
        await sent(session, "SL 5000", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777
