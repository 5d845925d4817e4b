"""Variables of the programs in drives: read by `/variables`, and the lines that change and keep them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible
from multidrop.dialects.by_hand import Variable
from multidrop.shell.events import VariablesRead
from tests.support.cell_session import CellSession, bus, drive, party, pmx

pytestmark = pytest.mark.virtual
LINE = bus("line", party("a"), party("b"), baud=0)
ARM, MODULE = bus("arm", pmx("00"), baud=0), bus("slide", drive("TMCM-1140", "1"), baud=0)


async def read(shop: CellSession) -> tuple[Variable, ...]:
    shop.events.clear()
    await shop.session.run("/variables")
    return next(each.variables for each in shop.events if isinstance(each, VariablesRead))


async def test_the_64_variables_of_a_controller_and_which_store_keeps(tmp_path):
    async with CellSession(tmp_path, ARM) as shop:
        await shop.session.run("V40=-7")
        found = await read(shop)
        assert [each.name for each in found] == [f"V{n}" for n in range(64)]
        assert (found[40].value, found[40].kept, found[31].kept) == (-7, "kept by STORE", "0 after power-off")
        by_hand = shop.session.drive().family.values.by_hand
        assert by_hand.assign(found[40], found[40].taken(" 12 ")) == "V40=12"
        assert (by_hand.keep(found[40]), by_hand.keep(found[31])) == ("STORE", "")
        assert b"@00V0\r" in shop.written("arm") and b"@00V63\r" in shop.written("arm")
        assert "pmx" not in shop.printed()[-1] and shop.printed()[-1].endswith("64 variables; not 0: V40=-7")


async def test_the_registers_and_the_declared_variables_of_a_drive(tmp_path):
    async with CellSession(tmp_path, LINE) as shop:
        await shop.session.run("@a R2=5")
        await shop.session.run("@a VA Q1=3")
        found = await read(shop)
        assert {each.name: each.value for each in found} == {"R1": 0, "R2": 5, "R3": 0, "R4": 0, "Q1": 3}
        by_hand = shop.session.drive().family.values.by_hand
        assert (by_hand.assign(found[4], "9"), by_hand.keep(found[4])) == ("Q1=9", "S")


async def test_the_user_variables_of_a_module(tmp_path):
    async with CellSession(tmp_path, MODULE) as shop:
        await shop.session.run("SGP 5, 2, 77")
        found = await read(shop)
        assert len(found) == 256 and found[5].value == 77
        by_hand = shop.session.drive().family.values.by_hand
        assert (by_hand.assign(found[5], "8"), by_hand.keep(found[5])) == ("SGP 5, 2, 8", "STGP 5, 2")
        await shop.session.run(by_hand.assign(found[5], "8"))
        assert (await read(shop))[5].value == 8


async def test_nothing_is_read_in_program_mode(tmp_path):
    async with CellSession(tmp_path, LINE) as shop:
        await shop.session.run("@a PG 100")
        with pytest.raises(DriveError, match="program mode"):
            await shop.session.run("/variables a")
        await shop.session.run("@a PG")


async def test_a_family_without_variables_says_so(tmp_path):
    from multidrop.dialects.by_hand import ByHand

    async with CellSession(tmp_path, LINE) as shop:
        base = ByHand(shop.session.drive().state)
        with pytest.raises(Inexpressible, match="no variables of their own; nothing was sent"):
            next(base.variables(lambda done, total: None))
        assert base.outputs() == base.programs() == ()


WHOLE, FRACTION = Variable("V1", 0), Variable("F1", 0.5, fraction=True)


@pytest.mark.parametrize(
    ("text", "taken"), [("5", "5"), (" -7 ", "-7"), ("+3", "3"), ("2.0", "2"), ("-2147483648",) * 2]
)
def test_a_whole_number_is_taken(text, taken):
    assert WHOLE.taken(text) == taken


@pytest.mark.parametrize("text", ["", "x", "1.5", "1e3", "nan", "inf", "0x10", "1_0", "2147483648", "٣", "5 6"])
def test_what_is_no_whole_number_is_one_line(text):
    with pytest.raises(Diagnostic, match="V1"):
        WHOLE.taken(text)


def test_a_variable_of_fractions_takes_them():
    assert (FRACTION.taken("1.25"), FRACTION.taken("2")) == ("1.25", "2")


@given(st.text(max_size=24))
def test_any_text_is_a_number_that_fits_or_one_clear_line(text):
    try:
        assert -(2**31) <= int(WHOLE.taken(text)) < 2**31
    except Diagnostic as problem:
        assert "valid" in str(problem) or "whole numbers" in str(problem)
