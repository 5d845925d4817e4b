"""How motions end, MCode: a wait succeeds or fails by how the motion ended, not by velocity alone."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import DriveError, MotionFailed, NoAnswer, Refused, TransportLost
from multidrop.dialects import Procedure
from multidrop.dialects.motions import Ending
from multidrop.shell.events import Failed, Notified, Output
from multidrop.shell.scripts.executor import run_script
from multidrop.shell.scripts.reading import WrongScript, read_script
from multidrop.shell.session import Session
from multidrop.simulator.cell.spec import Faults
from tests.support.cell_session import bus, party, session_on
from tests.support.faults import disturb
from tests.support.outcomes import failed, sent

pytestmark = pytest.mark.virtual

ENCODER = {"EE": 1, "VM": 8000, "A": 40000, "D": 40000, "MT": 50}
STALLS = "[bus.drive.world]\nstall_at = 20000"
"""In steps: P stays at about 1571 counts of 4000."""


@asynccontextmanager
async def on(folder: Path, *lines: str, **settings: int) -> AsyncIterator[Session]:
    """A session on drives a and b; `lines` and settings are a's."""
    cell = bus("press", party("a", *lines, **{"CK": 0, **settings}), party("b", CK=0), baud=0)
    async with session_on(folder, cell) as session:
        yield session


async def value(session: Session, word: str) -> int:
    (text,) = await session.drive().send(f"PR {word}")
    return int(text)


def noted(session: Session) -> list[str]:
    events: Sequence[object] = session.events  # type: ignore[attr-defined]
    return [each.text for each in events if isinstance(each, Notified | Failed)]


@pytest.mark.parametrize(("em", "ck"), list(product((0, 1, 2, 3), (0, 1))))
async def test_a_stall_fails_the_wait_and_the_next_line_is_not_sent(tmp_path: Path, em: int, ck: int) -> None:
    async with on(tmp_path, STALLS, **ENCODER, EM=em, CK=ck) as session:
        failure = await failed(session, "MA 4000", "/wait stopped", "R1=777")
        assert failure.reason == "stalled" and failure.outcome == "stall" and failure.target == 4000
        assert failure.position is not None and 1000 < failure.position < 2000
        assert str(failure) == f"a stopped at {failure.position} of 4000: stalled"
        assert await value(session, "R1") == 0
        assert not any("old error" in each for each in noted(session))


