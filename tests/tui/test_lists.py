"""Lists: typing narrows, what is below is counted, clicks and the wheel choose, Enter takes, Escape closes."""

from __future__ import annotations

import pytest
from textual.widgets import Static

from multidrop.drives.events import Sample
from multidrop.shell.events import OnBus
from multidrop.tui.screens.all_drives import AllDrives
from multidrop.tui.screens.dialogs import ChoiceList, SearchDialog
from tests.support.fake_session import (
    FakeBus,
    FakeDrive,
    FakeSession,
    demo_session,
    on_screen,
    press,
    settle,
)

pytestmark = pytest.mark.tui


def many() -> FakeSession:
    return FakeSession(FakeBus("press", {f"{n:02}": FakeDrive(f"{n:02}") for n in range(40)}))


async def test_a_box_says_how_many_rows_are_below_and_follows_the_wheel() -> None:
    async with on_screen(many()) as (pilot, app, _):
        await press(pilot, "ctrl+o")
        box = app.screen
        assert isinstance(box, SearchDialog)
        options = box.query_one(ChoiceList)
        below = 40 - options.size.height
        assert f"▼ {below} below" in str(box.query_one(".keys", Static).content)
        options.scroll_relative(y=5, animate=False)
        await settle(pilot)
        assert f"▼ {below - 5} below" in str(box.query_one(".keys", Static).content)
        await press(pilot, "3", "9")
        assert "below" not in str(box.query_one(".keys", Static).content)


async def test_a_box_that_is_closed_before_its_rows_are_laid_out_counts_none() -> None:
    async with on_screen(many()) as (pilot, app, _):
        await press(pilot, "ctrl+o")
        options = app.screen.query_one(ChoiceList)
        await press(pilot, "escape")
        assert app.screen is app.main
        options.tell_below()  # what comes after a refresh comes after the box, where the machine is busy


async def test_a_click_on_a_row_of_a_box_takes_it() -> None:
    async with on_screen(many()) as (pilot, app, session):
        await press(pilot, "ctrl+o")
        await pilot.click(ChoiceList, offset=(5, 3))
        await settle(pilot)
        assert app.screen is app.main
        assert session.selected is not None and session.selected.address == "03"


async def test_rows_of_drives_are_clicked_on_the_main_screen_and_on_the_page() -> None:
    for size in ((80, 24), (120, 40)):
        async with on_screen(width=size[0], height=size[1]) as (pilot, app, session):
            session.emit(*(OnBus("press", Sample(session.time, each, 5, 0)) for each in "abc"))
            await settle(pilot)
            part = app.main.lines("status" if size[0] == 80 else "panel")
            row = next(n for n, each in enumerate(part.plain.split("\n")) if each.lstrip("│ ").startswith("b clamp"))
            await pilot.click(part, offset=(10, row))
            await settle(pilot)
            assert session.selected is not None and session.selected.address == "b"
            await press(pilot, "ctrl+a")
            assert isinstance(app.screen, AllDrives)
            drives = app.screen.lines("drives")
            row = next(n for n, each in enumerate(drives.plain.split("\n")) if "press:a" in each)
            await pilot.click(drives, offset=(30, row))
            await settle(pilot)
            assert session.selected.address == "a"


async def test_a_page_of_rows_counts_those_below_follows_the_wheel_and_closes_on_escape() -> None:
    async with on_screen(many()) as (pilot, app, _):
        await press(pilot, "ctrl+a")
        page = app.screen
        assert isinstance(page, AllDrives)
        height = page.lines("drives").size.height
        assert f"▼ {40 - height} below" in page.lines("heading").plain
        page.on_mouse_scroll_down()
        await settle(pilot)
        assert page.lines("drives").plain.split("\n")[1].startswith("▸")
        await press(pilot, "3", "9")
        assert "below" not in page.lines("heading").plain
        await press(pilot, "escape")
        assert app.screen is app.main


async def test_a_click_on_a_macro_plays_nothing() -> None:
    session = demo_session()
    async with on_screen(session) as (pilot, app, _):
        await app.run_action("act.page('macros')")
        await settle(pilot)
        await settle(pilot)
        await pilot.click(app.screen.lines("macros"), offset=(5, 1))  # type: ignore[attr-defined]
        await settle(pilot)
        assert app.screen.lines("macros").plain.split("\n")[1].startswith("▸shuttle")  # type: ignore[attr-defined]
        assert session.lines == []


async def test_the_palette_has_the_functions_of_the_page_first() -> None:
    async with on_screen() as (pilot, app, _):
        await app.run_action("act.page('parameters')")
        await press(pilot, "ctrl+p")
        assert isinstance(app.screen, SearchDialog)
        titles = [match.text.plain.split("  ")[0] for match in app.screen.found]
        assert titles[:3] == ["Stop all", "Save", "Read again"]
