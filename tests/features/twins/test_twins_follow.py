"""What a twin cannot know beforehand: homing, limit switches, pushes. It takes the position then, and says so once."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.shell.events import Agreed, Diverged, Predicted
from tests.support.cell_session import ETHERNET, CellSession, bus, drive, party, pmx
from tests.support.twin_cell import encoder, of, run

pytestmark = pytest.mark.virtual

TMCL = 'personality = "TMCM"\nname = "1"'
WORLD = "[bus.drive.world]\nhome = -9000\nlimit_plus = 12000\nlimit_minus = -15000"
PMX = ("HSPD=20000", "LSPD=1000", "ACC=300", "EO=3")
SWITCHES = ("IS=1,1,0", "IS=2,2,0", "IS=3,3,0")
SLOW = ("VM=20000", "VI=10000")


def taken(cell: CellSession) -> list[str]:
    """What was told of twins that took a position."""
    return [each for each in cell.told() if "its twin takes its position" in each]


def agrees(cell: CellSession) -> None:
    """Each drive is where its twin is, and neither moves."""
    last = {(each.address, each.axis): each for each in of(cell, Predicted)}
    assert last and {(each.difference, each.velocity) for each in last.values()} == {(0, 0)}


TMCL_SEARCH = ["SAP 4, 0, 20000", "SAP 194, 0, 20000", "SAP 195, 0, 4000"]
HOMINGS = {
    "MCode": (party("a", WORLD), [*SWITCHES, *SLOW], "HM 1", ""),
    "MCode to its index": (encoder(), ["MR 300", "/wait stopped"], "HI 1", ""),
    "MDrivePlus": (drive("MDI", "a", WORLD, party=True), ["S1=1,0", *SLOW], "HM 1", ""),
    "Modbus": (f"{ETHERNET}\n{WORLD}", [*SWITCHES, *SLOW], "HM 1", ""),
    "PMX to home": (pmx("00", WORLD), PMX, "HX-", "X4000"),
    "PMX to a limit": (pmx("00", WORLD), [*PMX, "LCA=500"], "LX+", "X-4000"),
    "PMX to home twice": (pmx("00", WORLD), [*PMX, "HCA=500"], "HLX-", "X4000"),
    "PMX to its index": (pmx("00", f"{WORLD}\nindex = 77"), PMX, "ZX+", ""),
    "TMCL mode 1": (f"{TMCL}\n{WORLD}", ["SAP 193, 0, 1", *TMCL_SEARCH], "RFS START, 0", "MVP ABS, 0, 5000"),
    "TMCL mode 3": (f"{TMCL}\n{WORLD}", ["SAP 193, 0, 3", *TMCL_SEARCH], "RFS START, 0", "MVP ABS, 0, 5000"),
    "TMCL mode 5": (f"{TMCL}\n{WORLD}", ["SAP 193, 0, 5", *TMCL_SEARCH], "RFS START, 0", "MVP ABS, 0, 4000"),
    "TMCL mode 8": (f"{TMCL}\n{WORLD}", ["SAP 193, 0, 8", *TMCL_SEARCH], "RFS START, 0", "MVP REL, 0, 900"),
}


SELDOM = {"MCode to its index", "Modbus", "PMX to a limit", "PMX to its index", "TMCL mode 3", "TMCL mode 5"}


@pytest.mark.parametrize(
    "case", [pytest.param(each, marks=[pytest.mark.nightly] * (each in SELDOM)) for each in HOMINGS]
)
async def test_homing_is_no_alarm_and_the_drive_is_followed_after_it(tmp_path: Path, case: str) -> None:
    real, settings, homing, move = HOMINGS[case]
    async with CellSession(tmp_path, bus("b", real)) as cell:
        await run(cell, *settings, "/twin on", homing, "/sleep 6")
        assert of(cell, Diverged) == [] and len(taken(cell)) <= 1
        agrees(cell)
        if move:
            assert len(taken(cell)) == 1 and "after homing" in taken(cell)[0]
            cell.events.clear()
            await run(cell, move, "/sleep 1.5", homing, "/sleep 6")
            assert of(cell, Diverged) == [], "where the switch is was learned"
            agrees(cell)


LIMITS = {
    "MCode": (party("a", WORLD), [*SWITCHES, *SLOW], "SL 20000", "MA 0"),
    "MDrivePlus": (drive("MDI", "a", WORLD, party=True), ["S2=2,0", *SLOW], "SL 20000", "MA 0"),
    "Modbus": (f"{ETHERNET}\n{WORLD}", [*SWITCHES, *SLOW], "SL 20000", "MA 0"),
    "PMX": (pmx("00", WORLD), PMX, "JX+", "X0"),
    "TMCL": (f"{TMCL}\n{WORLD}", [], "ROR 0, 20000", "MVP ABS, 0, 0"),
    "TMCL, a move that ends beyond it": (f"{TMCL}\n{WORLD}", ["SAP 4, 0, 20000"], "MVP ABS, 0, 14000", "MVP ABS, 0, 0"),
}


@pytest.mark.parametrize(
    "case", [pytest.param(each, marks=[pytest.mark.nightly] * (each in SELDOM)) for each in LIMITS]
)
async def test_a_limit_switch_is_learned_where_it_is_met(tmp_path: Path, case: str) -> None:
    real, settings, there, back = LIMITS[case]
    async with CellSession(tmp_path, bus("b", real)) as cell:
        await run(cell, *settings, "/twin on", there, "/sleep 4")
        assert of(cell, Diverged) == []
        assert [each.rpartition(",")[0].partition(": ")[2] for each in taken(cell)] == (
            ["its twin takes its position after a limit (limit+)"] if case[:4] in ("PMX", "TMCL") else []
        )
        agrees(cell)
        cell.events.clear()
        if case == "PMX":
            await run(cell, "CLRX")
        await run(cell, back, "/sleep 4")
        agrees(cell)
        await run(cell, there, "/sleep 4")
        assert of(cell, Diverged) == [] and taken(cell) == [], "the twin knows the limit now"
        agrees(cell)


PUSHES = {
    "MCode": (encoder(), "push a 20000"),
    "Modbus": (drive("LMDCE", "a", EE=1, VM=8000, A=40000, D=40000), "push a 20000"),
}


@pytest.mark.parametrize("case", PUSHES)
async def test_a_push_by_hand_is_one_warning_and_the_twin_takes_the_position(tmp_path: Path, case: str) -> None:
    real, push = PUSHES[case]
    async with CellSession(tmp_path, bus("b", real)) as cell:
        await run(cell, "/twin on", "/sleep 1")
        cell.world(push)
        await asyncio.sleep(3)
        (diverged,) = of(cell, Diverged)
        assert "a push by hand" in diverged.causes
        (agreed,) = of(cell, Agreed)
        assert agreed.after == "a push by hand" and len(cell.warned()) == 1 and len(taken(cell)) == 1
        cell.events.clear()
        await run(cell, "MR 800", "/sleep 4")
        assert of(cell, Diverged) == []
        agrees(cell)


async def test_a_module_counts_from_the_target_of_a_move_that_was_broken_off(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("b", TMCL)) as cell:
        await run(cell, "MVP REL, 0, 90000", "/sleep 1", "MST 0", "/sleep 2", "/twin on", "MVP REL, 0, 900", "/sleep 4")
        assert of(cell, Diverged) == [] and of(cell, Predicted)[-1].position == 90900
        agrees(cell)
