"""The form that sets up a drive, from a key to the configuration file and back to the screen."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from textual.pilot import Pilot

from multidrop.tui.screens.setup import SetupPage
from tests.support.fake_session import press, settle
from tests.support.real_screen import real_screen, until

pytestmark = pytest.mark.tui


async def opened(pilot: Pilot[int]) -> SetupPage:
    """The page once the drive has said what it counts."""
    await until(pilot, lambda: pilot.app.session.selected)  # type: ignore[attr-defined]
    await pilot.app.run_action("act.page('setup')")
    page = pilot.app.screen
    assert isinstance(page, SetupPage)
    await until(pilot, lambda: "steps" in page.lines("preview").plain and "51200" in page.lines("preview").plain)
    return page


async def edited(pilot: Pilot[int], row: str, text: str) -> None:
    """Choose a row by its label, and type a value into it."""
    page = pilot.app.screen
    assert isinstance(page, SetupPage)
    labels = [each.label for each in page.form.rows()]
    await press(pilot, *["up"] * len(labels), *["down"] * labels.index(row), "enter")
    if page.asked is not None:
        page.field.value = text
        await press(pilot, "enter")


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    file = tmp_path / "multidrop.toml"
    file.write_text("# the shop\n")
    return file


@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
async def test_a_person_gets_millimetres_without_toml(tmp_path: Path, file: Path, size: tuple[int, int]) -> None:
    async with real_screen(tmp_path, size=size) as pilot:
        page = await opened(pilot)
        await edited(pilot, "one turn or step", "5 mm")
        assert page.lines("preview").plain.split("\n")[1].strip() == "one turn = 5 mm = 51200 steps, 1 mm = 10240 steps"
        await edited(pilot, "name", "gantry")
        await edited(pilot, "travel", "0 to 300")
        await edited(pilot, "save the line as", "line1")
        assert file.read_text() == "# the shop\n", "nothing is written while it is edited"
        await press(pilot, "ctrl+s")
        assert "Enter sends /setup" in page.lines("said").plain
        await press(pilot, "enter")
        await until(pilot, lambda: not page.form.edits and "connection line1" in page.lines("heading").plain)
        units = {"a": {"scale": "5 mm/turn", "travel": "0..300 mm"}}
        saved = {"url": "sim:#press", "names": {"a": "gantry"}, "units": units}
        assert tomllib.loads(file.read_text()) == {"connections": {"line1": saved}}
        assert file.read_text().startswith("# the shop\n")
        session = pilot.app.session  # type: ignore[attr-defined]
        assert session.selected.label == "gantry" and str(session.units.of(session.selected).scale) == "5 mm/turn"


async def test_a_wrong_value_is_refused_with_one_line_and_the_row_stays(tmp_path: Path, file: Path) -> None:
    async with real_screen(tmp_path) as pilot:
        page = await opened(pilot)
        for row, text, why in (
            ("one turn or step", "5 furlong/turn", "no unit furlong"),
            ("travel", "3..1 mm", "ends where it begins, or before"),
            ("name", "x y", "is not a name"),
            ("full steps", "x", "not a whole number"),
        ):
            await edited(pilot, row, text)
            assert "nothing was changed" in page.said[0] and why in page.said[0], row
            await press(pilot, "escape")
        assert page.form.edits == {}
        await press(pilot, "ctrl+s")
        assert "nothing was changed, so nothing is to be saved" in page.said[0]


async def test_a_stop_and_an_escape_write_nothing_and_an_edited_form_is_left_at_the_second_escape(
    tmp_path: Path, file: Path
) -> None:
    async with real_screen(tmp_path) as pilot:
        page = await opened(pilot)
        await edited(pilot, "guard of travel", "")
        await press(pilot, "ctrl+s")
        await press(pilot, "ctrl+x")
        assert "stopped; nothing was sent" in page.said[0]
        assert file.read_text() == "# the shop\n" and page.form.edits == {"guard": "off"}
        await press(pilot, "escape")
        assert pilot.app.screen is page and "Esc again leaves it" in page.said[0]
        await press(pilot, "escape")
        assert pilot.app.screen is not page and file.read_text() == "# the shop\n"


async def test_what_could_not_be_written_is_reported_and_the_form_keeps_it(tmp_path: Path, file: Path) -> None:
    async with real_screen(tmp_path) as pilot:
        page = await opened(pilot)
        await edited(pilot, "guard of travel", "")
        file.chmod(0o444)
        await press(pilot, "ctrl+s")
        await press(pilot, "enter")
        await until(pilot, lambda: "read-only" in page.said[0])
        await settle(pilot)
        assert page.form.edits == {"guard": "off"}
