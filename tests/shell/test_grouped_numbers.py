"""A number in groups of three digits is refused in every family, and nothing is sent; lines with fields are not."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState
from multidrop.families.lexium.host.modbus.operations import ModbusOperations
from multidrop.families.lexium.manual import program_checker, program_file
from multidrop.families.lexium.manual.grammar import LineError, check_groups
from multidrop.families.pmx.manual import program_file as pmx_file
from multidrop.families.pmx.manual.table import grouped
from multidrop.families.tmcl.manual import commands
from multidrop.macros import Macro, MacroStep
from multidrop.shell.events import By
from multidrop.shell.scripts.executor import play, run_script
from multidrop.shell.scripts.reading import read_script
from tests.support.cases import for_each
from tests.support.cell_session import CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual

GROUPED = {
    "MA 200,000": "200000", "MR -200,000": "200000", "MA200,000": "200000", "ma 1,234,567": "1234567",
    "MA 200,000,1": "200000", "MA 200 000": "200000", "MA 200, 000": "200000", "MA 1,5,100": "5100",
    "MA 200\u2009000": "200000", "MA 200\u202f000": "200000", "MA 200\u00a0000": "200000", "MA 200'000": "200000",
    "SL -1,000 'slow": "1000", "VM=1 000 000": "1000000", "P=1,000.5": "1000.5", "R1=R2+200,000": "200000",
    "LS=1,200,000": "200000", "VA Q1=200,000": "200000", "Q1=200,000": "200000", "H 1,000": "1000",
    "BR A1,P>200,000": "200000", "200,000": "200000", "PG 1,000": "1000",
}  # fmt: skip
FIELDS = (
    "MA 51200,1", "MA 51200,1,1", "MA 5,0,1", "IS=1,16,1", "IS=5,1,100", "OS=1,16,1", "S1=16,1,0", "S1 16,1",
    "LS=1,200", "LS=1,-200,0", "PR 1,000", 'PR "1,000"', "PR P,100", "TP 5000,100", "TR=100,200,300", "PW=1,200,300",
    "MR 5,0,1", "MA 5 '200", "MA 5 ' 200,000",
    "PF=10,100", "EX 100,1", "CP 1,100", "BR 100,P=200", "BP 100,200", "TI=1,100", "MU=1,1",
)  # fmt: skip
TMCL = ("MVP ABS, 0, 200", "ROR 0,100", "ROL 1,100", "SAP 140, 100, 100", "137 0, 0, 123", "138 1,200,300", "GAP 1,100")

MODULE = 'personality = "TMCM"\nname = "1"'


def why(line: str) -> str:
    try:
        check_groups(line)
    except LineError as wrong:
        return wrong.why
    return ""


@for_each(("line", "number"), GROUPED.items())
def test_groups_of_three_digits_are_refused_with_the_number_to_write(line: str, number: str) -> None:
    assert why(line).endswith(f"; write {number}"), line


POINTS = {
    "MR 51.200": "51, or 51200", "MA -51.200": "51, or 51200", "SL 20.5": "20", "P=1.000": "1, or 1000", "VM=.5": "0",
    "MA 5,1.0": "1", "R1=2.5": "2", "ma+1.": "1", "LS=1,200.000": "200, or 200000", "H 1.5": "2", "MA 1e3": "1000",
    "SL 1.5E2": "150",
}  # fmt: skip
WITH_POINT = (
    "F1=2.5",
    "R1=F1*2.5",
    "R1=7*1.5",
    "SA=1.8",
    "CR=0.5",
    "PR 8.5",
    "BR A1,P>1.5",
    "MR 5 '51.2",
    "Q1=2.5",
    "MA F1",
)


@for_each(("line", "number"), POINTS.items())
def test_a_fraction_is_refused_where_a_word_takes_whole_numbers(line: str, number: str) -> None:
    assert why(line).endswith(f" takes whole numbers; write {number}"), line


@for_each("line", WITH_POINT)
def test_a_point_in_arithmetic_and_in_words_that_take_it_is_none(line: str) -> None:
    assert why(line) == "", line


async def test_a_fraction_moves_no_drive_of_any_family(tmp_path) -> None:
    cell = bus("press", party("a")) + bus("stages", pmx("00")) + bus("line", MODULE)
    lines = ("@press:a MR 51.200", "@press:* MR 51.200", "@stages:00 X51.200", "@line:1 MVP ABS, 0, 51.200")
    async with CellSession(tmp_path, cell) as shop:
        for line in lines:
            with pytest.raises((Diagnostic, DriveError)):
                await shop.session.run(line)
            assert not shop.moving(), line
        written = shop.written("press") + shop.written("line")
        assert b"51" not in written


@for_each("line", FIELDS)
def test_a_field_of_a_word_may_have_three_digits(line: str) -> None:
    assert why(line) == "", line


@for_each("line", TMCL)
def test_every_line_of_tmcl_has_its_fields(line: str) -> None:
    assert commands.parse(line)


def test_no_command_of_the_controller_separates_numbers() -> None:
    for line in ("X200,000", "X200 000", "I1000:200,000", "V1=-200,000", "HSPD=1\u202f000"):
        assert "write" in grouped(line), line
    for line in ("X1000Y2000", "I1000:-1000", "V1=200000", "SA1=100", "TX1000", "DN=2ED00"):
        assert grouped(line) == "", line


def test_nothing_leaves_over_modbus() -> None:
    with pytest.raises(Inexpressible, match="200,000 would be read as 200; write 200000; nothing was sent"):
        next(ModbusOperations(ModbusState(Modbus())).perform("MA 200,000"))


def test_a_line_of_a_program_is_an_error_with_its_place() -> None:
    text = "VA Q1=1,000\nPG 1\nLB A\n  MA 200,000\nMA 5,0,1\nE\nPG\n"
    found = [(each.line, each.column, each.what) for each in program_file.scan(text)[1]]
    assert [each[:2] for each in found] == [(1, 7), (4, 6)] and "write 200000" in found[1][2]
    assert [each.line for each in program_checker.check(text) if not each.warning][:2] == [1, 4]
    with pytest.raises(Diagnostic, match="x:1:1: X200,000 is not one number|x:1:1: 200,000 is not one number"):
        pmx_file.read("X200,000\nEND\n", "x")


async def test_nothing_is_sent_however_the_line_comes(tmp_path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b")), bus("stages", pmx("00"))) as shop:
        await asyncio.sleep(1.0)
        shop.events.clear()
        for line in ("MA 200,000", "@a MA 200 000", "@b MR -200,000,1", "@* SL 200,000", "@stages:00 X200,000"):
            for by in (By.OPERATOR, By.SCRIPT):
                with pytest.raises(Inexpressible, match="nothing was sent"):
                    await shop.session.run(line, replace(shop.session.origin, by=by))
        with pytest.raises(Diagnostic, match="write 200000"):
            await play(shop.session, shop.session.origin, Macro("go", (MacroStep(0.0, "@a MA 200,000"),)), {})
        await asyncio.sleep(1.0)
        assert b"200" not in shop.written("press") + shop.written("stages") and not shop.moving()
        await shop.session.run("@a MA 200,1")
        assert b"MA 200,1" in shop.written("press")


async def test_a_line_for_the_program_is_refused_too(tmp_path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        await shop.session.run("PG 1")
        with pytest.raises(Inexpressible):
            await shop.session.run("MA 200,000")
        await shop.session.run("E")
        await shop.session.run("PG")
        assert b"200" not in shop.written("press")


@for_each("wrong", ["@a MA 200,000", "@a MA {FAR}", "@stages:00 X200,000", "@lab:1 MVP ABS, 0, 200,000"])
async def test_a_line_that_no_drive_gets_is_found_before_the_script_moves_anything(tmp_path, wrong: str) -> None:
    (tmp_path / "s.txt").write_text(f"@a MR 51200\n/if 1 == 1\n  {wrong}\n/end\n", encoding="utf-8")
    async with CellSession(tmp_path, bus("press", party("a")), bus("stages", pmx("00")), bus("lab", MODULE)) as shop:
        script = read_script(str(tmp_path / "s.txt"), {"FAR": "200,000"} if "{" in wrong else {})
        with pytest.raises(Diagnostic, match=r"s.txt:3: .*nothing was sent"):
            await run_script(shop.session, shop.session.origin, script)
        macro = Macro("go", (MacroStep(0.0, "@a MR 51200"), MacroStep(0.0, wrong)))
        with pytest.raises(Diagnostic, match="go, step 2: "):
            await play(shop.session, shop.session.origin, macro, {"FAR": "200,000"} if "{" in wrong else {})
        await asyncio.sleep(1.0)
        assert b"MR 51200" not in shop.written("press")