@pytest.mark.parametrize(("em", "ck"), list(product((0, 1, 2, 3), (0, 1))))
async def test_a_move_that_reaches_its_target_does_not_fail(tmp_path: Path, em: int, ck: int) -> None:
    async with on(tmp_path, **ENCODER, EM=em, CK=ck) as session:
        await sent(session, "MA 4000", "/wait stopped", "MR -500", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777 and await value(session, "P") == 3500


LIMIT = "[bus.drive.world]\nlimit_plus = 30000"


@asynccontextmanager
async def at_limit(folder: Path, *lines: str, **settings: int) -> AsyncIterator[Session]:
    """Drive a with a plus limit at 30000 steps on input 1."""
    async with on(folder, *lines, LIMIT, **settings) as session:
        await session.run("IS=1,2,0")
        yield session


@pytest.mark.parametrize("wait", ["/wait stopped", "/wait idle", "/wait P=90000", "/wait @b I1=1"])
async def test_a_limit_fails_every_wait_early(tmp_path: Path, wait: str) -> None:
    async with at_limit(tmp_path) as session:
        begun = session.now()
        failure = await failed(session, "MA 90000", wait, "R1=777")
        assert failure.outcome == "limit" and failure.reason == "error 83: plus limit reached"
        assert failure.target == 90000 and failure.position is not None and 30000 < failure.position < 90000
        assert await value(session, "R1") == 0 and session.now() - begun < 10


@pytest.mark.parametrize("wait", ['/wait "DONE" 60', '/expect "DONE" 60'])
async def test_a_wait_for_a_text_ends_with_the_failed_motion(tmp_path: Path, wait: str) -> None:
    async with at_limit(tmp_path) as session:
        begun = session.now()
        with pytest.raises(MotionFailed, match="plus limit reached"):
            await ran(session, tmp_path, "MA 90000", wait, "R1=777")
        assert await value(session, "R1") == 0 and session.now() - begun < 10


PRINTS = "program_text = '''\nPG 100\nLB Ga\nMA 20000\nH\nH 2000\nPR \"DONE\"\nE\nPG\n'''"


@pytest.mark.parametrize("wait", ['/wait "DONE" 60', '/expect "DONE" 60'])
async def test_a_wait_for_a_text_takes_one_that_comes_after_the_motion(tmp_path: Path, wait: str) -> None:
    async with on(tmp_path, PRINTS, VM=20000) as session:
        await ran(session, tmp_path, "EX Ga", wait, "R1=777")
        assert await value(session, "R1") == 777


async def test_a_wait_for_a_text_lasts_as_long_as_it_says(tmp_path: Path) -> None:
    async with on(tmp_path, VM=20000) as session:
        begun = session.now()
        with pytest.raises(DriveError, match="not printed within 7.3 s"):
            await sent(session, "MA 20000", '/wait "DONE" 7.3')
        assert session.now() - begun == pytest.approx(7.3, abs=0.3)


async def test_a_limit_ends_a_move_without_a_target_as_a_failure(tmp_path: Path) -> None:
    async with at_limit(tmp_path) as session:
        assert (await failed(session, "SL 50000", "/wait stopped")).outcome == "limit"


async def test_the_second_wait_for_the_same_motion_is_for_a_drive_at_rest(tmp_path: Path) -> None:
    async with at_limit(tmp_path) as session:
        with pytest.raises(MotionFailed):
            await sent(session, "MA 90000", "/wait stopped")
        await sent(session, "/wait stopped", "MA 1000", "/wait stopped")
        assert await value(session, "P") == 1000


async def test_the_line_after_a_failed_motion_is_not_sent_without_a_wait(tmp_path: Path) -> None:
    """EM=0 shows the error with each prompt."""
    async with at_limit(tmp_path, EM=0) as session:
        failure = await failed(session, "MA 90000", "/sleep 5", "PR P", "R1=777")
        assert str(failure).endswith("error 83: plus limit reached; 'R1=777' was not sent")
        assert await value(session, "R1") == 0
        assert not any("old error" in each for each in noted(session))


async def test_the_next_move_is_not_sent_after_a_failed_one(tmp_path: Path) -> None:
    async with at_limit(tmp_path, EM=1, CK=1) as session:
        failure = await failed(session, "MA 90000", "/sleep 5", "MA 0")
        assert str(failure).endswith("'MA 0' was not sent")
        assert await value(session, "P") > 30000


async def test_a_person_is_told_of_a_failed_motion_and_the_next_line_goes_out(tmp_path: Path) -> None:
    async with at_limit(tmp_path, EM=0) as session:
        for line in ("MA 90000", "/sleep 5", "PR P", "R1=777"):
            await session.run(line)
        assert await value(session, "R1") == 777
        assert any("of 90000: error 83: plus limit reached" in each for each in noted(session))


async def test_a_line_that_ends_motion_is_never_held_back(tmp_path: Path) -> None:
    async with at_limit(tmp_path, EM=0) as session:
        failure = await failed(session, "MA 90000", "/sleep 5", "PR P", "SL 0", "R1=777")
        assert str(failure).endswith("error 83: plus limit reached; 'SL 0' was executed")


# What is no failure


@pytest.mark.parametrize("error", [NoAnswer("a does not reply"), Refused("a refused it")])
async def test_a_motion_whose_end_cannot_be_read_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: DriveError
) -> None:
    def unread(*_: object) -> Procedure[Ending | None]:
        raise error
        yield

    async with on(tmp_path) as session:
        own: Any = session.drive().family.motions
        monkeypatch.setattr(type(own), "judge", unread)
        failure = await failed(session, "MR 100", "/wait stopped", "R1=777")
        assert (failure.outcome, failure.reason) == ("unknown", f"its end could not be read ({error})")
        assert await value(session, "R1") == 0


@pytest.mark.parametrize("error", [NoAnswer("a does not reply"), Refused("a refused it"), TransportLost("unplugged")])
async def test_a_line_keeps_its_outcome_where_the_end_of_a_motion_before_it_cannot_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def unread(*_: object) -> Procedure[Ending | None]:
        raise error
        yield

    async with at_limit(tmp_path) as session:
        own: Any = session.drive().family.motions
        monkeypatch.setattr(type(own), "judge", unread)
        failure = await failed(session, "MA 90000", "/sleep 5", "R1=777")
        assert failure.outcome == "unknown"
        assert str(failure).startswith(
            f"a stopped: its end could not be read ({error}); a: error 83: plus limit reached"
        )
        assert "it refused 'R1=777', or that came by itself and it was executed" in str(failure)
        assert await value(session, "R1") == 777


async def test_a_move_replaced_by_the_same_script_is_no_failure(tmp_path: Path) -> None:
    async with on(tmp_path) as session:
        await sent(session, "MA 900000", "/sleep 0.2", "MA 1000", "/wait stopped", "R1=777")
        assert await value(session, "P") == 1000 and await value(session, "R1") == 777


async def test_a_stop_of_the_same_script_is_no_failure(tmp_path: Path) -> None:
    async with on(tmp_path) as session:
        await sent(session, "MA 900000", "/sleep 0.2", "SL 0", "/wait stopped", "R1=777")
        assert 0 < await value(session, "P") < 900000


