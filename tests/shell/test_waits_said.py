"""What a wait and a reading of positions say, to the letter and to the boundary."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Timeout
from multidrop.dialects import Motion
from multidrop.shell.origin import PERSON
from multidrop.shell.waits import SIGNS, Standing, WaitCondition, condition, in_motion, seconds, standings, wait
from tests.support.cell_session import CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual

RUNS = "program_text = '''\nPG 100\nLB Ga\nH 2000\nH 2000\nE\nPG\n'''"
CELL = bus("press", party("a", CK=0, VM=51200), party("b", RUNS, CK=0), baud=0), bus("pmx", pmx("00"), baud=0)


@pytest.fixture
async def shop(tmp_path: Path) -> AsyncIterator[Any]:
    async with CellSession(tmp_path, *CELL) as made:
        yield made


# Conditions

CONDITIONS = {
    "I1=1": WaitCondition("", "I1", "=", 1),
    "P==0": WaitCondition("", "P", "==", 0),
    "P!=-3": WaitCondition("", "P", "!=", -3),
    "P<+7": WaitCondition("", "P", "<", 7),
    " P <= 7 ": WaitCondition("", "P", "<=", 7),
    "@b P>51200": WaitCondition("b", "P", ">", 51200),
    "@press:b  P >= {100 mm}": WaitCondition("press:b", "P", ">=", 0, "{100 mm}"),
    "P=999999999999999": WaitCondition("", "P", "=", 999999999999999),
    "P=1000000000000000": None,
    "P={}": None,
    "P={{1 mm}}": None,
    "_P=1": None,
    "P_1=1": WaitCondition("", "P_1", "=", 1),
    "1P=1": None,
    "P=\u0661": None,
}


@pytest.mark.parametrize(("text", "found"), CONDITIONS.items())
def test_a_condition_is_read_whole(text: str, found: WaitCondition | None) -> None:
    assert condition(text) == found


@pytest.mark.parametrize(
    ("sign", "below", "equal", "above"),
    [
        ("=", False, True, False),
        ("==", False, True, False),
        ("!=", True, False, True),
        ("<", True, False, False),
        ("<=", True, True, False),
        (">", False, False, True),
        (">=", False, True, True),
    ],
)
def test_each_sign_holds_below_at_and_above_its_value(sign: str, below: bool, equal: bool, above: bool) -> None:
    wanted = WaitCondition("", "P", sign, 5)
    assert [wanted.holds(seen) for seen in (4, 5, 6)] == [below, equal, above]


def test_every_sign_has_a_meaning() -> None:
    assert set(SIGNS) == {"=", "==", "!=", "<", "<=", ">", ">="}


def test_a_condition_is_shown_with_its_number_or_its_quantity() -> None:
    assert WaitCondition("b", "P", ">=", 5).text == "P>=5"
    assert WaitCondition("b", "P", ">=", 512.5, "{1 mm}").text == "P>={1 mm}"


@pytest.mark.parametrize(
    ("text", "time"), {"0": 0.0, "5": 5.0, "1.5": 1.5, ".5": 0.5, "2.": 2.0, "86400": 86400.0}.items()
)
def test_a_time_is_in_seconds(text: str, time: float) -> None:
    assert seconds(text, Diagnostic) == time


@pytest.mark.parametrize("text", ["86400.1", "-1", "1e3", "soon", "", ".", "nan", "\u0661"])
def test_another_time_is_named(text: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        seconds(text, Diagnostic)
    assert str(caught.value) == f"no time {text}; valid: 0 to 86400 seconds"


# Waits

LATE = {
    "/wait stopped 1": "/wait stopped: press:a still runs after 1 s",
    "/wait ended 1": "/wait ended: press:a still runs after 1 s",
    "/wait idle 1": "/wait idle: press:a still runs after 1 s",
    "/wait @a V=0 1.5": "/wait V=0: press:a still reports 51200 after 1.5 s",
    '/wait "x" 0.5': '/wait "x": not printed within 0.5 s; seen nothing',
}


@pytest.mark.parametrize(("line", "says"), LATE.items())
async def test_a_wait_that_runs_out_says_what_still_runs_and_how_long_it_waited(shop, line, says):
    await shop.session.run("@a SL 51200")
    await asyncio.sleep(0.5)
    begun = shop.session.now()
    with pytest.raises(Timeout) as caught:
        await shop.session.run(line)
    limit = float(line.split()[-1])
    assert str(caught.value) == says
    assert limit <= shop.session.now() - begun < limit + 0.5


async def test_a_wait_names_itself_as_a_person_called_it(shop):
    await shop.session.run("@a SL 51200")
    with pytest.raises(Timeout, match=r"^MOVE: press:a still runs after 0\.5 s$"):
        await wait(shop.session, PERSON, 0.5, idle=False, drives=[shop.session.drive("press", "a")], said="MOVE")


async def test_a_wait_is_for_the_drives_that_got_a_line(shop):
    await shop.session.run("@b PR P")
    shop.device("press:a").execute("SL 51200", shop.floor.now())
    await shop.session.run("/wait stopped 1")
    await shop.session.run("@a PR P")
    with pytest.raises(Timeout, match="press:a still runs"):
        await shop.session.run("/wait stopped 1")


async def test_a_line_for_all_makes_a_wait_be_for_each(shop):
    await shop.session.run("@press:* MR 5")
    shop.device("press:b").execute("SL 51200", shop.floor.now())
    with pytest.raises(Timeout, match="press:b still runs"):
        await shop.session.run("/wait stopped 1")


async def test_a_program_that_waits_is_stopped_and_not_idle(shop):
    await shop.session.run("@b EX Ga")
    begun = shop.session.now()
    await shop.session.run("/wait stopped 3")
    assert shop.session.now() - begun < 1
    await shop.session.run("/wait idle 9")
    assert 3.5 < shop.session.now() - begun < 5


VALUES = {
    "/wait @a BY=2 1": "/wait BY=2: press:a still reports 0 after 1 s",
    "/wait @a MR=1": "a refused .PR MR.: error 35: this cannot be printed",
    "/wait @pmx:00 ID=1": "pmx:00: ID printed .*; a wait needs a whole number",
}


@pytest.mark.parametrize(("line", "says"), VALUES.items())
async def test_a_value_that_cannot_be_waited_for_is_named(shop, line, says):
    with pytest.raises((Diagnostic, DriveError), match=f"^{says}$"):
        await shop.session.run(line)


async def test_in_raw_mode_no_drive_is_asked_for_a_value(shop):
    await shop.session.run("/use press:a")
    await shop.session.run("/raw on")
    before = len(shop.written("press"))
    with pytest.raises(Diagnostic) as caught:
        await shop.session.run("/wait @press:a P=0 1")
    assert str(caught.value) == "press: is in raw mode, where no drive is asked; /raw off ends it"
    assert len(shop.written("press")) == before


async def test_program_mode_is_named_before_anything_is_asked(shop):
    await shop.session.run("@a PG 500")
    shop.events.clear()
    for line in ("/wait stopped 1", "/wait idle 1", "/wait @a P=0 1"):
        with pytest.raises(DriveError) as caught:
            await shop.session.run(line)
        assert str(caught.value) == "press:a is in program mode and would store the question; PG ends it"
    assert shop.written("press") == b""
    await shop.session.run("@a PG")


async def test_of_what_was_printed_the_last_three_lines_are_shown(shop):
    await shop.session.run('@b PR "1"')
    for number in "2345":
        await shop.session.run(f'@b PR "{number}"')
    with pytest.raises(Timeout, match='^/wait "x": not printed within 1 s; seen "3", "4", "5"$'):
        await shop.session.run('/wait "x" 1')


# Where drives are

STANDINGS = [
    (Standing("b", why="no answer"), "b not known (no answer)", None),
    (Standing("b", (Motion(5, 0),)), "b is at rest at 5", {"position": 5, "velocity": 0}),
    (Standing("b", (Motion(5, -7),)), "b moves at -7 a second at 5", {"position": 5, "velocity": -7}),
    (
        Standing("b", (Motion(5, 0),), places=(" (1 mm)",), quantities=((1.0, "mm"),)),
        "b is at rest at 5 (1 mm)",
        {"position": 5, "velocity": 0, "quantity": 1.0, "unit": "mm"},
    ),
    (
        Standing("c", (Motion(5, 0, "x"), Motion(6, 2, "y"))),
        "c x is at rest at 5 and y moves at 2 a second at 6",
        {"x": {"position": 5, "velocity": 0}, "y": {"position": 6, "velocity": 2}},
    ),
    (
        Standing("c", (Motion(5, 0, "x"),), places=(" (1 mm)",), quantities=(None,)),
        "c x is at rest at 5 (1 mm)",
        {"x": {"position": 5, "velocity": 0}},
    ),
]


@pytest.mark.parametrize(("standing", "text", "fact"), STANDINGS)
def test_where_a_drive_is_in_words_and_as_an_object(standing, text, fact):
    assert standing.text == text
    assert standing.fact == fact


def test_a_rest_that_is_not_confirmed_is_said_with_every_position():
    axes = (Motion(5, 0, "x"), Motion(6, 0, "y"))
    text = Standing("c", axes, unconfirmed=True, places=(" (1 mm)", "")).text
    assert text.startswith("c ") and text.endswith("; now 5 (1 mm) and 6") and "at rest at" not in text


async def test_drives_are_read_in_their_order_with_their_units(tmp_path):
    async with CellSession(tmp_path, *CELL, units={"a": "5 mm/turn"}) as shop:
        await shop.session.run("@press:a MR 51200")
        await shop.session.run("@b PG 500")
        every = [each for one in shop.session.buses.values() for each in one.drives.values()]
        await asyncio.sleep(3)
        found = await standings(shop.session, every, shop.session.units)
        assert [each.text for each in found] == [
            "press:a is at rest at 51200 (5 mm)",
            "press:b not known (it is in program mode)",
            "pmx:00 x is at rest at 0 and y is at rest at 0",
        ]
        assert [each.fact for each in found] == [
            {"position": 51200, "velocity": 0, "quantity": 5.0, "unit": "mm"},
            None,
            {"x": {"position": 0, "velocity": 0}, "y": {"position": 0, "velocity": 0}},
        ]
        plain = await standings(shop.session, every[:1])
        assert plain == (Standing("press:a", (Motion(51200, 0, program=False),)),)


async def test_a_lost_line_is_said_for_each_of_its_drives(shop):
    every = [each for one in shop.session.buses.values() for each in one.drives.values()]
    shop.world("/sim unplug press")
    await asyncio.sleep(3)
    found = await standings(shop.session, every)
    assert [each.text for each in found] == [
        "press:a not known (the connection is lost)",
        "press:b not known (the connection is lost)",
        "pmx:00 x is at rest at 0 and y is at rest at 0",
    ]


async def test_what_moves_or_runs_or_is_not_known_has_a_line_each(shop):
    assert await in_motion(shop.session) == []
    await shop.session.run("@a SL 51200")
    await shop.session.run("@b EX Ga")
    await asyncio.sleep(0.5)
    assert await in_motion(shop.session) == [
        "press:a moves at 51200 a second",
        "press:b runs a program, which may move it",
    ]
    await shop.session.run("@a SL 0")
    await asyncio.sleep(6)
    assert await in_motion(shop.session) == []
    await shop.session.run("@a SL 51200")
    shop.world("/sim unplug press")
    await asyncio.sleep(3)
    assert await in_motion(shop.session) == [
        "press:a is not known: started 3 s ago and not read since",
        "press:b is not known: last seen standing 3 s ago",
    ]
