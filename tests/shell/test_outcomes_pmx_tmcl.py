"""How motions end on controllers (PMX) and modules (TMCL): each wait succeeds or fails by how the motion ended."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from multidrop.base.errors import MotionFailed
from multidrop.shell.events import Notified
from multidrop.shell.session import Session
from tests.support.cell_session import bus, drive, pmx, session_on
from tests.support.outcomes import failed, sent

pytestmark = pytest.mark.virtual

SWITCHES = "[bus.drive.world.x]\nlimit_plus = 3000\nlimit_minus = -3000\nhome = [-1100, -1000]"
WALL = "[bus.drive.world.x]\nstall_at = 1500"
ENDS = "[bus.drive.world]\nlimit_plus = 25600\nlimit_minus = -51200"
"""In microsteps."""


@asynccontextmanager
async def controller(folder: Path, *world: str) -> AsyncIterator[Session]:
    async with session_on(folder, bus("stage", pmx("00", *world), pmx("01"), baud=0)) as session:
        for line in ("HSPD=2000", "ACC=50"):
            await session.run(f"@00 {line}")
        await session.run("/use 00")
        yield session


@asynccontextmanager
async def module(folder: Path, personality: str = "TMCM-1241", *world: str) -> AsyncIterator[Session]:
    async with session_on(folder, bus("line", drive(personality, "1", *world), baud=0)) as session:
        yield session


async def value(session: Session, text: str) -> int:
    (printed,) = await session.drive().send(text)
    return int(printed)


# A controller


@pytest.mark.parametrize("wait", ["/wait stopped", "/wait idle", "/wait PX=9000", "/wait @01 PX=1"])
async def test_a_latched_limit_fails_every_wait_and_the_next_line_is_not_sent(tmp_path: Path, wait: str) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        failure = await failed(session, "ABS", "X9000", wait, "V1=777")
        assert (failure.outcome, failure.position, failure.target) == ("limit", 3000, 9000)
        assert str(failure) == "00 X stopped at 3000 of 9000: plus limit; CLRX clears the error"
        assert await value(session, "V1") == 0


async def test_a_limit_without_a_latched_error_is_known_by_its_switch_and_the_target(tmp_path: Path) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        failure = await failed(session, "IERR=1", "X9000", "/wait stopped", "V1=777")
        assert (failure.outcome, failure.position) == ("limit", 3000) and "IERR=1" in failure.reason
        await sent(session, "X3000", "/wait stopped")  # at its target, with the switch on
        assert (await failed(session, "X0", "/wait stopped", "JX-", "/wait stopped")).outcome == "limit"
        await sent(session, "X0", "/wait stopped", "JX+", "/sleep 0.1", "STOPX", "/wait stopped", "V1=777")
        assert await value(session, "V1") == 777


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
        assert await value(session, "V1") == 777


async def test_a_homing_without_its_switch_is_a_failure(tmp_path: Path) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        assert (await failed(session, "HX+", "/wait stopped", "V1=777")).outcome == "limit"
        await session.run("CLRX")
        await session.run("IERR=1")
        assert (await failed(session, "HLX+", "/wait stopped", "V1=777")).outcome == "limit"
        assert await value(session, "V1") == 0


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
        assert await value(session, "V1") == 778


async def test_step_n_loop_within_its_tolerance_is_there_and_a_stall_is_not(tmp_path: Path) -> None:
    async with controller(tmp_path, WALL) as session:
        await sent(session, "SLRX=1", "SLTX=10", "SLEX=200", "SLX=1", "ABS", "X1000", "/wait stopped", "V1=1")
        failure = await failed(session, "X4000", "/wait stopped", "V1=777")
        assert failure.outcome in ("stall", "error") and await value(session, "V1") == 1


async def test_a_driver_that_was_switched_off_is_lost_power(tmp_path: Path) -> None:
    async with controller(tmp_path) as session:
        failure = await failed(session, "ABS", "X3000", "/sleep 0.2", "EO1=0", "/wait stopped", "V1=777")
        assert failure.outcome == "power" and await value(session, "V1") == 0


async def test_a_position_that_was_set_leaves_no_target(tmp_path: Path) -> None:
    async with controller(tmp_path) as session:
        await sent(session, "ABS", "X300", "/sleep 2", "PX=7", "/wait stopped", "V1=777")
        assert await value(session, "V1") == 777


# A module


@pytest.mark.parametrize("personality", ["TMCM-1241", "TMCM-1140", "TMCM-3110"])
async def test_a_limit_switch_fails_the_wait(tmp_path: Path, personality: str) -> None:
    async with module(tmp_path, personality, ENDS) as session:
        failure = await failed(session, "MVP ABS, 0, 90000", "/wait stopped", "SGP 0, 2, 777")
        assert failure.outcome == "limit" and failure.reason == "right limit switch is on"
        assert failure.target == 90000 and failure.position == 25600
        assert await value(session, "GGP 0, 2") == 0


@pytest.mark.parametrize(
    "lines",
    [
        ("MVP ABS, 0, 20000",),
        ("MVP REL, 0, 9000", "/wait stopped", "MVP REL, 0, -12000"),
        ("SAP 0, 0, 20000",),
        ("ROR 0, 20000", "/sleep 0.2", "MST 0"),
        ("ROR 0, 20000", "/sleep 0.2", "ROL 0, 0"),
        ("MVP ABS, 0, 24000", "/sleep 0.1", "MST 0"),
        ("MVP ABS, 0, 24000", "/sleep 0.1", "MVP ABS, 0, 100"),
        ("SAP 193, 0, 1", "SAP 194, 0, 20000", "SAP 195, 0, 2000", "RFS START, 0"),
        ("SAP 193, 0, 2", "SAP 194, 0, 20000", "SAP 195, 0, 2000", "RFS START, 0"),
    ],
)
async def test_what_a_module_ends_as_it_was_meant_is_no_failure(tmp_path: Path, lines: tuple[str, ...]) -> None:
    async with module(tmp_path, "TMCM-1241", ENDS) as session:
        await sent(session, *lines, "/wait stopped 120", "SGP 0, 2, 777")
        assert await value(session, "GGP 0, 2") == 777


async def test_a_rotation_into_a_switch_is_a_failure(tmp_path: Path) -> None:
    async with module(tmp_path, "TMCM-1241", ENDS) as session:
        failure = await failed(session, "ROL 0, 30000", "/wait stopped", "SGP 0, 2, 777")
        assert (failure.outcome, failure.reason) == ("limit", "left limit switch is on")


async def test_a_switch_that_does_not_count_is_no_limit(tmp_path: Path) -> None:
    async with module(tmp_path, "TMCM-1241", ENDS) as session:
        await sent(session, "SAP 12, 0, 1", "MVP ABS, 0, 40000", "/wait stopped", "SGP 0, 2, 777")
        assert await value(session, "GGP 0, 2") == 777


@pytest.mark.parametrize("line", ["MVP ABS, 0, 90000", "MVP REL, 0, 90000", "RFS START, 0"])
async def test_a_stop_by_another_master_is_a_failure(tmp_path: Path, line: str) -> None:
    async with module(tmp_path) as session:

        async def other() -> None:
            await asyncio.sleep(0.5)
            each = session.drive()
            await each.run(each.family.perform("MST 0"))

        task = asyncio.get_running_loop().create_task(other())
        failure = await failed(session, "SAP 194, 0, 500", "SAP 4, 0, 20000", line, "/wait stopped", "SGP 0, 2, 777")
        await task
        assert failure.outcome == "stopped"
        assert failure.reason == ("home was not found" if "RFS" in line else "not by this script")
        assert failure.target == (None if "RFS" in line else 90000)


async def test_each_motor_of_a_module_has_its_own_motion(tmp_path: Path) -> None:
    async with module(tmp_path, "TMCM-3110") as session:
        await session.run("/wait stopped")  # counts the motors
        await sent(
            session, "MVP ABS, 0, 9000", "MVP ABS, 2, 4000", "/sleep 0.1", "MST 2", "/wait stopped", "SGP 0, 2, 7"
        )
        assert await value(session, "GAP 1, 0") == 9000 and await value(session, "GAP 1, 2") < 4000