async def test_a_stop_of_someone_else_is_a_failure(tmp_path: Path) -> None:
    async with on(tmp_path) as session:

        async def script() -> MotionFailed:
            return await failed(session, "MA 900000", "/wait stopped", "R1=777")

        task = asyncio.get_running_loop().create_task(script())
        await asyncio.sleep(0.3)
        await session.run("SL 0")
        failure = await task
        assert failure.outcome == "stopped" and failure.reason == "not by this script"
        assert str(failure) == f"a stopped at {failure.position} of 900000, not by this script"


async def test_a_stop_by_another_host_is_a_failure(tmp_path: Path) -> None:
    async with on(tmp_path) as session:

        async def other() -> None:
            await asyncio.sleep(0.3)
            drive = session.drive()
            await drive.run(drive.family.perform("SL 0"))  # past everything that the session records

        task = asyncio.get_running_loop().create_task(other())
        failure = await failed(session, "MA 900000", "/wait stopped", "R1=777")
        await task
        assert failure.outcome == "stopped" and failure.reason == "not by this script"


async def test_a_move_replaced_by_someone_else_is_a_failure(tmp_path: Path) -> None:
    async with on(tmp_path) as session:

        async def script() -> MotionFailed:
            return await failed(session, "MA 900000", "/wait stopped")

        task = asyncio.get_running_loop().create_task(script())
        await asyncio.sleep(0.3)
        await session.run("MA 0")
        failure = await task
        assert failure.outcome == "replaced" and failure.reason == "not by this script"


async def test_an_old_error_of_a_drive_at_rest_is_no_failure(tmp_path: Path) -> None:
    async with at_limit(tmp_path) as session:
        with pytest.raises(MotionFailed):
            await sent(session, "MA 90000", "/wait stopped")
        drive = session.drive()
        device_error = "MA 90000"  # into the active limit: refused, and the flag is left set by another host
        with pytest.raises(DriveError):
            await drive.run(drive.family.perform(device_error))
        await sent(session, "/wait stopped", "R1=777", "MA 100", "/wait stopped")
        assert await value(session, "P") == 100


# Every ending accepted


async def ran(session: Session, folder: Path, *lines: str) -> list[str]:
    """Run a script; return what it printed by itself."""
    file = folder / "script.txt"
    file.write_text("\n".join(lines) + "\n")
    script = read_script(str(file), {})
    session.events.clear()  # type: ignore[attr-defined]
    await run_script(session, session.origin, script)
    return [each.text for each in session.events if isinstance(each, Output)]  # type: ignore[attr-defined]


ENDED = ("/wait ended 20", "/print {outcome}", '/if outcome == "limit"', "R1=83", "/end")


@pytest.mark.parametrize(
    ("lines", "outcome"),
    [
        (("MA 1000",), "reached"),
        (("SL 50000",), "limit"),
        (("MA 90000",), "limit"),
        (("SL 5000", "/sleep 0.5", "SL 0"), "stopped"),
        (("MA 900", "MA 500"), "reached"),
    ],
)
async def test_a_script_goes_on_after_any_ending_and_knows_it(
    tmp_path: Path, lines: tuple[str, ...], outcome: str
) -> None:
    async with at_limit(tmp_path) as session:
        assert await ran(session, tmp_path, *lines, *ENDED) == [outcome]
        assert await value(session, "R1") == (83 if outcome == "limit" else 0)


async def test_a_stall_is_an_outcome(tmp_path: Path) -> None:
    async with on(tmp_path, STALLS, **ENCODER) as session:
        assert await ran(session, tmp_path, "MA 4000", *ENDED) == ["stall"]


async def test_a_lost_supply_is_an_outcome(tmp_path: Path) -> None:
    async with on(tmp_path) as session:
        lines = ("MA 9000000", "/sleep 0.3", "/sim power a off", *ENDED)
        assert await ran(session, tmp_path, *lines) == ["unknown"]


async def test_a_reading_without_a_reply_is_no_ending(tmp_path: Path) -> None:
    async with on(tmp_path, VM=20000) as session:
        wire = next(iter(session.cells.values())).floor.wires["press"]
        loop = asyncio.get_running_loop()
        loop.call_later(1.0, disturb, wire, Faults(delay=(1.5, 1.5)))
        loop.call_later(1.2, disturb, wire)
        assert await ran(session, tmp_path, "MA 90000", *ENDED) == ["reached"]
        assert await value(session, "P") == 90000


@pytest.mark.parametrize("loop", ["/until P>=90000", "/while P<90000"])
async def test_a_loop_that_waits_ends_with_the_failed_motion(tmp_path: Path, loop: str) -> None:
    async with at_limit(tmp_path) as session:
        with pytest.raises(MotionFailed):
            await ran(session, tmp_path, "MA 90000", loop, "/sleep 0.1", "/end", "R1=777")
        assert await value(session, "R1") == 0


