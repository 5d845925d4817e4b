"""The records of one automation: what it has claimed, what it may start, and what others may not."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic, DriveError
from multidrop.dialects import Started
from multidrop.shell.automation import Automation, SentMotion, outcome
from multidrop.shell.origin import PERSON
from tests.support.automated import automated
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual

FLOOR = (bus("press", party("a"), party("b"), baud=0), bus("gantry", party("c"), baud=0))


@pytest.fixture
async def shop(tmp_path: Path) -> AsyncIterator[Any]:
    async with CellSession(tmp_path, *FLOOR) as made:
        yield made


def at(shop: Any, name: str, address: str) -> Any:
    return shop.session.drive(name, address)


async def refused(shop: Any, line: str) -> str:
    with pytest.raises(Diagnostic) as caught:
        await shop.session.run(line)
    return str(caught.value)


CLAIMED = [
    (("press", "a"), ("press", "a"), True),
    (("press", "a"), ("press", "b"), False),
    (("press", "a"), ("gantry", "a"), False),
    (("press", "*"), ("press", "b"), True),
    (("press", "b"), ("press", "*"), True),
    (("press", "*"), ("gantry", "b"), False),
]


@pytest.mark.parametrize(("own", "other", "has"), CLAIMED)
async def test_a_claim_is_for_its_drive_and_a_global_address_for_all_of_its_line(shop, own, other, has):
    def claim(each):
        return (shop.session.buses[each[0]].link, each[1])

    automation = Automation(0, claims=frozenset({claim(own)}))
    assert automation.has(claim(other)) is has
    if own[1] != "*" and other[1] != "*":
        started = Automation(0)
        started.started[at(shop, *own)] = SentMotion(0.0, Started())
        assert started.has(claim(other)) is has
    assert not Automation(0).has(claim(other))


async def run_beside(shop, line, name="macro shuttle", claims=()):
    """Another automation that has sent a line, and goes on until it is cancelled."""
    begun = asyncio.Event()

    async def work():
        async with shop.session.automations.run(PERSON, name, claims) as origin:
            if line:
                await shop.session.run(line, origin)
            begun.set()
            await asyncio.sleep(1000)

    task = asyncio.create_task(work())
    await begun.wait()
    return task


async def end(task):
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


@pytest.mark.parametrize(("name", "who"), [("macro shuttle", "macro shuttle"), ("", "another script")])
@pytest.mark.parametrize(("line", "where"), [("@press:a MR 7", "a"), ("@press:* MR 7", "press")])
async def test_a_drive_that_another_automation_moves_gets_nothing(shop, name, who, line, where):
    task = await run_beside(shop, "@press:a SL 1000", name)
    shop.events.clear()
    async with automated(shop.session):
        says = await refused(shop, line)
        assert says == f"{where}: {who} moves it, so nothing was sent; wait for its end, or stop it (/play stop)"
        assert b"MR" not in shop.written("press")
        await shop.session.run("@press:b MR 7")
        await shop.session.run("@press:a PR P")
    await end(task)
    async with automated(shop.session):
        await shop.session.run("@press:a MR 7")


async def test_a_claimed_drive_is_refused_before_the_other_automation_has_moved_it(shop):
    claim = (shop.session.buses["press"].link, "a")
    task = await run_beside(shop, "", claims=[claim])
    async with automated(shop.session):
        assert "macro shuttle moves it" in await refused(shop, "@press:a MR 7")
    with pytest.raises(Diagnostic, match="macro shuttle moves it"):
        async with automated(shop.session, "macro second", [claim]):
            raise AssertionError("it began")
    await end(task)
    async with automated(shop.session, "macro second", [claim]):
        pass


async def test_a_part_adds_its_claims_and_its_name_only_as_long_as_it_runs(shop):
    claim = (shop.session.buses["press"].link, "a")
    async with automated(shop.session):
        current = shop.session.origin.automation
        async with automated(shop.session, "macro part", [claim]):
            assert shop.session.origin.automation is current
            assert (current.name, current.claims) == ("macro part", frozenset({claim}))
            async with automated(shop.session, "macro within"):
                assert (current.name, current.claims) == ("macro part", frozenset({claim}))
        assert (current.name, current.claims) == ("", frozenset())
    assert shop.session.origin.automation is None


async def test_who_sends_the_lines(shop):
    assert PERSON.sequence(shop.session) is shop.session
    async with automated(shop.session) as origin:
        assert origin.sequence(shop.session) is origin.automation is not None
    assert shop.session.origin is PERSON


async def test_while_it_must_be_still_it_starts_nothing_but_may_end_motion_and_ask(shop):
    automations = shop.session.automations
    async with automated(shop.session):
        with automations.still(shop.session.origin, "its inputs are read"):
            with automations.still(shop.session.origin, "and again"):
                assert await refused(shop, "@press:a MR 7") == "a: and again"
            assert await refused(shop, "@press:a MR 7") == "a: its inputs are read"
            await shop.session.run("@press:a SL 0")
            await shop.session.run("@press:a PR P")
        assert shop.session.origin.automation.started == {}
        await shop.session.run("@press:a MR 7")
        assert list(shop.session.origin.automation.started) == [at(shop, "press", "a")]
    with automations.still(shop.session.origin, "a person is not held back"):
        await shop.session.run("@press:a MR 7")


async def test_what_it_leaves_goes_on_after_its_failure(shop):
    with pytest.raises(RuntimeError):
        async with automated(shop.session):
            await shop.session.run("@press:a SL 1000")
            shop.session.automations.leave(shop.session.origin)
            await shop.session.run("@press:b SL 1000")
            raise RuntimeError
    assert shop.moving() == {"press:a"}
    assert shop.warned()[-2:] == [
        "stopped press:b: velocity 0 was read from press:b",
        "program ended, if one was running: press:b",
    ]
    shop.session.automations.leave(shop.session.origin)


async def test_an_end_in_between_stops_what_was_started_and_what_comes_after_is_new(shop):
    automations = shop.session.automations
    assert await automations.end(shop.session.origin) == []
    async with automated(shop.session):
        await shop.session.run("@press:a SL 1000")
        halts = await automations.end(shop.session.origin)
        assert [[each.address for each in halt.drives] for halt in halts] == [["a"]]
        own = shop.session.origin.automation
        assert (own.started, own.stopped, own.halts) == ({}, {}, [])
        await shop.session.run("@gantry:c SL 1000")
        assert await automations.end(shop.session.origin) != halts
    await asyncio.sleep(1)
    assert shop.moving() == set()


async def test_a_line_that_was_refused_started_nothing(shop):
    automations = shop.session.automations
    async with automated(shop.session):
        current, drive = shop.session.origin.automation, at(shop, "press", "a")
        first = SentMotion(1.0, Started())
        current.started[drive] = first
        automations.restores(current, drive, None)
        assert current.started == {}
        automations.restores(current, drive, first)
        assert current.started == {}
        automations.records(current, drive, Started(), "it may move")
        assert current.started[drive].why == "it may move"
        automations.restores(current, drive, first)
        assert current.started == {drive: first}


async def test_a_further_start_adds_to_what_was_started_and_makes_it_due_again(shop):
    automations, drive = shop.session.automations, at(shop, "press", "a")
    automation = Automation(0)
    automation.stopped[drive] = SentMotion(0.0, Started())
    first = Started(frozenset("x"), program=False, lasts=False)
    automations.records(automation, drive, first)
    automations.records(automation, drive, Started(frozenset("y"), program=True, lasts=False))
    assert automation.started[drive].what == Started(frozenset("xy"), program=True, lasts=False)
    assert automation.stopped == {}


async def test_the_end_of_all_is_waited_for_and_the_wait_is_said(shop):
    said: list[str] = []
    await shop.session.automations.over(said.append)
    assert said == []
    first = await run_beside(shop, "", "macro shuttle")
    second = await run_beside(shop, "", "")
    begun = shop.session.now()
    await shop.session.automations.over(said.append)
    assert said == ["waiting 10 s at most for the end of macro shuttle, a script"]
    assert 10.4 < shop.session.now() - begun < 10.7
    await end(first)
    await end(second)
    begun = shop.session.now()
    await shop.session.automations.over(said.append)
    assert len(said) == 1 and shop.session.now() == begun


async def test_an_end_that_comes_soon_is_not_said(shop):
    said: list[str] = []
    task = await run_beside(shop, "")
    asyncio.get_running_loop().call_later(0.3, task.cancel)
    begun = shop.session.now()
    await shop.session.automations.over(said.append)
    assert said == [] and 0.29 < shop.session.now() - begun < 0.35


async def test_a_drive_that_was_read_at_rest_since_gets_no_stop(shop):
    with pytest.raises(DriveError):
        async with automated(shop.session):
            await shop.session.run("@press:a MR 7")
            await shop.session.run("/wait stopped")
            await shop.session.run("@gantry:c SL 1000")
            shop.events.clear()
            await shop.session.run("@press:a PR XX")
    await asyncio.sleep(1)
    assert b"\x1b" not in shop.written("press") and b"cSL 0" in shop.written("gantry")
    assert shop.warned()[:1] == ["stopped gantry:c: velocity 0 was read from gantry:c"]


async def test_a_drive_that_moves_again_by_another_hand_gets_its_stop(shop):
    with pytest.raises(DriveError):
        async with automated(shop.session):
            await shop.session.run("@press:a MR 7")
            await shop.session.run("/wait stopped")
            shop.device("press:a").execute("SL 1000", shop.floor.now())
            await shop.session.run("@gantry:c PR XX")
    assert shop.moving() == set()
    assert shop.warned()[0] == "stopped press:a: velocity 0 was read from press:a"


async def test_a_bus_that_was_closed_is_named_with_its_stop_that_was_not_sent(shop):
    async with automated(shop.session):
        await shop.session.run("@gantry:c SL 1000")
        link, drive = shop.session.buses["gantry"].link, at(shop, "gantry", "c")
        await shop.session.run("/close gantry")
        halts = await shop.session.automations.end(shop.session.origin)
    (halt,) = halts
    assert (halt.link, halt.number, halt.whole, halt.drives, halt.data) == (link, 0, False, (drive,), b"")
    assert (halt.trouble, list(halt.started)) == (["closed"], [drive])


async def test_no_stop_has_no_words(shop):
    assert outcome(shop.session, []) == []
