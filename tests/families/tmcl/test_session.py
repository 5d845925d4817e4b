"""TMCL modules in a session: new addresses, download mode and the stop, the reply to a poll that was cut off."""

from __future__ import annotations

import asyncio
import itertools

import pytest

from multidrop.base.errors import DriveError, NoAnswer
from multidrop.drives.events import Unsolicited
from multidrop.drives.stop_forms import stop_forms
from multidrop.families.tmcl.manual import instructions
from multidrop.shell.events import Notified, OnBus, Output, Printed
from multidrop.shell.prompt.complete import hint
from tests.support.cell_session import bus, drive, session_on
from tests.support.until import PATIENCE

pytestmark = pytest.mark.virtual

CELL = bus("slide", drive("TMCM"), drive("TMCM", "7", G75=2)) + bus("press", drive("LMDCM"), baud=0)


@pytest.fixture
async def session(tmp_path):
    async with session_on(tmp_path, CELL, agreed=True) as made:
        yield made


async def say(session, *lines):
    """What lines printed or put out."""
    session.events.clear()
    async with asyncio.timeout(PATIENCE):
        for line in lines:
            await session.run(line)
    return [event.text for event in session.events if isinstance(event, Printed | Output)]


async def test_help_and_completion_are_those_of_the_module(session):
    await say(session, "@1 MST 0")
    assert (await say(session, "/help 4"))[0].startswith("status 4: invalid value")
    for word, row in instructions.WORDS.items():
        assert (await say(session, f"/help {word}"))[0] == f"{word}: {row.title}"
    assert "maximum positioning velocity" in hint(session, "SAP 4")


async def test_a_module_that_does_not_answer_delays_no_other_modules_stop(session):
    with pytest.raises(NoAnswer):
        await say(session, "@slide:9 MST 0")
    forms = stop_forms(session.buses["slide"].roster)
    at_once = list(itertools.takewhile(lambda piece: piece.quiet < 0.1, forms.repeats))
    assert {forms.immediate[0], *(piece.data[0] for piece in at_once)} == {1, 7, 9}
    assert len(forms.immediate) == 9


async def test_a_module_is_followed_to_its_new_address_and_stopped_there(session):
    assert await say(session, "@slide:1 SGP 66, 0, 5", "@5 GGP 66, 0") == ["5"]
    forms = stop_forms(session.buses["slide"].roster)
    assert {forms.immediate[0], *(piece.data[0] for piece in forms.repeats)} == {5, 7}


async def test_a_user_variable_with_the_number_of_the_address_changes_no_address(session):
    assert await say(session, "@slide:1 SGP 66, 2, 5", "@slide:1 GGP 66, 2", "@1 GGP 66, 0") == ["5", "1"]
    assert session.buses["slide"].drives["1"].address == "1"


def module(session):
    placed = [each for floor in session.cells.values() for each in floor.floor.drives]
    return next(each.device for each in placed if (each.bus, each.spec.name) == ("slide", "1"))


async def confirmed(session):
    async with asyncio.timeout(PATIENCE):
        await session.buses["slide"].stopped()
    await asyncio.sleep(3.0)
    return [event.text for event in session.events if isinstance(event, Notified)]


async def test_a_stop_reaches_a_module_that_is_in_download_mode_and_moves(session):
    await say(session, "@slide:1 ROR 0, 5000", "132 0, 0, 0", "MVP ABS, 0, 5")
    assert session.buses["slide"].drives["1"].programming
    session.stop("Ctrl+X")
    told = await confirmed(session)
    assert len(module(session).program.memory) == 1, told
    assert not module(session).program.storing and any("1: stopped, velocity 0" in text for text in told)
    assert await say(session, "@slide:1 GAP 3, 0") == ["0"]


async def test_a_module_that_stores_the_stop_gets_the_end_of_its_download_and_the_whole_stop_again(session):
    await say(session, "@slide:1 ROR 0, 5000")
    module(session).program.download(0)
    before = session.now()
    session.stop("Ctrl+X")
    while module(session).motors[0].parameters[2] and session.now() < before + 5:
        await asyncio.sleep(0.01)
    assert session.now() - before < 0.6
    told = await confirmed(session)
    assert any("1: it stored the stop" in text for text in told)
    assert any("1: stopped, velocity 0" in text for text in told) and not module(session).program.storing


async def test_two_modules_that_store_the_stop_both_get_the_end_of_their_download_and_the_whole_stop(session):
    await say(session, "@slide:1 ROR 0, 5000", "@slide:7 ROR 0, 5000")
    floors = [each for floor in session.cells.values() for each in floor.floor.drives]
    both = list({each.spec.name: each.device for each in floors if each.bus == "slide"}.values())
    for device in both:
        device.program.download(0)
    session.stop("Ctrl+X")
    told = await confirmed(session)
    assert [name for name in "17" if any(f"{name}: stopped, velocity 0" in text for text in told)] == ["1", "7"], told
    assert not any(device.program.storing or device.motors[0].parameters[2] for device in both)
    assert [[call.command for call in device.program.memory] for device in both] == [[3], [3]]


async def test_nothing_but_the_lines_of_a_download_goes_to_its_module(session):
    bus = session.buses["slide"]
    polling = bus.telemetry.subscribe(("1", "7"), 0.05)
    await say(session, "@slide:1 132 0, 0, 0", "MST 0")
    await asyncio.sleep(1.0)
    assert [call.command for call in module(session).program.memory] == [3]
    with pytest.raises(DriveError, match="program mode"):
        await say(session, "/wait stopped 5")
    assert await say(session, "@slide:7 GAP 3, 0") == ["0"]
    polling.close()
    await say(session, "@slide:1 133 0, 0, 0")
    assert not bus.drives["1"].programming and await say(session, "@slide:1 GAP 3, 0") == ["0"]


@pytest.mark.parametrize("after", [pytest.param(n, marks=[pytest.mark.nightly] * (n % 4 > 0)) for n in range(0, 40, 3)])
async def test_the_reply_to_a_poll_that_a_stop_cuts_off_is_no_line(session, after):
    polled = session.buses["slide"].telemetry.subscribe(["1", "7"], 0.001)
    await asyncio.sleep(0.5 + after / 1000)
    session.stop("Ctrl+X")
    await confirmed(session)
    polled.close()
    shown = [
        each.event.lines for each in session.events if isinstance(each, OnBus) and isinstance(each.event, Unsolicited)
    ]
    assert shown == []
