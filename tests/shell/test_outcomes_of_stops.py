"""Which stops are the script's own: of common moves, of values in registers, after a pause, in raw mode."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.shell.test_outcomes import on, ran, value
from tests.shell.test_outcomes_without_target import SLOW, other, typed
from tests.support.outcomes import asked, controller, failed, sent

pytestmark = pytest.mark.virtual


# Axes that move together (PMX manual 7.7: a stop of one axis stops all of an interpolated move)


@pytest.mark.parametrize("move", ["X2000Y1000", "I2000:1000"])
@pytest.mark.parametrize("stop", ["STOPX", "ABORTY", "STOPY", "ABORT"])
async def test_a_stop_of_one_axis_of_a_common_move_is_a_stop_of_both(tmp_path: Path, move: str, stop: str) -> None:
    async with controller(tmp_path) as session:
        await sent(session, "ABS", move, "/sleep 0.3", stop, "/wait stopped", "V1=777")
        assert await asked(session, "V1") == 777 and 0 < await asked(session, "PY") < 1000


async def test_a_stop_of_one_of_two_moves_is_no_stop_of_the_other(tmp_path: Path) -> None:
    async with controller(tmp_path) as session:
        task = asyncio.get_running_loop().create_task(other(session, "STOPY"))
        failure = await failed(session, "ABS", "X4000", "Y4000", "/sleep 0.1", "STOPX", "/wait stopped", "V1=777")
        await task
        assert str(failure).startswith("00 Y stopped at ") and failure.reason == "not by this script"


async def test_a_stop_of_one_axis_by_someone_else_fails_a_common_move(tmp_path: Path) -> None:
    async with controller(tmp_path) as session:
        task = asyncio.get_running_loop().create_task(other(session, "STOPX"))
        failure = await failed(session, "ABS", "I4000:4000", "/wait stopped", "V1=777")
        await task
        assert failure.reason == "not by this script" and await asked(session, "V1") == 0


# A velocity that is not written as a number


@pytest.mark.parametrize("before", [(), ("MA 90000", "/sleep 0.3"), ("SL 9000", "/sleep 0.3")])
@pytest.mark.parametrize("stop", ["SL R2", "SL=R2", "SL R2*2", "SL Q1"])
async def test_a_velocity_of_0_in_a_register_is_no_stop_by_someone_else(
    tmp_path: Path, before: tuple[str, ...], stop: str
) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, "VA Q1=0")
        await sent(session, "R2=0", *before, stop, "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777


# A pause of a program


@pytest.mark.parametrize(("pause", "outcome"), [((), "error"), (("PS", "/sleep 1", "RS"), "error")])
async def test_an_error_of_a_program_that_was_paused_and_goes_on_is_a_failure(
    tmp_path: Path, pause: tuple[str, ...], outcome: str
) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, "PG 1", "LB G1", "MR 20000", "H", "VM=1", "E", "PG")
        failure = await failed(session, "EX G1", "/sleep 0.3", *pause, "/wait idle", "R1=777")
        assert failure.outcome == outcome and failure.reason.startswith("error 21")
        assert await value(session, "R1") == 0


async def test_a_program_that_was_paused_is_at_rest_and_one_that_goes_on_ends_well(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, "PG 1", "LB G1", "MR 20000", "H", "E", "PG")
        await sent(session, "EX G1", "/sleep 0.3", "PS", "/wait stopped", "R2=5", "RS", "/wait idle", "R1=777")
        assert await value(session, "R1") == 777 and await value(session, "P") == 20000


# Raw mode


@pytest.mark.parametrize("raw", ["SL 0", "MA 100", "P=0"])
@pytest.mark.parametrize("line", ["SL 9000", "MA 900000"])
async def test_what_was_sent_in_raw_mode_may_have_ended_a_motion(tmp_path: Path, raw: str, line: str) -> None:
    """multidrop reads nothing of such a text."""
    async with on(tmp_path, **SLOW) as session:
        lines = ("/raw on", "/raw end lf", f"a{raw}", "/sleep 0.3", "/raw off")
        await ran(session, tmp_path, line, "/sleep 0.3", *lines, "SL 0", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777


async def test_a_stop_that_was_sent_in_raw_mode_is_no_stop_by_someone_else(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        lines = ("/raw on", "/raw end lf", "aSL 0", "/sleep 1", "/raw off")
        await ran(session, tmp_path, "SL 9000", "/sleep 0.3", *lines, "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777
