"""Controllers of the other family in a session: macros, the stop of a whole line, help and completion."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, MotionFailed, Refused, Stopped
from multidrop.drives.events import Sample
from multidrop.shell.events import By, Notified, OnBus, Output, Printed
from multidrop.shell.prompt.complete import complete, hint
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


def narrated(session):
    return [event.text for event in session.events if isinstance(event, Notified)]


async def test_every_number_on_the_line_is_found(session):
    assert list(session.buses["stages"].drives) == ["00", "01", "02"]
    assert await say(session, "ID", "@02 VER") == ["Performax-2ED-SA", "V128BL"]


async def test_a_stop_stops_both_axes_of_every_controller(session):
    await say(session, *(f"@{n} J{axis}" for n in ("00", "01", "02") for axis in ("X+", "Y+")))
    session.events.clear()
    session.stop()
    async with asyncio.timeout(PATIENCE):
        await session.buses["stages"].stopped()
    told = [text for text in narrated(session) if "stages: 0" in text and "stopped, velocity 0" in text]
    assert len(told) == 3 and not [text for text in narrated(session) if "not known" in text or "STILL" in text]
    moving = [await say(session, f"@{n} MST{axis}") for n in ("00", "01", "02") for axis in "XY"]
    assert moving == [["0"]] * 6
    with pytest.raises(Stopped):
        await session.run("X100", replace(session.origin, by=By.MACRO))


async def test_a_program_that_moves_is_stopped_for_good(session):
    lines = ["PRG 0", "WHILE 1=1", "X1000", "WAITX", "X0", "WAITX", "ENDWHILE", "END"]
    from multidrop.families.pmx.manual import program_file

    drive = session.buses["stages"].drives["00"]
    await drive.download(program_file.read("\n".join(lines), "shuttle.prg"))
    assert await say(session, "SR0=1", "/sleep 0.2", "SASTAT0") == ["1"]
    session.stop()
    async with asyncio.timeout(PATIENCE):
        await session.buses["stages"].stopped()
    assert await say(session, "SASTAT0", "MSTX", "/sleep 0.3", "MSTX") == ["0", "0", "0"]


async def test_a_macro_is_what_was_typed(session):
    await say(session, "/record home", "HSPDX=2000", "X300", "/wait stopped", "/record stop", "PX=0")
    assert [step.line for step in session.macros.load("home").steps] == [
        "@stages:00 HSPDX=2000", "@stages:00 X300", "/wait stopped"]  # fmt: skip
    assert await say(session, "/play home", "PX") == ["300"]


async def test_samples_of_both_axes_reach_whoever_looks(session):
    await say(session, "JX+")
    subscription = session.buses["stages"].telemetry.subscribe(["00"], 0.05)
    session.events.clear()
    await asyncio.sleep(0.5)
    subscription.close()
    seen = [e.event for e in session.events if isinstance(e, OnBus) and isinstance(e.event, Sample)]
    assert {sample.axis for sample in seen} == {"x", "y"}
    assert any(sample.velocity > 0 for sample in seen if sample.axis == "x")


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


async def test_refusals_name_the_controller(session):
    with pytest.raises(Refused, match="^01 refused 'mstx': .mstx: .*capitals only: MSTX"):
        await session.run("@01 mstx")


async def test_help_and_completion_are_in_the_selected_drives_words(session):
    assert (await say(session, "/help HSPD"))[0].startswith("HSPD: high speed")
    with pytest.raises(Diagnostic, match="no command VM; multidrop help VM --dialect mcode explains it"):
        await session.run("/help VM")
    assert [each.text for each in complete(session, "HS")] == ["HSPD", "HSPDX", "HSPDY"]
    assert hint(session, "X100").startswith("X1000") and hint(session, "@press: MR 5").startswith("MR")
    with pytest.raises(Diagnostic, match="HSPD"):
        await session.run("/help HSPDD")
