"""Pages in front of the main screen, panels that keys show and hide, and the split screen."""

import pytest

from multidrop.dialects.values import UNREAD, Conditions
from multidrop.drives.events import Conditioned, Sample, Silent
from multidrop.shell.events import By, Entered, OnBus, Printed
from multidrop.shell.roles import Series
from multidrop.tui.app import MultidropApp
from multidrop.tui.panels.drive_columns import ALL_DRIVES
from multidrop.tui.panels.machine import DriveOnLine
from multidrop.tui.panels.view import Glance
from multidrop.tui.polling import CONDITIONS, CONDITIONS_OF_OTHERS
from multidrop.tui.readout import Readout
from multidrop.tui.screens import page as pages
from multidrop.tui.screens.all_drives import AllDrives
from multidrop.tui.screens.page import ListPage, Page, SendingPage
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.widgets.lines import width_of
from tests.support.fake_session import (
    FakeBus,
    FakeDrive,
    FakeSession,
    a_move,
    a_talk,
    demo_session,
    emit,
    make_app,
    on_screen,
    press,
    readable,
    settle,
    toasts,
)
from tests.support.panel_rows import view

pytestmark = pytest.mark.tui
SPLIT = ("ctrl+p", *"split the", "enter")


def rows(app: MultidropApp) -> list[str]:
    assert isinstance(app.screen, AllDrives)
    return [row for row in app.screen.lines("drives").plain.split("\n") if row.strip()]


@pytest.mark.parametrize(
    ("base", "missing"), [(Page, "abstract method '?show"), (ListPage, "'?action_step'?, '?choose'?, '?show")]
)
def test_a_page_that_does_not_paint_itself_is_none(base: type[Page], missing: str) -> None:
    class Half(base):  # type: ignore[misc, valid-type]
        pass

    with pytest.raises(TypeError, match=missing):
        Half(None)


async def test_all_drives_are_a_page_with_the_worst_first() -> None:
    async with on_screen() as (pilot, app, session):
        session.emit(*a_move(session), OnBus("eth", Sample(session.time, "", 5, 0)))
        await press(pilot, "ctrl+a")
        assert [row.split()[0] for row in rows(app)] == ["▸pmx:00", "press:c", "press:b", "press:a", "eth"]
        assert "1 lost · 1 silent · 1 moving" in app.screen.lines("heading").plain  # type: ignore[attr-defined]


async def test_enter_selects_a_drive_without_trouble_and_goes_back() -> None:
    async with on_screen() as (pilot, app, session):
        session.emit(*a_move(session))
        await press(pilot, "ctrl+a")
        session.select("b", "press")
        await settle(pilot)
        readable(pilot)
        await press(pilot, *"gantry")
        assert len(rows(app)) == 1
        await press(pilot, "enter")
        assert app.screen is app.main
        assert (session.selected_bus, session.selected and session.selected.address) == ("press", "a")
        assert session.lines == []


async def test_the_chosen_drive_stays_chosen_when_another_gets_worse() -> None:
    async with on_screen() as (pilot, app, session):
        session.emit(*a_move(session))
        await press(pilot, "ctrl+a")
        await press(pilot, "down", "down", "down")
        assert rows(app)[3].startswith("▸press:a")
        await emit(pilot, OnBus("eth", Silent(session.time, "")))
        assert rows(app)[4].startswith("▸press:a")


def with_error(session: FakeSession, address: str) -> OnBus:
    found = Conditions(error=UNREAD, error_text="PR ER shows and clears it")
    return OnBus("press", Conditioned(session.time, address, (found,)))


async def test_enter_opens_the_worst_drive_while_no_other_one_was_chosen() -> None:
    session = FakeSession(FakeBus("press", {each: FakeDrive(each) for each in "abc"}))
    async with on_screen(session) as (pilot, app, _):
        session.emit(*(OnBus("press", Sample(session.time, each, 500, 0)) for each in "abc"))
        await press(pilot, "ctrl+a")
        assert rows(app)[0].startswith("▸press:a")
        await emit(pilot, with_error(session, "c"))
        assert rows(app)[0].startswith("▸press:c")
        await press(pilot, "enter")
        assert session.selected is not None and session.selected.address == "c"


async def test_a_drive_with_an_error_is_counted_as_that() -> None:
    session = FakeSession(FakeBus("press", {each: FakeDrive(each) for each in "abc"}))
    async with on_screen(session) as (pilot, app, _):
        session.emit(*(OnBus("press", Sample(session.time, each, 500, 7 * (each == "b"))) for each in "abc"))
        session.emit(with_error(session, "c"), with_error(session, "b"))
        await press(pilot, "ctrl+a")
        assert "2 error · 1 moving · 1 at rest" in app.screen.lines("heading").plain  # type: ignore[attr-defined]


PAGES = [
    "",
    "plot",
    "drives",
    "controls",
    "program",
    "parameters",
    "why",
    "traffic",
    "macros",
    "setup",
    "variables",
    "outputs",
    "programs",
    "io",
]


@pytest.mark.parametrize("page", PAGES)
async def test_conditions_of_the_selected_and_of_plotted_drives_are_read_every_second_on_every_page(page: str) -> None:
    async with on_screen() as (pilot, app, session):
        session.plotted = (Series("press", "b"),)
        await press(pilot, *(f"/page {page}" if page else ""), "enter")
        assert (app.screen is app.main) is not page or not page
        await settle(pilot)
        watched = session.buses["press"].telemetry.watched
        assert session.selected is not None and session.selected.address == "a"
        assert (watched["a"], watched["b"], watched["c"]) == (CONDITIONS, CONDITIONS, CONDITIONS_OF_OTHERS)


