"""A session with a Modbus device that is no Lexium drive: a person's lines, the stop key, a loss, what polls."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic, Inexpressible
from multidrop.drives.stopping import Fate
from multidrop.drives.telemetry import DriveValue
from multidrop.shell.channel import Front
from multidrop.shell.configuration import Settings
from multidrop.shell.events import FAILURES, By, Notified
from multidrop.shell.session import Session
from tests.support.automated import automated
from tests.support.foreign_device import LEXIUM, Device, device
from tests.support.until import until

MA, P, END, SL, EF = "10 0043", "03 0057", "41 2020", "10 0078", "03 001f"
QUIET = 0.3
"""Seconds in which nothing may come: polls and repeats of stops have shorter periods."""


@pytest.fixture
def plc() -> Iterator[Device]:
    with device() as server:
        yield server


async def _yes(question: str) -> bool:
    return True


@pytest.fixture
async def session(tmp_path: Path, plc: Device) -> AsyncIterator[Session]:
    """A session at which a person sits."""
    session = Session(Settings(folder=tmp_path, state=tmp_path / "state"), reconnect=True)
    session.front = Front(ask=_yes)
    session.said = []  # type: ignore[attr-defined]
    session.subscribe(lambda event: session.said.append(event.text), Notified)  # type: ignore[attr-defined]
    await session.open(plc.url, "plc")
    try:
        yield session
    finally:
        await session.close()


def said(session: Any, text: str) -> list[str]:
    return [each for each in session.said if text in each]


async def test_a_person_writes_without_a_question_after_the_warning(session: Session, plc: Device) -> None:
    assert len(said(session, "did not identify itself as a Lexium drive")) == 1
    for line in ("MA 100", "PR P", "/register 0x57 =5"):
        await session.run(line)
    await asyncio.sleep(QUIET)
    assert plc.received == [MA, P, "10 0057"]


@pytest.mark.parametrize("by", [By.MACRO, By.SCRIPT])
@pytest.mark.parametrize("line", ["MA 100", "SL 0", "/register 0x99 =5", "/coil 7 1"])
async def test_automation_is_refused_also_beside_a_person(session: Session, plc: Device, by: By, line: str) -> None:
    with pytest.raises(Diagnostic, match="did not identify itself.*cannot ask, nothing was sent"):
        await session.run(line, replace(session.origin, by=by))
    assert not plc.received


async def test_what_is_refused_names_the_device_the_line_and_why(session: Session) -> None:
    for line, what in (("MA 100", "'MA 100' writes"), ("/coil 7 1", "'/coil 7 1' writes")):
        with pytest.raises(Diagnostic) as caught:
            await session.run(line, replace(session.origin, by=By.SCRIPT))
        assert str(caught.value).startswith(f"plc: {what}, and ")


async def test_bytes_of_automation_on_a_raw_line_are_refused(session: Session, plc: Device) -> None:
    await session.run("/raw on")
    with pytest.raises(Diagnostic, match="did not identify itself"):
        await session.run("/bytes 00", replace(session.origin, by=By.SCRIPT))
    assert not plc.received


async def test_nothing_is_polled_but_what_a_person_named(session: Session, plc: Device) -> None:
    telemetry = session.buses["plc"].telemetry
    polls: list[Any] = [telemetry.subscribe([""], 0.001), telemetry.watch([""], 0.1)]
    await session.run("MA 100")
    await asyncio.sleep(QUIET)
    assert plc.received == [MA]
    polls.append(telemetry.read([DriveValue("", "P")], 0.01))
    await until(lambda: plc.received.count(P) > 3)
    for each in polls:
        each.close()
    assert set(plc.received) == {MA, P}


async def test_the_stop_key_writes_the_stop_and_reads_nothing(session: Session, plc: Device) -> None:
    await session.run("MA 100")
    plc.heard.clear()
    session.stop_ahead()
    session.stop("Ctrl+X")
    (halt,) = [session.buses["plc"].last_stop]
    await session.buses["plc"].stopped()
    await asyncio.sleep(QUIET)
    assert set(plc.received) == {END, SL} and plc.received[:2] == [END, SL]
    assert halt is not None and halt.fate(session.buses["plc"].drives[""]) is Fate.NOT_KNOWN and not halt.vain
    assert not said(session, "STILL") and not said(session, "cut the power")


async def test_the_early_end_of_a_script_that_was_agreed_to_stops_nothing_and_says_so(
    session: Session, plc: Device
) -> None:
    session.questions.agreed = True
    with pytest.raises(ZeroDivisionError):
        async with automated(session, "script x"):
            await session.run("MA 100", replace(session.origin, by=By.SCRIPT))
            raise ZeroDivisionError
    await asyncio.sleep(QUIET)
    assert plc.received == [MA]
    assert said(session, "plc: no stop was sent, as this device did not identify itself as a Lexium drive")


async def test_an_interruption_stops_nothing(session: Session, plc: Device) -> None:
    session.questions.agreed = True
    async with automated(session, "script x"):
        await session.run("MA 100", replace(session.origin, by=By.SCRIPT))
        session.interrupt()
    await asyncio.sleep(QUIET)
    assert plc.received == [MA] and len(said(session, "no stop was sent")) == 1


async def test_a_write_that_a_loss_cut_off_is_followed_by_no_stop(session: Session, plc: Device) -> None:
    plc.hang_up_on = (0x10,)
    with pytest.raises(FAILURES):
        await session.run("MA 100")
    await until(lambda: session.buses["plc"].lost is None and not session.reconnections.trying)
    await asyncio.sleep(QUIET)
    assert plc.received == [MA] and session.buses["plc"].drives[""].state.stranger


async def test_a_stop_of_a_person_while_the_line_is_lost_is_sent_first(session: Session, plc: Device) -> None:
    plc.hang_up_on = (0x10,)
    with pytest.raises(FAILURES):
        await session.run("MA 100")
    session.stop("Ctrl+X")
    plc.heard.clear()
    plc.hang_up_on = ()
    await until(lambda: session.buses["plc"].lost is None and not session.reconnections.trying)
    await until(lambda: SL in plc.received)
    assert plc.received[0] == END and set(plc.received) == {END, SL}


async def test_device_makes_a_drive_of_it_once_it_says_so(session: Session, plc: Device) -> None:
    plc.identity = LEXIUM
    await session.run("/device")
    assert said(session, "identified itself as LMDCE now")
    with pytest.raises(FAILURES):  # its error flag reads as 7
        await session.run("MA 100")
    assert plc.received[0] == EF and MA in plc.received  # what is set from before is read first
    plc.identity = None
    with pytest.raises(FAILURES):
        await session.run("/device")
    assert not session.buses["plc"].drives[""].state.stranger  # a refusal says nothing of what it is


async def test_its_motion_is_not_asked_at_the_end(session: Session, plc: Device) -> None:
    assert not await session.in_motion()
    await session.run("MA 100")
    assert await session.in_motion() == ["plc is not known: started 0 s ago and not read since"]
    with pytest.raises(Inexpressible, match="plc: this device did not identify itself as a Lexium drive"):
        await session.run("/wait stopped")
    assert plc.received == [MA]
