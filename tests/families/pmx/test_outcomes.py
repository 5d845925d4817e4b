"""How motions end on a PMX controller: each wait succeeds or fails by how the motion ended."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.base.errors import MotionFailed
from multidrop.shell.events import Notified
from tests.support.outcomes import SWITCHES, asked, controller, failed, sent

pytestmark = pytest.mark.virtual

WALL = "[bus.drive.world.x]\nstall_at = 1500"


@pytest.mark.parametrize("wait", ["/wait stopped", "/wait idle", "/wait PX=9000", "/wait @01 PX=1"])
async def test_a_latched_limit_fails_every_wait_and_the_next_line_is_not_sent(tmp_path: Path, wait: str) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        failure = await failed(session, "ABS", "X9000", wait, "V1=777")
        assert (failure.outcome, failure.position, failure.target) == ("limit", 3000, 9000)
        assert str(failure) == "00 X stopped at 3000 of 9000: plus limit; CLRX clears the error"
        assert await asked(session, "V1") == 0


async def test_a_limit_without_a_latched_error_is_known_by_its_switch_and_the_target(tmp_path: Path) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        failure = await failed(session, "IERR=1", "X9000", "/wait stopped", "V1=777")
        assert (failure.outcome, failure.position) == ("limit", 3000) and "IERR=1" in failure.reason
        await sent(session, "X3000", "/wait stopped")  # at its target, with the switch on
        assert (await failed(session, "X0", "/wait stopped", "JX-", "/wait stopped")).outcome == "limit"
        await sent(session, "X0", "/wait stopped", "JX+", "/sleep 0.1", "STOPX", "/wait stopped", "V1=777")
        assert await asked(session, "V1") == 777


@pytest.mark.parametrize(
    "lines",
    [
        ("ABS", "X2000"),
        ("INC", "X700", "/wait stopped", "X700"),
        ("ABS", "X500Y900"),
        ("ABS", "I500:-900"),
        ("ABS", "X2500", "/sleep 0.2", "TX100"),
        ("JX+", "/sleep 0.2", "STOPX"),
        ("ABS", "X2900", "/sleep 0.2", "ABORT"),
        ("ABS", "X2900", "/sleep 0.2", "STOPX", "/wait stopped", "X0"),
        ("HX-",),
        ("HLX-",),
        ("LX+",),
    ],
)
async def test_what_ends_as_it_was_meant_is_no_failure(tmp_path: Path, lines: tuple[str, ...]) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        await sent(session, *lines, "/wait stopped 120", "V1=777")
        assert await asked(session, "V1") == 777


async def test_a_homing_without_its_switch_is_a_failure(tmp_path: Path) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        assert (await failed(session, "HX+", "/wait stopped", "V1=777")).outcome == "limit"
        await session.run("CLRX")
        await session.run("IERR=1")
        assert (await failed(session, "HLX+", "/wait stopped", "V1=777")).outcome == "limit"
        assert await asked(session, "V1") == 0


@pytest.mark.parametrize("line", ["X2900", "LX+", "HLX+"])
async def test_a_stop_by_another_host_is_a_failure(tmp_path: Path, line: str) -> None:
    async with controller(tmp_path, SWITCHES) as session:

        async def other() -> None:
            await asyncio.sleep(0.5)
            each = session.drive()
            await each.run(each.family.perform("STOPX"))  # past everything that the session records

        task = asyncio.get_running_loop().create_task(other())
        failure = await failed(session, "ABS", line, "/wait stopped", "V1=777")
        await task
        assert (failure.outcome, failure.reason) == ("stopped", "not by this script")


async def test_an_error_from_before_is_reported_and_no_failure(tmp_path: Path) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        with pytest.raises(MotionFailed):
            await sent(session, "ABS", "X9000", "/wait stopped")
        await sent(session, "/wait stopped", "V1=777")
        said = [each.text for each in session.events if isinstance(each, Notified)]  # type: ignore[attr-defined]
        assert any("X has an error from before: plus limit error; CLRX clears it" in each for each in said)
        await sent(session, "CLRX", "X0", "/wait stopped", "V1=778")
        assert await asked(session, "V1") == 778


async def test_step_n_loop_within_its_tolerance_is_there_and_a_stall_is_not(tmp_path: Path) -> None:
    async with controller(tmp_path, WALL) as session:
        await sent(session, "SLRX=1", "SLTX=10", "SLEX=200", "SLX=1", "ABS", "X1000", "/wait stopped", "V1=1")
        failure = await failed(session, "X4000", "/wait stopped", "V1=777")
        assert failure.outcome in ("stall", "error") and await asked(session, "V1") == 1


async def test_a_driver_that_was_switched_off_is_lost_power(tmp_path: Path) -> None:
    async with controller(tmp_path) as session:
        failure = await failed(session, "ABS", "X3000", "/sleep 0.2", "EO1=0", "/wait stopped", "V1=777")
        assert failure.outcome == "power" and await asked(session, "V1") == 0


async def test_a_position_that_was_set_leaves_no_target(tmp_path: Path) -> None:
    async with controller(tmp_path) as session:
        await sent(session, "ABS", "X300", "/sleep 2", "PX=7", "/wait stopped", "V1=777")
        assert await asked(session, "V1") == 777
