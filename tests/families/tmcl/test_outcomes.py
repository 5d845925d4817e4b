"""How motions end on a TMCL module: each wait succeeds or fails by how the motion ended."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.support.outcomes import asked, failed, module, sent

pytestmark = pytest.mark.virtual

ENDS = "[bus.drive.world]\nlimit_plus = 25600\nlimit_minus = -51200"
"""In microsteps."""


@pytest.mark.parametrize("personality", ["TMCM-1241", "TMCM-1140", "TMCM-3110"])
async def test_a_limit_switch_fails_the_wait(tmp_path: Path, personality: str) -> None:
    async with module(tmp_path, personality, ENDS) as session:
        failure = await failed(session, "MVP ABS, 0, 90000", "/wait stopped", "SGP 0, 2, 777")
        assert failure.outcome == "limit" and failure.reason == "right limit switch is on"
        assert failure.target == 90000 and failure.position == 25600
        assert await asked(session, "GGP 0, 2") == 0


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
        assert await asked(session, "GGP 0, 2") == 777


async def test_a_rotation_into_a_switch_is_a_failure(tmp_path: Path) -> None:
    async with module(tmp_path, "TMCM-1241", ENDS) as session:
        failure = await failed(session, "ROL 0, 30000", "/wait stopped", "SGP 0, 2, 777")
        assert (failure.outcome, failure.reason) == ("limit", "left limit switch is on")


async def test_a_switch_that_does_not_count_is_no_limit(tmp_path: Path) -> None:
    async with module(tmp_path, "TMCM-1241", ENDS) as session:
        await sent(session, "SAP 12, 0, 1", "MVP ABS, 0, 40000", "/wait stopped", "SGP 0, 2, 777")
        assert await asked(session, "GGP 0, 2") == 777


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
        assert await asked(session, "GAP 1, 0") == 9000 and await asked(session, "GAP 1, 2") < 4000
