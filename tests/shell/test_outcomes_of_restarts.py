"""A power-up sets positions to 0, which is where a homing or a move to 0 ends: how a restart shows all the same."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.shell.session import Session
from tests.shell.test_outcomes import noted, ran, value
from tests.shell.test_outcomes_without_target import SLOW, typed
from tests.support.cell_session import bus, drive, party, pmx, session_on
from tests.support.outcomes import asked, failed, sent

pytestmark = pytest.mark.virtual


def cycle(name: str, off: float = 0.1) -> tuple[str, ...]:
    """A loss of power that no reading meets."""
    return ("/sleep 0.3", f"/sim power {name} off", f"/sleep {off}", f"/sim power {name} on", "/sleep 5")


async def shown(session: Session, *lines: str, sign: str) -> None:
    """Run lines whose motion a restart ends."""
    failure = await failed(session, *lines)
    assert (failure.outcome, failure.reason) == ("power", f"it was restarted ({sign})")
    await reported(session, sign)


async def reported(session: Session, sign: str) -> None:
    """The restart is reported once."""
    await asyncio.sleep(5)
    told = [text for text in noted(session) if "was restarted" in text and "not referenced" in text]
    assert len(told) == 1 and sign in told[0]


# MCode on a party line, which prints no sign-on. The first question after a power-up gets no reply.


HOME = "[bus.drive.world]\nhome = [-90000, -80000]"


@pytest.mark.parametrize("em", [0, 1, 2])
@pytest.mark.parametrize("line", ["HM 1", "MA 0", "SL -3000", "AS=3"])
async def test_a_velocity_that_was_not_saved_shows_a_restart(tmp_path: Path, em: int, line: str) -> None:
    async with session_on(tmp_path, bus("press", party("a", HOME, EM=em), baud=0), agreed=True) as session:
        await typed(session, "IS=3,1,0", "TQ=50", "TS=200000", "S", "VM=20000", "MA 30000", "/wait stopped")
        lines = (line, *cycle("a"), "/wait ended 20", "/print {outcome}")
        assert await ran(session, tmp_path, *lines) == ["power"]
        await reported(session, "VM 20000 before, 768000 now")


async def test_a_homing_that_ends_at_0_with_the_same_settings_is_no_restart(tmp_path: Path) -> None:
    home = HOME.replace("-80000", "-1")
    async with session_on(tmp_path, bus("press", party("a", home, **SLOW), baud=0)) as session:
        await typed(session, "IS=3,1,0", "MA 3000", "/wait stopped")
        await sent(session, "HM 1", "/wait stopped", "R1=777")
        assert await value(session, "P") == 0 and await value(session, "R1") == 777


async def test_a_setting_that_the_script_changes_on_the_way_is_no_restart(tmp_path: Path) -> None:
    async with session_on(tmp_path, bus("press", party("a", **SLOW), baud=0), agreed=True) as session:
        await typed(session, "MA 30000", "/wait stopped")
        await sent(session, "MA 0", "VM=30000", "/wait stopped", "R1=777")
        assert await value(session, "R1") == 777


# Controllers


HX = "[bus.drive.world.x]\nhome = [-9000, -8000]\nlimit_minus = -9500"


@pytest.mark.parametrize("line", ["HX-", "HLX-", "LX-", "X0", "JX-"])
async def test_a_speed_that_no_flash_keeps_shows_a_restart_of_a_controller(tmp_path: Path, line: str) -> None:
    async with session_on(tmp_path, bus("stage", pmx("00", HX), pmx("01"), baud=0), agreed=True) as session:
        await typed(session, "/use 00", "HSPD=2000", "ABS", "STORE", "X3000", "/wait stopped")
        await shown(session, line, *cycle("00"), "/wait stopped", "V1=777", sign="HSPD 2000 before, 1000 now")
        assert await asked(session, "V1") == 0


# Modules


SEARCH = ("SAP 193, 0, 1", "SAP 194, 0, 2000", "SAP 195, 0, 200")


@pytest.mark.parametrize("line", ["RFS START, 0", "MVP ABS, 0, 0", "MVP REL, 0, 90000", "ROR 0, 500"])
async def test_a_tick_timer_that_began_again_shows_a_restart_of_a_module(tmp_path: Path, line: str) -> None:
    async with session_on(tmp_path, bus("line", drive("TMCM-1241", "1"), baud=0)) as session:
        await typed(session, *SEARCH, "SAP 4, 0, 20000", "MVP ABS, 0, 40000", "/wait stopped", "/sleep 60")
        await shown(session, line, *cycle("1"), "/wait stopped", "SGP 0, 2, 777", sign="its tick timer began again")
        assert await asked(session, "GGP 0, 2") == 0


async def test_a_tick_timer_that_wraps_round_or_is_set_is_no_restart(tmp_path: Path) -> None:
    async with session_on(tmp_path, bus("line", drive("TMCM-1241", "1"), baud=0)) as session:
        await typed(session, "SAP 4, 0, 20000", "SGP 132, 0, 2147483000")
        await sent(session, "MVP ABS, 0, 40000", "/wait stopped", "SGP 0, 2, 777")
        assert await asked(session, "GGP 132, 0") < 0
        await sent(session, "MVP ABS, 0, 0", "SGP 132, 0, 0", "/wait stopped", "SGP 0, 2, 778")
        assert await asked(session, "GGP 0, 2") == 778


# A restart that only a missing reply shows


@pytest.mark.parametrize(("line", "outcome"), [("HM 1", "unknown"), ("MA 0", "unknown"), ("SL -3000", "stopped")])
async def test_a_missing_reply_and_position_0_are_no_success(tmp_path: Path, line: str, outcome: str) -> None:
    async with session_on(tmp_path, bus("press", party("a", HOME, **SLOW), baud=0)) as session:
        await typed(session, "IS=3,1,0", "S", "MA 30000", "/wait stopped")
        loop = asyncio.get_running_loop()
        cell = next(iter(session.cells.values()))
        loop.call_later(0.3, cell.command, "/sim power a off")
        loop.call_later(0.9, cell.command, "/sim power a on")
        assert await ran(session, tmp_path, line, "/wait ended 20", "/print {outcome}") == [outcome]


async def test_a_missing_reply_alone_is_no_failure(tmp_path: Path) -> None:
    from multidrop.simulator.cell.spec import Faults
    from tests.support.faults import disturb

    async with session_on(tmp_path, bus("press", party("a", HOME, **SLOW), baud=0)) as session:
        await typed(session, "IS=3,1,0", "P=5", "/wait stopped")
        loop, wire = asyncio.get_running_loop(), next(iter(session.cells.values())).floor.wires["press"]
        loop.call_later(0.5, disturb, wire, Faults(delay=(1.5, 1.5)))
        loop.call_later(0.7, disturb, wire)
        assert await ran(session, tmp_path, "HM 1", "/wait ended 20", "/print {outcome}") == ["reached"]
