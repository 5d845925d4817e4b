"""How motions end that no line gives a target: torque mode, jog, trips, programs, joysticks; hMT, and restarts."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.dialects.motions import MoveKind
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.tmcl.host.codec import Tmcl, TmclState
from multidrop.families.tmcl.host.motions import TmclMotions
from multidrop.shell.session import Session
from tests.shell.test_outcomes import at_limit, noted, on, ran, value
from tests.support.cell_session import bus, drive, session_on
from tests.support.outcomes import SWITCHES, asked, controller, failed, module, sent

pytestmark = pytest.mark.virtual

SLOW = {"VM": 20000, "A": 100000, "D": 100000}


async def typed(session: Session, *lines: str) -> None:
    for line in lines:
        await session.run(line)


# Motion that a setting begins


@pytest.mark.parametrize("pause", ["/sleep 0", "/sleep 30"])
async def test_torque_mode_is_a_motion_of_its_line(tmp_path: Path, pause: str) -> None:
    async with at_limit(tmp_path) as session:
        session.questions.agreed = True
        failure = await failed(session, "TQ=50", "TS=2000000", "AS=3", pause, "/wait stopped", "R1=777")
        assert failure.outcome == "limit" and failure.target is None and await value(session, "R1") == 0


async def test_torque_mode_that_the_same_script_ends_is_no_failure(tmp_path: Path) -> None:
    async with on(tmp_path) as session:
        session.questions.agreed = True
        await sent(session, "TQ=50", "TS=2000000", "AS=3", "/sleep 0.5", "SL 0", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777


async def test_a_jog_into_a_limit_fails_the_script_that_enabled_jogs(tmp_path: Path) -> None:
    async with at_limit(tmp_path, **SLOW) as session:
        lines = ("IS=2,7,0", "JE=1", "/sim input a 2 0", "/sleep 9", "/wait stopped", "R1=777")
        assert (await failed(session, *lines)).outcome == "limit"
        assert await value(session, "R1") == 0


async def test_a_joystick_at_a_limit_fails_the_script_that_enabled_it(tmp_path: Path) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        failure = await failed(session, "JO", "/sleep 2", "/wait stopped", "V1=777")
        assert failure.outcome == "limit" and await asked(session, "V1") == 0


def test_a_move_of_several_motors_is_one_motion_of_each() -> None:
    state = TmclState(Tmcl(), "1", motors=3)
    moves = TmclMotions(state).effect("MVP COORD, 133, 2").begins
    assert [(each.axis, each.kind) for each in moves] == [("0", MoveKind.POSITION), ("2", MoveKind.POSITION)]
    assert [each.axis for each in TmclMotions(state).effect("MVP COORD, 1, 2").begins] == ["1"]


# Motion that the drive ends by itself


TRIP = ("PG 1", "LB T1", "SL 0", "RT", "E", "PG", "TP=5000,T1")


async def test_a_trip_that_ends_a_move_is_no_failure(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, *TRIP)
        await sent(session, "TE=2", "MA 20000", "/wait stopped", "R1=777")
        assert 5000 <= await value(session, "P") < 20000 and await value(session, "TE") == 0
        await sent(session, "MA 0", "/wait stopped", "MA 20000", "TE=2", "/wait stopped", "R1=778")
        assert 5000 <= await value(session, "P") < 20000 and await value(session, "R1") == 778


async def test_a_stop_of_someone_else_is_a_failure_where_no_trip_is_armed(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, *TRIP, "MA 3000", "/wait stopped")
        await sent(session, "MA 0", "/wait stopped")
        await typed(session, "TE=2", "TE=0")
        await sent(session, "MA 20000", "/wait stopped")


PROGRAM = ("PG 1", "LB G1", "H 300", "SL 0", "E", "PG")


@pytest.mark.parametrize("before", ["script", "person"])
async def test_a_program_that_ran_before_a_move_may_end_it(tmp_path: Path, before: str) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, *PROGRAM)
        if before == "person":
            await session.run("EX G1")
        own = ["EX G1"] if before == "script" else []
        await sent(session, *own, "MA 20000", "/wait stopped", "R1=777")
        assert await value(session, "P") < 20000 and await value(session, "R1") == 777


async def test_a_program_of_a_controller_that_ran_before_a_move_may_end_it(tmp_path: Path) -> None:
    from multidrop.families.pmx.manual import program_file

    text = "PRG 0\nDELAY=300\nSTOPX\nEND"
    async with controller(tmp_path, SWITCHES) as session:
        await session.drive().download(program_file.read(text, "a.prg"))
        await typed(session, "ABS", "SR0=1")
        await sent(session, "X2500", "/wait stopped", "V1=777")
        assert await asked(session, "PX") < 2500 and await asked(session, "V1") == 777


# hMT


@pytest.mark.parametrize("mode", [1, 2])
async def test_a_rotor_that_does_not_follow_the_steps_has_not_arrived(tmp_path: Path, mode: int) -> None:
    """P counts steps with hMT: it is at the target while the rotor is far away (LL)."""
    world = "[bus.drive.world]\nlocked = [[0.5, 1000]]"
    async with on(tmp_path, world, **SLOW, AS=mode) as session:
        failure = await failed(session, "MA 40000", "/wait stopped", "R1=777")
        assert (failure.outcome, failure.reason) == ("stall", "error 104: locked rotor")
        assert await value(session, "R1") == 0


@pytest.mark.parametrize("mode", [1, 2])
async def test_a_rotor_that_makes_up_its_lag_has_arrived_then(tmp_path: Path, mode: int) -> None:
    async with on(tmp_path, "[bus.drive.world]\nlocked = [[0.5, 2.2]]", **SLOW, AS=mode, LT=60000) as session:
        await sent(session, "MA 40000", "/wait stopped", "R1=777")
        assert abs(await value(session, "LL")) < 512 and await value(session, "R1") == 777


async def test_a_lag_limit_is_a_failure(tmp_path: Path) -> None:
    world = "[bus.drive.world]\nlocked = [[0.5, 1000]]"
    async with on(tmp_path, world, **SLOW, AS=1, LG=5000, LT=60000) as session:
        failure = await failed(session, "MA 40000", "/wait stopped", "R1=777")
        assert failure.outcome == "error" and failure.reason.startswith("error 107")


async def test_a_lead_limit_is_a_failure(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW, AS=1, LD=5000) as session:
        lines = ("MA 40000", "/sleep 0.5", "/sim push a 9000", "/wait stopped", "R1=777")
        failure = await failed(session, *lines)
        assert failure.outcome == "error" and failure.reason.startswith("error 106: lead limit reached")
        assert await value(session, "R1") == 0


@pytest.mark.parametrize(("makes_up", "fails"), [(0, False), (1, True), (2, True)])
async def test_a_lag_that_is_left_at_the_end_of_a_timed_move_is_a_failure(
    tmp_path: Path, makes_up: int, fails: bool
) -> None:
    """With MU=0 the drive makes it up after the move, and there is no error."""
    world = "[bus.drive.world]\nlocked = [[0.5, 6.0]]"
    async with on(tmp_path, world, **SLOW, AS=1, LG=2000000, LT=60000) as session:
        lines = (f"MU={makes_up}", "MA 20000", "/wait stopped", "R1=777")
        if fails:
            failure = await failed(session, *lines)
            assert failure.outcome == "error" and failure.reason.startswith("error 108")
        else:
            await sent(session, *lines)
            assert abs(await value(session, "LL")) < 512
        assert await value(session, "R1") == (0 if fails else 777)


@pytest.mark.parametrize("lines", [("MA 20000", "/sleep 3"), ("SL 5000", "/sleep 3", "SL 0")])
async def test_the_greatest_lead_or_lag_is_a_failure(tmp_path: Path, lines: tuple[str, ...]) -> None:
    """The simulated drive never reaches it (error 105), so it is set from outside."""
    async with on(tmp_path, **SLOW, AS=1) as session:
        device = next(iter(session.cells.values())).floor.drives[0].device
        assert isinstance(device, MCodeDevice)
        asyncio.get_running_loop().call_later(0.5, device.errors.set, 105)
        failure = await failed(session, *lines, "/wait stopped", "R1=777")
        assert failure.outcome == "error" and failure.reason.startswith("error 105")
        assert await value(session, "R1") == 0


# A clock that the drive follows


@pytest.mark.parametrize(("limit", "fails"), [(4, True), (90, False)])
async def test_a_limit_is_a_failure_while_the_drive_follows_a_clock(tmp_path: Path, limit: int, fails: bool) -> None:
    pulses = [each for n in range(20) for each in ([2 + n / 10, 3, 0], [2.05 + n / 10, 3, 1])]
    world = f"[bus.drive.world]\nlimit_plus = {limit}\ninputs = {[[0.0, 4, 0], *pulses]}"
    async with on(tmp_path, world) as session:
        await typed(session, "IS=3,13,0", "IS=2,2,0")
        lines = ("FL=1", "/sleep 6", "/wait stopped", "R1=777")
        if fails:
            assert (await failed(session, *lines)).reason == "error 83: plus limit reached"
        else:
            await sent(session, *lines)
        assert await value(session, "P") == (4 if fails else 20)
        assert await value(session, "R1") == (0 if fails else 777)


async def test_torque_mode_with_a_locked_rotor_is_a_stall(tmp_path: Path) -> None:
    async with on(tmp_path, "[bus.drive.world]\nlocked = [[0.5, 1000]]") as session:
        session.questions.agreed = True
        failure = await failed(session, "TQ=50", "TS=2000000", "AS=3", "/sleep 5", "/wait stopped", "R1=777")
        assert failure.outcome == "stall" and await value(session, "R1") == 0


# The deadband of the encoder


@pytest.mark.parametrize(("deadband", "arrives"), [(100, True), (50, False)])
async def test_a_move_ends_within_the_deadband(tmp_path: Path, deadband: int, arrives: bool) -> None:
    """The wall is 91 counts short of the target, and SF keeps the drive from calling that a stall."""
    settings = {**SLOW, "VM": 8000, "EE": 1, "SM": 1, "SF": 2000, "DB": deadband}
    async with on(tmp_path, "[bus.drive.world]\nstall_at = 50040", **settings) as session:
        lines = ("MA 4000", "/wait stopped", "R1=777")
        if arrives:
            await sent(session, *lines)
        else:
            assert (await failed(session, *lines)).outcome == "error"
        assert await value(session, "R1") == (777 if arrives else 0)


# Restarts


CYCLE = ("/sleep 0.3", "/sim power a off", "/sleep 0.1", "/sim power a on", "/sleep 3")


@pytest.mark.parametrize("line", ["SL 3000", "HM 1", "MR 40000", "EX G1"])
async def test_a_motion_that_a_restart_ended_is_a_failure(tmp_path: Path, line: str) -> None:
    cell = bus("press", drive("LMDCM", "a", CK=0, **SLOW), baud=0)
    async with session_on(tmp_path, cell) as session:
        await typed(session, "IS=3,1,0", "PG 1", "LB G1", "MA 90000", "H", "E", "PG", "S", "/sleep 1")
        failure = await failed(session, line, *CYCLE, "/wait stopped", "R1=777")
        assert (failure.outcome, failure.reason) == ("power", "it was restarted")
        assert await value(session, "R1") == 0
        await sent(session, "SL 3000", "/sleep 0.2", "SL 0", "/wait stopped", "R1=778")
        assert await value(session, "R1") == 778


async def test_a_restart_ends_the_script_at_its_next_line_and_is_an_outcome(tmp_path: Path) -> None:
    cell = bus("press", drive("LMDCM", "a", CK=0, **SLOW), baud=0)
    async with session_on(tmp_path, cell) as session:
        await typed(session, "S", "/sleep 1")
        failure = await failed(session, "SL 3000", *CYCLE, "R1=777")
        assert str(failure).endswith("stopped: it was restarted; 'R1=777' was not sent")
        assert await ran(session, tmp_path, "SL 3000", *CYCLE, "/wait ended", "/print {outcome}") == ["power"]


async def test_a_wait_for_what_someone_else_moved_fails_by_a_restart_too(tmp_path: Path) -> None:
    cell = bus("press", drive("LMDCM", "a", CK=0, **SLOW), baud=0)
    async with session_on(tmp_path, cell) as session:
        await typed(session, "MR 3000", "/sleep 0.1")
        asyncio.get_running_loop().call_later(0.2, session.drive().motions.restarted)
        failure = await failed(session, "/wait stopped", "R1=777")
        assert (failure.outcome, failure.reason) == ("power", "it was restarted")
        assert await value(session, "R1") == 0


# Lines that clear a sign


@pytest.mark.parametrize("line", ["ER=0", "CF", "ST=0"])
async def test_a_line_that_clears_a_sign_is_not_sent_after_a_failed_motion(tmp_path: Path, line: str) -> None:
    async with at_limit(tmp_path, **SLOW) as session:
        failure = await failed(session, "SL 30000", "/sleep 9", line, "/wait stopped", "R1=777")
        assert failure.outcome == "limit" and str(failure).endswith(f"'{line}' was not sent")
        await typed(session, "SL -30000", "/sleep 1", line)
        assert not any("was not sent" in each for each in noted(session)[-2:])


async def test_an_error_of_a_controller_is_not_cleared_after_a_failed_motion(tmp_path: Path) -> None:
    async with controller(tmp_path, SWITCHES) as session:
        failure = await failed(session, "JX+", "/sleep 5", "CLRX", "/wait stopped", "V1=777")
        assert failure.outcome == "limit" and str(failure).endswith("'CLRX' was not sent")
        await sent(session, "CLRX", "ABS", "X0", "/wait stopped", "V1=778")
        assert await asked(session, "V1") == 778


# What is said of an end


async def test_bridges_that_are_switched_off_on_the_way_are_the_reason(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        failure = await failed(session, "MA 25000", "/sleep 0.2", "DE=0", "/wait stopped", "R1=777")
        assert (failure.outcome, failure.reason) == ("power", "its output bridges are off (DE=0)")
        await typed(session, "DE=1")
        await sent(session, "MA 0", "/wait stopped", "DE=0", "/wait stopped", "R1=778")
        assert await value(session, "R1") == 778


async def test_an_error_of_the_program_that_was_started_is_not_called_old(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, "PG 1", "LB G1", "MR 500", "H", "VM=1", "E", "PG")
        failure = await failed(session, "EX G1", "/wait idle", "R1=777")
        assert failure.reason.startswith("error 21")
        assert not any("old error" in each for each in noted(session))


# Motion that only a command or a fault ends


async def other(session: Session, line: str) -> None:
    """Send a line past everything that the session records, as another host does."""
    await asyncio.sleep(0.3)
    each = session.drive()
    await each.run(each.family.perform(line))


@pytest.mark.parametrize(("line", "stop"), [("SL 5000", "SL 0"), ("SL -5000", "MA 0")])
async def test_a_slew_that_someone_else_ended_is_a_failure(tmp_path: Path, line: str, stop: str) -> None:
    async with on(tmp_path, **SLOW) as session:
        task = asyncio.get_running_loop().create_task(other(session, stop))
        failure = await failed(session, line, "/wait stopped", "R1=777")
        await task
        assert (failure.outcome, failure.reason) == ("stopped", "not by this script")
        await sent(session, line, "/sleep 0.2", "MA 100", "/wait stopped", line, "/sleep 0.2", "SL 0", "/wait stopped")


async def test_a_jog_of_a_controller_that_someone_else_ended_is_a_failure(tmp_path: Path) -> None:
    async with controller(tmp_path) as session:
        task = asyncio.get_running_loop().create_task(other(session, "STOPX"))
        assert (await failed(session, "JX+", "/wait stopped", "V1=777")).outcome == "stopped"
        await task
        await sent(session, "JX+", "/sleep 0.2", "STOPX", "/wait stopped", "J-", "/sleep 0.2", "STOP", "/wait stopped")


async def test_a_rotation_that_stalled_or_that_someone_else_ended_is_a_failure(tmp_path: Path) -> None:
    async with module(tmp_path, "TMCM-1241", "[bus.drive.world]\nstall_at = 10000") as session:
        lines = ("SAP 181, 0, 100", "ROR 0, 500", "/wait stopped", "SGP 0, 2, 777")
        assert (await failed(session, *lines)).outcome in ("stall", "stopped")
        assert await asked(session, "GGP 0, 2") == 0
        task = asyncio.get_running_loop().create_task(other(session, "MST 0"))
        assert (await failed(session, "ROL 0, 500", "/wait stopped")).outcome == "stopped"
        await task
        await sent(session, "SAP 2, 0, -500", "/sleep 0.2", "SAP 2, 0, 0", "/wait stopped")


async def test_a_slew_that_a_trip_ended_is_no_failure(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, *TRIP)
        await sent(session, "TE=2", "SL 10000", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777


# Motion that the drive itself may end


GO = ("PG 1", "SL 0", "E", "PG")
"""A program at address 1, which an input of type 4 starts. It has ended when the drive is at rest."""


@pytest.mark.parametrize(("personality", "setup"), [("LMDCM", "IS=2,4,0"), ("LMM", "IS=2,4,0"), ("MDI", "S2=4,0")])
@pytest.mark.parametrize("line", ["SL 10000", "MA 900000"])
async def test_a_program_that_an_input_starts_may_end_a_motion(
    tmp_path: Path, personality: str, setup: str, line: str
) -> None:
    async with session_on(tmp_path, bus("line", drive(personality, "a", VM=20000, A=100000, D=100000))) as session:
        await typed(session, *GO, setup)
        await sent(session, line, "/sleep 0.3", "/sim input a 2 0", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777
        await typed(session, setup.replace("4", "0", 1))
        task = asyncio.get_running_loop().create_task(other(session, "SL 0"))
        assert (await failed(session, line, "/wait stopped", "R1=778")).reason == "not by this script"
        await task


async def test_an_input_that_stops_the_motion_is_a_failure_with_its_error(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        await session.run("IS=2,5,0")
        failure = await failed(session, "SL 10000", "/sleep 0.3", "/sim input a 2 0", "/wait stopped", "R1=777")
        assert failure.reason == "error 91: an input of type stop ended the motion"
        assert await value(session, "R1") == 0


async def test_a_trip_that_is_armed_on_the_way_may_end_a_slew(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        await typed(session, *TRIP)
        await sent(session, "SL 10000", "TE=2", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777


async def test_the_end_of_a_program_ends_no_motion_that_a_line_began(tmp_path: Path) -> None:
    """E ends the program, and a move that is under way goes on (MCode reference 5.1.35)."""
    async with on(tmp_path, **SLOW) as session:
        for line in ("MA 20000", "SL 10000"):
            task = asyncio.get_running_loop().create_task(other(session, "SL 0"))
            failure = await failed(session, line, "E", "/wait stopped", "R1=777")
            await task
            assert (failure.outcome, failure.reason) == ("stopped", "not by this script")
        await typed(session, "PG 1", "LB G1", "H 9000", "E", "PG")
        await sent(session, "EX G1", "E", "/wait idle", "R1=778")
        assert await value(session, "R1") == 778


async def test_bridges_that_are_switched_off_end_a_slew_and_are_the_reason(tmp_path: Path) -> None:
    async with on(tmp_path, **SLOW) as session:
        failure = await failed(session, "SL 10000", "/sleep 0.3", "DE=0", "/wait stopped")
        assert (failure.outcome, failure.reason) == ("power", "its output bridges are off (DE=0)")


@pytest.mark.parametrize("line", ["JX+", "X-2000"])
async def test_a_program_of_a_controller_that_still_runs_may_have_ended_a_motion(tmp_path: Path, line: str) -> None:
    from multidrop.families.pmx.manual import program_file

    async with controller(tmp_path, SWITCHES) as session:
        await session.drive().download(program_file.read("PRG 0\nSTOPX\nDELAY=5000\nEND", "a.prg"))
        await session.run("ABS")
        task = asyncio.get_running_loop().create_task(other(session, "SR0=1"))
        await sent(session, line, "/wait stopped", "V1=777")
        await task
        await typed(session, "SR0=0")
        task = asyncio.get_running_loop().create_task(other(session, "STOPX"))
        assert (await failed(session, "JX+", "/wait stopped")).outcome == "stopped"
        await task


@pytest.mark.parametrize("line", ["ROR 0, 500", "MVP ABS, 0, 500000"])
async def test_a_program_of_a_module_that_still_runs_may_have_ended_a_motion(tmp_path: Path, line: str) -> None:
    from multidrop.families.tmcl.manual import program_file

    async with module(tmp_path, "TMCM-1241") as session:
        await session.drive().download(program_file.read("MST 0\nWAIT TICKS, 0, 900\nSTOP", "a.tmc"))
        task = asyncio.get_running_loop().create_task(other(session, "129 0, 0, 0"))
        await sent(session, line, "/wait stopped", "SGP 0, 2, 777")
        await task
        assert await asked(session, "GGP 0, 2") == 777
