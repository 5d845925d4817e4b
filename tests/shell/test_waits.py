"""Waits for a value of a drive, and for a text that a drive prints."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, DriveError
from multidrop.shell.line_syntax import each_names_one_drive
from multidrop.shell.session import Session
from multidrop.shell.waits import condition
from tests.support.cell_session import bus, party, pmx, session_on

pytestmark = pytest.mark.virtual

SWITCHED = "[bus.drive.world]\ninputs = [[0.0, 1, 1], [3.0, 1, 0], [4.0, 1, 1]]"
READY = "program_text = '''\nPG 100\nLB Ga\nH 2000\nPR \"ready: 7\"\nE\nPG\n'''"
CELL = bus("press", party("a", SWITCHED, CK=0, VM=512000), party("b", READY, CK=0), baud=0)
CELL += bus("pmx", pmx("00"), baud=0)


@pytest.fixture
async def session(tmp_path: Path) -> AsyncIterator[Session]:
    async with session_on(tmp_path, CELL) as made:
        yield made


@pytest.mark.parametrize(
    ("text", "target", "word", "sign", "value"),
    [
        ("I1=1", "", "I1", "=", 1),
        ("@b P >= 51200", "b", "P", ">=", 51200),
        ("@press:b P!=-3", "press:b", "P", "!=", -3),
    ],
)
def test_a_condition_is_a_word_of_a_drive_and_a_number(
    text: str, target: str, word: str, sign: str, value: int
) -> None:
    found = condition(text)
    assert found is not None
    assert (found.target, found.word, found.sign, found.value) == (target, word, sign, value)


@pytest.mark.parametrize("text", ["I1", "=1", "I1=x", "I1==", "I1=1.5", "PR I1=1", "I1 = 1 2", "@b=1"])
def test_another_text_is_no_condition(text: str) -> None:
    assert condition(text) is None


def test_a_wait_for_a_value_opens_no_more_than_its_drives() -> None:
    assert each_names_one_drive(["@b MR 5", "/wait @b P=5"])


async def test_a_value_ends_the_wait(session: Session) -> None:
    before = session.now()
    await session.run("@a MR 512000")
    await session.run("/wait @a P>=100000 5")
    assert 0 < session.now() - before < 3
    await session.run("/wait V=0")
    await session.run("/wait P=512000 0")


async def test_a_value_that_does_not_come_is_told_with_the_last_one(session: Session) -> None:
    before = session.now()
    with pytest.raises(DriveError, match="/wait P=5: press:a still reports 0 after 2 s"):
        await session.run("/wait P=5 2")
    assert 2 <= session.now() - before < 2.2


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("/wait P=x", "no condition P=x; valid: I1=1"),
        ("/wait P=5 soon", "no time soon"),
        ("/wait ready", "usage: /wait"),
        ('/wait "ready', "usage: /wait|quotation mark"),
        ("/wait", "usage: /wait"),
        ("/wait @pmx:00 X=5 0", "X has no value to wait for|still reports 0"),
    ],
)
async def test_a_wrong_wait_is_told(session: Session, line: str, says: str) -> None:
    with pytest.raises((Diagnostic, DriveError), match=says):
        await session.run(line)


async def test_a_drive_that_refuses_the_question_ends_the_wait(session: Session) -> None:
    with pytest.raises((Diagnostic, DriveError), match="XQ"):
        await session.run("/wait XQ=1 5")


async def test_a_drive_in_program_mode_is_not_asked(session: Session) -> None:
    await session.run("@a PG 500")
    with pytest.raises(DriveError, match="in program mode and would store the question"):
        await session.run("/wait @a P=0")
    await session.run("@a PG")


async def test_a_text_ends_the_wait_also_where_it_came_before(session: Session) -> None:
    before = session.now()
    await session.run("@b EX Ga")
    await session.run('/wait "ready" 10')
    assert 1.9 < session.now() - before < 2.5
    await session.run("/wait 'ready: 7' 0")


async def test_a_text_from_before_the_last_line_does_not_count(session: Session) -> None:
    await session.run('@b PR "ready"')
    await session.run('/wait "ready" 0')
    await session.run("@b PR P")
    with pytest.raises(DriveError, match='/wait "ready": not printed within 1 s; seen "ready", "0"'):
        await session.run('/wait "ready" 1')


async def test_a_wait_for_a_value_is_recorded_with_its_drive(session: Session) -> None:
    await session.run("/record m")
    for line in ("/wait P=0", "/wait @press:b P=0", "/wait stopped", "@b PR P"):
        await session.run(line)
    await session.run("/record stop")
    macro = session.macros.load("m")
    assert macro.lines == ("/wait @press:a P=0", "/wait @press:b P=0", "/wait stopped", "@press:b PR P")