def test_the_name_is_known_only_after_the_wait(tmp_path: Path) -> None:
    (tmp_path / "s.txt").write_text("/print {outcome}\n/wait ended\n")
    with pytest.raises(WrongScript, match="outcome"):
        read_script(str(tmp_path / "s.txt"), {})


# Homing and programs


HOME = "[bus.drive.world]\nhome = [-21000, -20000]\nlimit_plus = 30000\nlimit_minus = -60000"


@asynccontextmanager
async def with_home(folder: Path, world: str = HOME, **settings: int) -> AsyncIterator[Session]:
    async with on(folder, world, **settings) as session:
        for line in ("IS=1,2,0", "IS=2,1,0", "IS=3,3,0", "VM=20000"):
            await session.run(line)
        yield session


@pytest.mark.parametrize("mode", [1, 4])
async def test_a_limit_that_turns_the_search_round_is_no_failure(tmp_path: Path, mode: int) -> None:
    async with with_home(tmp_path, LM=mode) as session:
        await sent(session, "HM 3", "/wait stopped", "R1=777")  # seeks plus, and home is on the other side
        assert await value(session, "R1") == 777 and await value(session, "P") < 0


@pytest.mark.parametrize("mode", [2, 5])
async def test_a_limit_that_ends_the_search_is_a_failure(tmp_path: Path, mode: int) -> None:
    async with with_home(tmp_path, LM=mode) as session:
        assert (await failed(session, "HM 3", "/wait stopped", "R1=777")).outcome == "limit"


async def test_a_homing_that_finds_no_home_is_a_failure(tmp_path: Path) -> None:
    async with with_home(tmp_path, HOME.replace("home = [-21000, -20000]\n", "")) as session:
        failure = await failed(session, "HM 3", "/wait stopped", "R1=777")
        assert failure.outcome == "error" and "error 82" in failure.reason


PLAIN = "program_text = '''\nPG 100\nLB Ga\nMA 90000\nH\nE\nPG\n'''"
HANDLED = "program_text = '''\nPG 100\nLB Ga\nOE Gb\nMA 90000\nH\nE\nLB Gb\nR2=5\nRT\nE\nPG\n'''"
AGAIN = "program_text = '''\nPG 100\nLB Ga\nH 300\nMA 200\nH\nE\nPG\n'''"


async def test_a_program_that_ends_with_a_new_error_is_a_failure(tmp_path: Path) -> None:
    async with at_limit(tmp_path, PLAIN) as session:
        assert (await failed(session, "EX Ga", "/wait idle", "R1=777")).outcome == "limit"


async def test_a_program_with_an_oe_routine_handles_its_errors(tmp_path: Path) -> None:
    async with at_limit(tmp_path, HANDLED) as session:
        await sent(session, "EX Ga", "/wait idle", "R1=777")
        assert await value(session, "R2") == 5 and await value(session, "R1") == 777


async def test_a_program_that_moves_the_drive_again_is_no_failure(tmp_path: Path) -> None:
    async with at_limit(tmp_path, AGAIN) as session:
        await sent(session, "EX Ga", "MA 5000", "/wait idle", "R1=777")
        assert await value(session, "P") == 200


@pytest.mark.parametrize("line", ["P=7", "MS=128"])
async def test_a_target_that_counts_otherwise_now_is_not_compared(tmp_path: Path, line: str) -> None:
    async with on(tmp_path) as session:
        await sent(session, "MA 5000", "/sleep 2", line, "/wait stopped")


async def test_a_relative_move_on_the_way_has_no_known_target(tmp_path: Path) -> None:
    async with on(tmp_path) as session:
        await sent(session, "SL 20000", "/sleep 0.5", "MR 5000", "/wait stopped")


# Motions of others


async def test_a_wait_for_another_ones_motion_never_reads_the_error(tmp_path: Path) -> None:
    async with at_limit(tmp_path) as session:
        drive = session.drive()
        await drive.run(drive.family.perform("MA 90000"))  # as another host's line
        with pytest.raises(MotionFailed, match="error flag"):
            await sent(session, "/wait stopped")
        assert await value(session, "EF") == 1
        assert await value(session, "ER") == 83


async def test_an_error_flag_from_before_is_told_and_is_no_failure(tmp_path: Path) -> None:
    async with at_limit(tmp_path) as session:
        drive = session.drive()
        await drive.run(drive.family.perform("MA 90000"))
        await asyncio.sleep(5)
        await sent(session, "/wait stopped")
        assert any("its error flag was set before" in each for each in noted(session))
        assert await value(session, "ER") == 83
