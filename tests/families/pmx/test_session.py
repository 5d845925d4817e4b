"""PMX controllers in a session: limits in words, help on replies, and a gateway that takes no device number."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, MotionFailed
from multidrop.contract.desk import Desk
from multidrop.shell.events import Output, Printed
from multidrop.shell.prompt.complete import complete, hint
from tests.families.pmx import test_contract
from tests.support.cell_session import bus, drive, pmx, session_on
from tests.support.until import PATIENCE

pytestmark = pytest.mark.virtual

STAGES = (pmx(name, "[bus.drive.world.y]", "limit_minus = -100") for name in ("00", "01", "02"))
CELL = bus("stages", *STAGES) + bus("press", drive("LMDCM"), baud=0)


@pytest.fixture
async def session(tmp_path):
    async with session_on(tmp_path, CELL) as made:
        yield made


async def say(session, *lines):
    """What lines printed or put out."""
    session.events.clear()
    async with asyncio.timeout(PATIENCE):
        for line in lines:
            await session.run(line)
    return [event.text for event in session.events if isinstance(event, Printed | Output)]


async def test_limits_are_told_in_words(session):
    with pytest.raises(MotionFailed, match="00 Y stopped at -100: minus limit; CLRY clears the error"):
        await say(session, "JY-", "/wait stopped")
    lines = await say(session, "/status")
    assert lines[1] == "Y: at rest, minus limit error, minus limit switch on; StepNLoop off"
    await say(session, "CLRY")
    assert "error" not in (await say(session, "/status"))[1]
    assert lines[4:] == ["inputs on: none", "outputs on: none", "motor drivers on: 1, 2"]
    await say(session, "DO=5")
    assert "outputs on: 1, 3" in await say(session, "/status")


async def test_help_takes_what_a_controller_answers_and_has_no_numbers(session):
    assert await say(session, "/help ?Moving") == [
        "?Moving: the motor is moving",
        "  do         wait until it is at rest, or STOP or ABORT it",
    ]
    assert (await say(session, '/help "?Index out of Range"'))[0].startswith("?Index out of Range: ")
    with pytest.raises(Diagnostic, match="no error 35 on a PMX-2ED; it replies in words"):
        await session.run("/help 35")


async def test_help_and_completion_are_in_the_selected_drives_words(session):
    with pytest.raises(Diagnostic, match="no command VM; multidrop help VM --dialect mcode explains it"):
        await session.run("/help VM")
    assert [each.text for each in complete(session, "HS")] == ["HSPD", "HSPDX", "HSPDY"]
    assert hint(session, "X100").startswith("X1000") and hint(session, "@press: MR 5").startswith("MR")
    with pytest.raises(Diagnostic, match="HSPD"):
        await session.run("/help HSPDD")


@pytest.mark.parametrize("query", ["", "&address=none", "&drives=00"])
def test_a_gateway_takes_lines_with_and_without_a_number(query, tmp_path, monkeypatch):
    desk = Desk(replace(test_contract.TestPmx.sample, addresses=("00",)), tmp_path, monkeypatch)
    done = desk.command("send", f"tcp://line?dialect=pmx{query}", "ID", "V5=7", "V5")
    assert done == (0, "Performax-2ED-SA\n7\n", "")
