"""The tour: each step goes on when it was done, by the person and on the demo cell."""

import pytest

from tests.support.fake_session import on_screen, press, settle

pytestmark = pytest.mark.tui


async def test_each_step_waits_until_it_was_done_and_escape_ends_it() -> None:
    async with on_screen() as (pilot, app, session):
        app.tour.begin_on("press")

        async def step() -> int:
            await settle(pilot)
            return int(app.main.lines("tour").plain.split("tour ")[-1].split()[0])

        assert await step() == 1
        for number, keys in enumerate(
            [
                (*"pr p", "enter"),
                (*"MR 512000", "enter"),
                (*"MR {12.5 mm}", "enter"),
                (*"@b PR P", "enter"),
                ("ctrl+a",),
                ("escape",),
                (*"SL 100000", "enter"),
                ("ctrl+x",),
            ],
            2,
        ):
            await pilot.press(*keys)
            assert await step() == number
        session.resume()
        assert await step() == 10
        for number, keys in enumerate([("ctrl+n",), ("escape", "ctrl+g"), ("escape", "ctrl+e")], 11):
            await pilot.press(*keys)
            assert await step() == number
        await pilot.press("escape", "escape")
        for recording, number in (("tour", 14), ("", 15)):
            session.recording = recording
            app.model.changed = True
            assert await step() == number
        await pilot.press("ctrl+k")
        assert await step() == 16
        await pilot.press("escape", "ctrl+p")
        assert await step() == 17
        assert "is help for where you are" in app.main.lines("tour").plain
        await pilot.press("escape", "f1")
        await step()
        await pilot.press("escape")
        assert await step() == 17 and "That was the tour" in app.main.lines("tour").plain
        await press(pilot, "escape")
        assert not app.tour.on and not app.main.lines("tour").display


async def test_lines_to_another_machine_do_not_count_and_nothing_is_typed_for_the_person() -> None:
    async with on_screen() as (pilot, app, session):
        app.tour.begin_on("press")
        session.select("", "eth")
        await settle(pilot)
        assert "Lines go to eth now" in app.main.lines("tour").plain
        await press(pilot, *"PR P", "enter")
        session.select("", "press")
        await settle(pilot)
        assert "tour 1 of" in app.main.lines("tour").plain
        assert [line for line, _ in session.lines] == ["PR P"]
        session.buses.pop("press")
        await settle(pilot)
        assert "is closed" in app.main.lines("tour").plain


async def test_escape_closes_completions_before_it_ends_the_tour() -> None:
    async with on_screen() as (pilot, app, _):
        app.tour.begin_on("press")
        await pilot.press("M")
        assert app.main.entry.listing.open
        await pilot.press("escape")
        assert app.tour.on and not app.main.entry.listing.open
        await pilot.press("escape")
        assert not app.tour.on


async def test_the_tour_is_on_the_demo_cell_that_is_open_and_opens_nothing_twice() -> None:
    async with on_screen() as (pilot, app, session):
        before = list(session.buses)
        await app.tour.begin()
        await settle(pilot)
        assert app.tour.bus == "press" and list(session.buses) == before