async def test_a_page_stays_after_a_stop_and_shows_its_outcome() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, "ctrl+a", "ctrl+p", "ctrl+x")
        assert isinstance(app.screen, AllDrives) and session.stops == 1
        assert "STOP SENT" in app.screen.query_one(".banner").plain  # type: ignore[attr-defined]
        assert "^X STOP ALL" in app.screen.lines("footer").plain
        await press(pilot, "escape")
        assert app.screen is app.main


async def test_pages_open_by_typing_and_an_unknown_one_is_refused() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, *"/page drives", "enter")
        assert isinstance(app.screen, AllDrives)
        assert session.lines == [("/page drives", By.OPERATOR)]


@pytest.mark.parametrize("size", [(80, 24), (220, 50)])
async def test_a_key_shows_and_hides_a_panel_at_every_size(size: tuple[int, int]) -> None:
    app = make_app()
    async with app.run_test(size=size) as pilot:
        await settle(pilot)
        shown = "plot" in app.main.wants()
        assert shown is (size[0] >= 110)
        await press(pilot, "ctrl+g", "ctrl+g")
        assert ("plot" in app.main.wants()) is not shown
        parts = [app.main.lines(name) for name, _ in app.main.columns()]
        assert any("last 20 s" in part.plain for part in parts) is not shown


async def test_a_click_on_the_footer_does_what_the_key_does_but_moves_nothing() -> None:
    async with on_screen(width=120) as (pilot, app, session):
        await settle(pilot)
        footer = app.main.lines("footer").plain
        await pilot.click("#footer", offset=(footer.index("F3 shuttle") + 4, 0))
        await settle(pilot)
        assert session.lines == []  # the click was for the focus of the terminal
        assert any("press F3" in text for text in toasts(app))
        await pilot.click("#footer", offset=(footer.index("^A all drives"), 0))
        await settle(pilot)
        assert isinstance(app.screen, AllDrives)
        await pilot.click("#footer", offset=(app.screen.lines("footer").plain.index("Esc"), 0))
        await settle(pilot)
        assert app.screen is app.main


async def test_what_is_typed_on_the_page_of_all_drives_chooses_an_address_and_enter_takes_nothing_else() -> None:
    async with on_screen() as (pilot, app, session):
        for typed, selected in {"t": "a", "b": "b"}.items():
            await press(pilot, "ctrl+a")
            await press(pilot, *typed, "enter", *(["escape", "escape"] if typed == "t" else []))
            assert session.selected is not None and session.selected.address == selected, typed
            assert app.screen is app.main


@pytest.mark.parametrize("width", [60, 75, 76, 80, 120])
def test_a_row_fits_and_shows_the_trouble_at_every_width(width: int) -> None:
    readout = Readout()
    readout.take(Sample(1.0, "a", -2_147_483_648, 5_000_000, "", "limit+"))
    place = DriveOnLine("gantry-left", Glance("a", "a-long-name", "LMDCM", "", readout))
    row = ALL_DRIVES.row(place, view(demo_session()), width, True)
    assert width_of(row) == width
    assert "✗ limi" in "".join(text for text, _ in row)


# The split screen


@pytest.mark.parametrize("size", [(80, 24), (260, 50)])
async def test_the_other_half_shows_one_drive_and_a_key_types_to_it(size: tuple[int, int]) -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=size) as pilot:
        await emit(pilot, *a_talk(session))
        await press(pilot, *SPLIT, "down", "enter")
        beside = app.main.beside
        assert (beside.bus, beside.address) == ("press", "b")
        assert "@b PR VX" in beside.transcript.plain and "512000" not in beside.transcript.plain
        above = beside.region.bottom <= app.main.page("press").region.y
        assert above is (size[0] == 80)
        await emit(pilot, Printed(session.time, "press", "b", "4711"), Printed(session.time, "press", "a", "4712"))
        assert "4711" in beside.transcript.plain and "4712" not in beside.transcript.plain
        assert app.main.lines("label").plain == " press:gantry ▸ "
        await press(pilot, *SPLIT)
        assert app.main.lines("label").plain == " press:clamp ▸ " and (beside.bus, beside.address) == ("press", "a")
        await press(pilot, *"PR P", "enter")
        assert session.sent == ["press:b PR P"]


async def test_the_other_half_of_a_closed_line_goes_and_the_palette_ends_the_split() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, *SPLIT, *"all of the eth", "enter")
        await emit(pilot, Entered(session.time, "PR MV", By.OPERATOR, "eth", ""))
        assert "PR MV" in app.main.beside.transcript.plain
        session.buses.pop("eth")
        app.model.changed = True
        await settle(pilot)
        assert not app.main.beside.display
        await press(pilot, *SPLIT, "down", "enter")
        await press(pilot, "ctrl+p", *"one half", "enter")
        assert not app.main.beside.display


@pytest.mark.parametrize("name", [entry.name for entry in pages.PAGES if issubclass(entry.page(), SendingPage)])
async def test_no_page_takes_a_line_as_seen_while_a_key_waits_that_was_typed_before(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A frame may be painted between two keys of one read."""
    async with on_screen() as (pilot, app, session):
        await app.run_action(f"act.page({name!r})")
        await settle(pilot)
        page = app.screen
        assert isinstance(page, SendingPage)
        page.offer("line", ("MR 1",))
        for idle, seen in ((False, False), (True, True), (False, True)):
            monkeypatch.setattr(Keyboard, "idle", idle)
            page.show(app.presenter.view(session.now()))
            assert page.painted is seen
        assert not [line for line in session.sent if "MR 1" in line]
