"""Of which drive, axis and sequence a motion is, and what is read for it: several drives, lines for all, raw wire."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import DriveError, NoAnswer, Refused
from multidrop.drives.drive import confirmed_motion
from multidrop.shell.motions import perform
from multidrop.shell.waits import in_motion
from tests.support.automated import automated
from tests.support.cases import for_each
from tests.support.cell_session import CellSession, bus, party, pmx
from tests.support.outcomes import failed, sent

pytestmark = pytest.mark.virtual

SLOW = {"CK": 0, "VM": 20000, "A": 100000, "D": 100000}
RUNS = "program_text = '''\nPG 100\nLB Ga\nH 9000\nE\nPG\n'''"


@pytest.fixture
async def shop(tmp_path: Path) -> AsyncIterator[CellSession]:
    cell = bus("press", party("a", **SLOW), party("b", RUNS, **SLOW), baud=0), bus("pmx", pmx("00"), baud=0)
    async with CellSession(tmp_path, *cell) as made:
        yield made


async def test_a_line_for_one_drive_changes_nothing_of_the_motion_of_another(shop: CellSession) -> None:
    async def stop_b() -> None:
        await asyncio.sleep(1)
        await shop.session.run("@b SL 0")

    lines = ("@press:b MA 90000", "@press:a MR 500", "@press:a SL 0", "/wait stopped")
    failure, _ = await asyncio.gather(failed(shop.session, *lines), stop_b())
    assert (failure.target, failure.outcome, failure.reason) == (90000, "stopped", "not by this script")
    assert failure.position is not None
    assert str(failure) == f"press:b stopped at {failure.position} of 90000, not by this script"


@for_each(
    "begin, move, target",
    [("MA 1000", "MR 90000", 91000), ("MA 1000", "MA 90000", 90000), ("MR -700", "MR -90000", -90700)],
)
async def test_a_relative_move_has_its_target_from_where_it_began(
    tmp_path: Path, begin: str, move: str, target: int
) -> None:
    async with CellSession(tmp_path, bus("press", party("a", **SLOW), baud=0)) as shop:

        async def stop() -> None:
            await asyncio.sleep(2)
            await shop.session.run("SL 0")

        lines = (begin, "/wait stopped", move, "/wait stopped")
        failure, _ = await asyncio.gather(failed(shop.session, *lines), stop())
        assert (failure.target, failure.outcome) == (target, "stopped")


async def test_a_line_for_all_is_a_motion_of_each(shop: CellSession) -> None:
    async def stop_b() -> None:
        await asyncio.sleep(1)
        await shop.session.run("@press:b SL 0")

    failure, _ = await asyncio.gather(failed(shop.session, "@press:* MR 60000", "/wait stopped"), stop_b())
    assert failure.target == 60000 and str(failure).startswith("press:b stopped at ")
    await sent(shop.session, "@press:* MR 500", "/wait stopped")


async def test_before_a_line_for_all_a_drive_in_program_mode_is_not_asked_as_it_would_store_the_question(
    shop: CellSession,
) -> None:
    await shop.session.run("@press:b PG 500")
    shop.events.clear()
    with pytest.raises(Refused, match="b: in program mode a command to all would be stored"):
        await sent(shop.session, "@press:* SL 5000")
    assert b"bPR" not in shop.written("press") and b"aPR" in shop.written("press")
    assert shop.moving() == set()
    await shop.session.run("@press:b PG")


async def test_one_drive_that_does_not_reply_keeps_no_line_from_the_others(shop: CellSession) -> None:
    shop.world("/sim power press:b off")
    await sent(shop.session, "@press:* SL 5000", "/sleep 1")
    assert shop.moving() == {"press:a"}
    await shop.session.run("@press:* SL 0")
    with pytest.raises(NoAnswer) as caught:
        await sent(shop.session, "@press:b SL 5000")
    assert str(caught.value).startswith("b does not reply: 'SL 5000' was not sent")


@for_each("certain, stopped", [(True, [False]), (False, [True])])
async def test_a_stop_that_may_have_been_executed_counts_as_one_of_this_sequence(
    shop: CellSession, certain: bool, stopped: list[bool]
) -> None:
    def work() -> Any:
        raise Refused("it, or another line", certain=certain)
        yield

    drive = shop.session.drive("press", "a")
    async with automated(shop.session):
        await shop.session.run("@press:a MA 90000")
        with pytest.raises(Refused):
            await perform(shop.session, shop.session.origin, drive, ["SL 0"], work())
        assert [each.stopped for each in drive.motions.open_of(shop.session.origin.sequence(shop.session))] == stopped
        shop.session.automations.leave(shop.session.origin)


# What is in motion


async def test_a_drive_that_was_read_at_rest_right_before_its_start_is_read_again(shop: CellSession) -> None:
    drive = shop.session.drive("press", "a")
    await confirmed_motion(drive)
    await drive.send("SL 20000")
    await asyncio.sleep(0.01)
    assert shop.moving() == {"press:a"}
    (found,) = await in_motion(shop.session)
    assert found.startswith("press:a moves at ")


async def test_what_was_read_within_a_second_is_not_asked_again(shop: CellSession) -> None:
    await shop.session.run("@press:a SL 20000")
    await asyncio.sleep(1)
    for drive in shop.session.buses["press"].all_drives:
        await confirmed_motion(drive)
        await drive.busy()
    shop.events.clear()
    await asyncio.sleep(0.5)
    assert await in_motion(shop.session) == ["press:a moves at 20000 a second"]
    assert shop.written("press") == b""
    await asyncio.sleep(0.7)
    assert await in_motion(shop.session) == ["press:a moves at 20000 a second"]
    assert b"aPR" in shop.written("press") and b"bPR" in shop.written("press")


async def test_a_program_is_asked_for_again_after_each_start(shop: CellSession) -> None:
    drive = shop.session.drive("press", "b")
    for line, found in (("E", []), ("EX Ga", ["press:b runs a program, which may move it"])) * 2:
        await asyncio.sleep(1.5)
        await drive.send(line)
        await asyncio.sleep(0.1)
        assert [each for each in await in_motion(shop.session) if each.startswith("press:b ")] == found


async def test_beside_polls_that_read_no_programs_a_drive_at_rest_is_asked_for_its_program(shop: CellSession) -> None:
    polls = shop.session.buses["press"].telemetry.subscribe(("a", "b"), 0.1)
    await shop.session.run("@press:a SL 20000")
    await asyncio.sleep(12)
    shop.device("press:b").execute("EX Ga", shop.floor.now())  # as another host does it
    await asyncio.sleep(0.5)
    polls.close()
    await asyncio.sleep(0.05)
    shop.events.clear()
    assert await in_motion(shop.session) == [
        "press:a moves at 20000 a second",
        "press:b runs a program, which may move it",
    ]
    asked = shop.written("press")
    assert b"bPR" in asked and b"aPR" not in asked


async def test_a_drive_that_read_velocity_0_once_and_cannot_be_asked_again_is_not_taken_for_at_rest() -> None:
    once = SimpleNamespace(at=4.9, velocity=0, at_rest=lambda: False)
    drive = SimpleNamespace(
        seen=once, started_at=1.0, link=SimpleNamespace(away=None), programming=True, transferring=False
    )
    line = SimpleNamespace(all_drives=[drive], now=lambda: 5.0)
    workspace: Any = SimpleNamespace(now=line.now, buses={"press": line}, display_name=lambda _: "a")
    assert await in_motion(workspace) == ["a had velocity 0 once, but not twice at one position"]


async def test_a_silent_drive_leaves_time_to_read_those_that_were_heard_last(tmp_path: Path) -> None:
    names = ("a", "b", "c")
    async with CellSession(tmp_path, bus("press", *(party(name, **SLOW) for name in names))) as shop:
        for drive in shop.session.buses["press"].all_drives:
            await confirmed_motion(drive)
        for name in ("a", "b"):
            shop.world(f"/sim power {name} off")
        shop.device("press:c").execute("SL 20000", shop.floor.now())
        await asyncio.sleep(2)
        begun = shop.session.now()
        found = await in_motion(shop.session)
        assert found[-1] == "c moves at 20000 a second" and len(found) == 3
        assert all(" is not known: last seen standing " in each for each in found[:2])
        assert shop.session.now() - begun <= 2.1


async def test_a_drive_in_program_mode_is_not_asked_whether_it_moves(shop: CellSession) -> None:
    await shop.session.run("@press:a PG 500")
    await asyncio.sleep(2)
    shop.events.clear()
    found = await in_motion(shop.session)
    assert b"aPR" not in shop.written("press") and b"bPR" in shop.written("press")
    assert len(found) == 1 and found[0].startswith("press:a is not known: ")
    await shop.session.run("@press:a PG")


# Waits


async def test_a_wait_ends_at_its_limit_and_asks_no_drive_that_stores_the_question(shop: CellSession) -> None:
    await shop.session.run("@press:a PR P")
    await shop.session.run("@press:b SL 20000")
    waiting = asyncio.ensure_future(shop.session.run("/wait stopped 5"))
    await asyncio.sleep(1)
    await shop.session.drive("press", "a").send("PG 500")
    with pytest.raises(DriveError, match="a is in program mode and would store "):
        await waiting


async def test_after_its_limit_a_wait_for_a_value_has_asked_once_more_than_it_slept(shop: CellSession) -> None:
    shop.events.clear()
    begun = shop.session.now()
    with pytest.raises(DriveError, match="still reports 0 after 0 s"):
        await shop.session.run("/wait @press:a P=5 0")
    assert shop.session.now() - begun < 0.05
    assert shop.written("press").count(b"PR P") == 1


async def test_of_an_outcome_that_was_judged_before_the_next_wait_says_the_same(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a", **SLOW), baud=0)) as shop:
        async with automated(shop.session):
            await shop.session.run("MA 3000")
            await shop.session.run("/wait stopped")
            await shop.session.run("/wait ended")
            shop.device("press:a").execute("MA 9000", shop.floor.now())
            await shop.session.run("/wait ended")
        assert shop.moving() == set()


async def test_a_drive_that_would_store_the_question_ends_a_wait_before_it_begins_whatever_moves(
    shop: CellSession,
) -> None:
    await shop.session.run("@press:a SL 20000")
    await shop.session.run("@press:b PG 500")
    shop.events.clear()
    begun = shop.session.now()
    with pytest.raises(DriveError, match="press:b is in program mode and would store the question"):
        await shop.session.run("/wait stopped 5")
    assert shop.session.now() == begun and shop.written("press") == b""
