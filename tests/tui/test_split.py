"""The split screen: a second transcript of a drive or a line, and the exchange of the halves."""

import pytest

from multidrop.shell.events import By, Entered, Printed
from tests.support.fake_session import a_talk, demo_session, make_app, settle

pytestmark = pytest.mark.tui


@pytest.mark.parametrize("size", [(80, 24), (200, 50)])
async def test_the_other_half_shows_one_drive_and_a_key_types_to_it(size: tuple[int, int]) -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=size) as pilot:
        session.emit(*a_talk(session))
        await settle(pilot)
        await pilot.press("ctrl+l", "down", "enter")
        await settle(pilot)
        beside = app.main.beside
        assert (beside.bus, beside.address) == ("press", "b")
        assert "@b PR VX" in beside.transcript.plain and "512000" not in beside.transcript.plain
        above = beside.region.bottom <= app.main.page("press").region.y
        assert above is (size[0] == 80)
        session.emit(Printed(session.time, "press", "b", "4711"), Printed(session.time, "press", "a", "4712"))
        await settle(pilot)
        assert "4711" in beside.transcript.plain and "4712" not in beside.transcript.plain
        assert app.main.lines("label").plain == " press:a ▸ "
        await pilot.press("ctrl+l")
        await settle(pilot)
        assert app.main.lines("label").plain == " press:b ▸ " and (beside.bus, beside.address) == ("press", "a")
        await pilot.press(*"PR P", "enter")
        await settle(pilot)
        assert session.sent == ["press:b PR P"]


async def test_the_other_half_of_a_closed_line_goes_and_the_palette_ends_the_split() -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        app.view._show_half("", "eth")
        session.emit(Entered(session.time, "PR MV", By.OPERATOR, "eth", ""))
        await settle(pilot)
        assert "PR MV" in app.main.beside.transcript.plain
        session.buses.pop("eth")
        app.model.changed = True
        await settle(pilot)
        assert not app.main.beside.display
        app.view._show_half("b", "press")
        await pilot.press("ctrl+p", *"one half", "enter")
        await settle(pilot)
        assert not app.main.beside.display
