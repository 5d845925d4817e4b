"""The page of variables, from a key to the drive and back: a value is checked and seen before it is sent."""

from __future__ import annotations

from pathlib import Path

import pytest
from textual.pilot import Pilot

from multidrop.tui.screens.variables import VariablesPage
from tests.support.fake_session import press
from tests.support.real_screen import real_screen, until

pytestmark = pytest.mark.tui


async def opened(pilot: Pilot[int]) -> VariablesPage:
    await until(pilot, lambda: pilot.app.session.selected)  # type: ignore[attr-defined]
    await pilot.app.run_action("act.page('variables')")
    page = pilot.app.screen
    assert isinstance(page, VariablesPage)
    await until(pilot, lambda: " of " in page.lines("heading").plain and pilot.app.outbox.idle)  # type: ignore[attr-defined]
    return page


@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
async def test_a_variable_of_a_controller_is_edited(tmp_path: Path, size: tuple[int, int]) -> None:
    async with real_screen(tmp_path, "sim:#pmx", size) as pilot:
        page = await opened(pilot)
        assert "64 of 64" in page.lines("heading").plain
        await press(pilot, *"v40", "enter")
        page.field.value = "12.5"
        await press(pilot, "enter")
        assert "nothing was sent" in page.said[0] and "not a whole number" in page.said[0]
        page.field.value = "1200"
        await press(pilot, "enter")
        assert page.said[0].startswith("Enter sends V40=1200 - kept by STORE")
        await press(pilot, "enter")
        await until(pilot, lambda: "1200" in page.lines("table").plain)
        assert "1 of 64" in page.lines("heading").plain
        await press(pilot, "ctrl+s")
        assert page.said[0].startswith("Enter sends STORE")
        await press(pilot, "escape", "escape")
        assert pilot.app.screen is not page


async def test_a_stop_and_an_escape_send_nothing_and_a_lost_variable_is_named(tmp_path: Path) -> None:
    async with real_screen(tmp_path, "sim:#pmx") as pilot:
        page = await opened(pilot)
        for end in ("escape", "ctrl+x"):
            await press(pilot, "enter")
            page.field.value = "5"
            await press(pilot, "enter")
            assert "Enter sends V0=5" in page.said[0]
            await press(pilot, end)
            assert page.begun is None and "nothing was sent" in page.said[0]
        await press(pilot, "ctrl+s")
        assert page.said[0] == "V0 is 0 after power-off: no line keeps it"
        assert "V0=5" not in pilot.app.main.transcript.plain  # type: ignore[attr-defined]
