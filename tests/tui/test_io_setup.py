"""The form of inputs and outputs: words for the numbers, the drive's own lines, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest
from textual.pilot import Pilot

from multidrop.base.errors import Diagnostic
from multidrop.dialects.by_hand import PointField
from multidrop.tui.screens.io_setup import IoSetupPage
from tests.support.cell_session import bus, drive
from tests.support.fake_session import press
from tests.support.real_screen import real_screen, until

TYPE = PointField("function", {0: "general", 1: "home", 2: "limit +"})
BIT = PointField("level", {0: "low", 1: "high"}, mask=0x20)


@pytest.mark.parametrize("text", ["1", "home", "HOME", " 1 home ", "hom"])
def test_a_choice_is_typed_as_number_or_word(text):
    assert TYPE.read(text) == 1


@pytest.mark.parametrize("text", ["", "9", "lim", "1.0", "homeless"])
def test_what_is_no_choice_is_one_line_with_the_valid_ones(text):
    if text == "lim":
        assert TYPE.read(text) == 2
        return
    with pytest.raises(Diagnostic, match="0 general, 1 home, 2 limit"):
        TYPE.read(text)


def test_a_field_is_one_of_several_or_bits_of_a_number():
    assert TYPE.of((1, 0), 0) == 1 and TYPE.put((1, 0), 0, 2) == (2, 0)
    assert BIT.of(0x25, 0) == 1 and BIT.put(0x25, 0, 0) == 0x05 and BIT.put(5, 0, 1) == 0x25
    assert TYPE.of(2, 0) == 2 and TYPE.put(2, 0, 1) == 1
    assert TYPE.of((1,), 3) is None and TYPE.of("text", 0) is None


async def opened(pilot: Pilot[int]) -> IoSetupPage:
    await until(pilot, lambda: pilot.app.session.selected)  # type: ignore[attr-defined]
    await pilot.app.run_action("act.page('io')")
    page = pilot.app.screen
    assert isinstance(page, IoSetupPage)
    await until(pilot, lambda: not page.form.nothing())
    return page


async def edited(pilot: Pilot[int], page: IoSetupPage, key: str, text: str = "") -> None:
    keys = [row.key for row in page.form.rows()]
    await press(pilot, *["up"] * len(keys), *["down"] * keys.index(key), "enter")
    if page.asked is not None:
        page.field.value = text
        await press(pilot, "enter")


@pytest.mark.tui
@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
async def test_an_input_gets_a_function_by_its_word(tmp_path: Path, size: tuple[int, int]) -> None:
    async with real_screen(tmp_path, size=size) as pilot:
        page = await opened(pilot)
        await edited(pilot, page, "IS4.0", "nothing like that")
        assert "nothing was changed" in page.said[0] and "home" in page.said[0]
        await press(pilot, "escape")
        await edited(pilot, page, "IS4.0", "home")
        assert "only one of them can have type 1" in page.lines("preview").plain, "the demo has a home switch already"
        await press(pilot, "ctrl+s")
        assert "nothing was sent" in page.said[0]
        await edited(pilot, page, "IS4.0", "soft stop")
        assert "IS=4,5," in page.lines("preview").plain
        await press(pilot, "ctrl+s")
        assert page.said[0].startswith("Enter sends IS=4,5,")
        await press(pilot, "enter")
        await until(pilot, lambda: not page.form.edits and pilot.app.outbox.idle)  # type: ignore[attr-defined]
        assert next(row.value for row in page.form.rows() if row.key == "IS4.0") == "5 soft stop"


@pytest.mark.tui
async def test_polarities_of_a_controller_are_bits(tmp_path: Path) -> None:
    async with real_screen(tmp_path, "sim:#pmx") as pilot:
        page = await opened(pilot)
        keys = [row.key for row in page.form.rows()]
        assert len(keys) > 4 and all(key.startswith("POL") for key in keys)
        before = page.form.rows()[0].value
        await edited(pilot, page, keys[0])
        assert page.form.edits and "POLX=" in page.lines("preview").plain
        await edited(pilot, page, keys[0])
        assert not page.form.edits and page.form.rows()[0].value == before


@pytest.mark.tui
async def test_the_limit_switches_of_a_module(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("slide", drive("TMCM-1140", "1"), baud=0))
    async with real_screen(tmp_path, f"sim:{tmp_path / 'cell.toml'}") as pilot:
        page = await opened(pilot)
        await edited(pilot, page, "12.0")
        assert "SAP 12, 0, " in page.lines("preview").plain
