"""The app's handling of keys, lines, buses and the loss of a bus."""

import asyncio

import pytest
from textual import events
from textual.pilot import Pilot
from textual.worker import WorkerFailed

from multidrop.base.errors import TransportLost
from multidrop.drives.events import Sample, Unsolicited
from multidrop.shell.events import By, Entered, OnBus, StateChanged
from multidrop.shell.roles import Series
from multidrop.tui.outbox import BURST
from multidrop.tui.polling import LIVELY, OTHERS_PERIOD, PLOT, REST_PERIOD, STATUS
from multidrop.tui.readout import ReadoutState
from multidrop.tui.screens.dialogs import Ask, Choose, Confirm, ListedChoice, TooSmall, offers_like
from multidrop.tui.screens.start import Start
from tests.support.fake_session import (
    FakeBus,
    FakeDrive,
    FakeMacro,
    FakeMacros,
    FakeSession,
    demo_session,
    driver_of,
    emit,
    make_app,
    on_screen,
    press,
    readable,
    settle,
    toasts,
)

pytestmark = pytest.mark.tui


async def test_a_typed_line_goes_to_the_session_and_into_the_history() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, *"MR 5", "enter")
        assert session.lines == [("MR 5", By.OPERATOR)]
        assert app.assist.history()[-1] == "MR 5"
        assert "› MR 5" in app.main.page("press").plain
        assert app.main.entry.value == ""


async def test_enter_sends_what_stands_in_the_line_and_not_what_the_list_offers() -> None:
    async with on_screen() as (pilot, app, session):
        await pilot.press("M")
        assert app.main.entry.listing.open
        await pilot.press("enter")
        assert session.lines == [("M", By.OPERATOR)]


async def test_tab_goes_through_the_completions_with_their_meaning() -> None:
    async with on_screen() as (pilot, app, _):
        await pilot.press(*"PR M", "tab", "tab")
        assert app.main.entry.value == "PR MR"
        assert "move relative" in app.main.query_one("#menu").plain  # type: ignore[attr-defined]
        await pilot.press("shift+tab")
        assert app.main.entry.value == "PR MA"
        await pilot.press("up")
        assert app.main.entry.value == "PR MV"


async def test_the_list_closes_when_nothing_is_typed_any_more() -> None:
    async with on_screen() as (pilot, app, _):
        await pilot.press("M", "backspace")
        assert not app.main.entry.listing.open
        assert not app.main.query_one("#menu").display


async def test_a_click_anywhere_leaves_the_keys_with_the_input() -> None:
    async with on_screen() as (pilot, app, _):
        await pilot.click("#pages", offset=(20, 5))
        await pilot.press("M")
        assert app.main.entry.value == "M"


async def test_a_click_on_the_stop_stops_and_one_on_a_tab_shows_its_bus() -> None:
    async with on_screen() as (pilot, app, session):
        await settle(pilot)
        await click(pilot, 16, 23)
        assert session.stops == 0
        await click(pilot, 4, 23)
        assert session.stops == 1
        await click(pilot, app.main.lines("top").plain.index("eth"), 0)
        assert session.selected_bus == "eth"
        await pilot.press("f1")
        await click(pilot, 4, 23)
        assert session.stops == 2, "also under a dialog"


async def click(pilot: Pilot[int], x: int, y: int) -> None:
    """A click in the form that the terminal sends."""
    for kind in (events.MouseMove, events.MouseDown, events.MouseUp):
        driver_of(pilot.app).send_message(kind(None, x, y, 0, 0, 1, False, False, False, x, y))
    await pilot.pause()
    await pilot.pause()


async def test_up_goes_back_through_lines_that_begin_with_what_was_typed() -> None:
    async with on_screen() as (pilot, app, _):
        await pilot.press("up", "up")
        assert app.main.entry.value == "MR 512000"
        await pilot.press("down", "down")
        assert app.main.entry.value == ""
        await pilot.press("V", "up")
        assert app.main.entry.value == "VM=600000"
        await pilot.press("down")
        assert app.main.entry.value == "V"


async def test_one_pasted_line_is_typed_and_several_are_asked_about_and_sent_in_order() -> None:
    async with on_screen() as (pilot, app, session):
        app.post_message(events.Paste("MR 7\r\n"))
        await pilot.pause()
        assert (app.main.entry.value, session.lines) == ("MR 7", [])
        app.post_message(events.Paste("PG 100\r\n\r\nMR 1\r\nPG\r\n"))
        await pilot.pause()
        assert isinstance(app.screen, Confirm)
        assert "3" in app.screen.heading
        assert session.lines == []
        readable(pilot)
        await press(pilot, "enter")
        assert [line for line, _ in session.lines] == ["PG 100", "MR 1", "PG"]


async def test_a_paste_with_a_hidden_line_types_and_sends_nothing() -> None:
    async with on_screen() as (pilot, app, session):
        for text in ("PR P\u2028MR 1", "# x\rMR 1\nPR P\n", "PR P\x0cMR 1", "PR P\x85MR 1"):
            app.post_message(events.Paste(text))
            await pilot.pause()
            assert (app.main.entry.value, session.lines) == ("", []) and not isinstance(app.screen, Confirm)
        app.post_message(events.Paste("MR 1\rMR 2\r"))
        await pilot.pause()
        assert isinstance(app.screen, Confirm) and "2" in app.screen.heading


async def test_pasted_lines_after_one_that_failed_are_not_sent() -> None:
    session = demo_session()
    session.refuses["BAD"] = "a: 20 unknown"
    async with on_screen(session) as (pilot, app, _):
        app.post_message(events.Paste("BAD\nMR 1\nMR 2"))
        await pilot.pause()
        readable(pilot)
        await press(pilot, "enter")
        assert [line for line, _ in session.lines] == ["BAD"]
        await pilot.pause(BURST + 0.1)
        await settle(pilot)
        assert "'BAD' failed; 2 lines were not sent: MR 1 · MR 2" in app.main.page("press").plain


async def test_a_function_key_plays_its_macro_and_a_free_one_records_one_for_it() -> None:
    async with on_screen(width=100) as (pilot, app, session):
        await settle(pilot)
        await press(pilot, "f3", "f7")
        assert session.lines == [("/play shuttle", By.OPERATOR)]
        assert isinstance(app.screen, Ask) and app.screen.heading.startswith("F7 plays nothing yet")
        await press(pilot, *"go", "enter", "f8")
        assert "F8 plays nothing; /record stop ends the recording of go" in app.main.page("press").plain
        session.time += 1
        await press(pilot, "f7")
        assert [line for line, _ in session.lines[1:]] == ["/record go", "/record stop", "/key F7 go"]
        assert "F3 shuttle" in app.main.lines("footer").plain


async def test_recording_is_begun_in_the_palette_by_a_name_and_ended_there() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, "ctrl+p", *"record", "enter", *"lift", "enter")
        assert "● rec lift" in app.main.lines("top").plain
        assert "/record stop ends it" in app.main.lines("footer").plain
        await press(pilot, "ctrl+p", *"end rec", "enter")
        assert [line for line, _ in session.lines] == ["/record lift", "/record stop"]
        assert "rec" not in app.main.lines("top").plain


async def test_keys_and_numbers_switch_buses() -> None:
    async with on_screen() as (pilot, _, session):
        found = []
        for key in ("ctrl+pagedown", "ctrl+pagedown", "ctrl+pagedown", "ctrl+pageup", "alt+2"):
            await pilot.press(key)
            found.append(session.selected_bus)
        assert found == ["eth", "pmx", "press", "pmx", "eth"]


@pytest.mark.parametrize("keys", [("ctrl+o",), ("ctrl+p", *"split the", "enter")], ids=["drive", "half"])
async def test_a_picker_narrows_and_a_letter_that_matches_nothing_takes_nothing(keys: tuple[str, ...]) -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, *keys, "q", "enter")
        assert isinstance(app.screen, Choose)
        assert app.main.beside.bus == ""
        assert session.selected is not None and session.selected.address == "a"
        await press(pilot, "backspace", "b", "enter")
        assert app.screen is app.main
        taken = session.selected.address if len(keys) == 1 else app.main.beside.address
        assert taken == "b"


def test_a_picker_takes_the_drive_of_that_address_and_no_part_of_a_word() -> None:
    offers = [
        ListedChoice("1", "hall a LMDCM", "hall a axle"),
        ListedChoice("2", "press h LMDCM", "press h right"),
        ListedChoice("3", "press H LMDCM", "press H hoist"),
    ]
    for typed, keys in {"": "123", "h": "231", "H": "321", "l": "", "press:h": "23", "ax": "1", "h z": ""}.items():
        assert "".join(match.key for match in offers_like(offers, typed)) == keys, typed


async def test_a_letter_chooses_an_answer_and_one_that_begins_none_takes_nothing() -> None:
    async with on_screen() as (pilot, app, session):
        for letter, sent in {"z": [], "n": [], "s": ["press:a MR 1", "press:a MR 2"]}.items():
            await app.questions.paste(["MR 1", "MR 2"], lambda lines, place: [app.outbox.type(line) for line in lines])
            readable(pilot)
            await press(pilot, letter, "enter")
            assert isinstance(app.screen, Confirm) is (letter == "z")
            assert session.sent == sent, letter
            if letter == "z":
                await pilot.press("escape")


async def test_the_selector_chooses_a_drive_of_any_bus() -> None:
    async with on_screen() as (pilot, app, session):
        await pilot.press("ctrl+o", "down", "enter")
        assert session.selected is not None
        assert session.selected.address == "b"
        await settle(pilot)
        assert app.main.lines("label").plain == " press:clamp ▸ "
        await pilot.press("alt+2")
        assert app.main.lines("label").plain == " eth ▸ "
        del session.buses["press"], session.buses["pmx"]
        await emit(pilot, StateChanged(session.time))
        assert app.main.lines("label").plain == " ▸ ", "where one is open, nothing else can be meant"


async def test_everything_is_in_the_palette() -> None:
    async with on_screen() as (pilot, app, _):
        await settle(pilot)
        titles = {command.title for command in app.act.commands()}
    assert titles >= {
        "Stop all",
        "Record a macro",
        "Play shuttle",
        "Drive press b clamp",
        "Show bus eth",
        "Panel plot on or off",
    }
    assert titles >= {"Open a connection", "Polling off", "Mouse off", "Theme", "Help", "Quit", "Copy the view"}


async def test_only_what_is_shown_is_polled_and_only_while_it_is() -> None:
    session = demo_session()
    app = make_app(session)
    press, eth, pmx = (session.buses[name].telemetry for name in ("press", "eth", "pmx"))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert press.polled == {"a": REST_PERIOD, "b": OTHERS_PERIOD, "c": OTHERS_PERIOD}
        assert (eth.polled, pmx.polled) == ({"": OTHERS_PERIOD}, {}), "a lost bus is not polled"
        await pilot.press("ctrl+g", "ctrl+g")
        await emit(pilot, OnBus("press", Sample(session.time, "a", 5, 7)))
        assert press.polled["a"] == STATUS, "a column of dots of 20 s takes longer"
        await pilot.press("ctrl+g", "ctrl+g")
        await settle(pilot)
        assert press.polled["a"] == STATUS
        app.act.action_polling()
        await settle(pilot)
        assert press.polled == eth.polled == {}
        app.act.action_polling()
    assert press.polled == eth.polled == {}, "nothing is polled for a screen that is gone"


async def test_a_plotted_drive_is_read_once_for_each_column_of_dots_and_on_the_page_for_measuring() -> None:
    session = demo_session()
    app = make_app(session)
    polled = session.buses["press"].telemetry
    async with app.run_test(size=(80, 24)) as pilot:
        session.plotted = (Series("press", "a"), Series("press", "b"))
        await pilot.press("ctrl+g", "ctrl+g")
        await emit(pilot, *(OnBus("press", Sample(session.time, address, 5, 7)) for address in "ab"))
        assert (polled.polled["a"], round(polled.polled["b"], 3)) == (STATUS, 0.147), (
            "140 columns of dots for some 20 s"
        )
        app.model.look.shorter(2)
        await settle(pilot)
        assert (round(polled.polled["a"], 3), round(polled.polled["b"], 3)) == (0.036, 0.036), "and for 5 s"
        app.model.look.shorter(1)
        await settle(pilot)
        assert polled.polled["a"] == polled.polled["b"] == PLOT, "2 s have finer columns than a person needs"
        app.model.look.automatic()
        await pilot.press("ctrl+g")
        await settle(pilot)
        assert polled.polled["a"] == polled.polled["b"] == PLOT


async def test_a_drive_that_was_sent_a_line_or_moves_is_looked_at_more_often() -> None:
    session = demo_session()
    app = make_app(session)
    polled = session.buses["press"].telemetry
    async with app.run_test(size=(80, 24)) as pilot:
        await emit(pilot, Entered(session.time, "@b MR 5", By.OPERATOR, "press", "b"))
        assert polled.polled == {"a": REST_PERIOD, "b": LIVELY, "c": OTHERS_PERIOD}
        session.time += 10
        await emit(pilot, OnBus("press", Sample(session.time, "b", 5, 7)))
        assert polled.polled["b"] == LIVELY
        await emit(pilot, OnBus("press", Sample(session.time, "b", 5, 0)))
        assert polled.polled["b"] == OTHERS_PERIOD


async def test_a_lost_bus_says_so_on_its_tab_and_the_others_go_on() -> None:
    async with on_screen(width=100) as (pilot, app, session):
        session.emit(OnBus("press", Sample(session.time, "a", 0, 0)))
        session.buses["press"].lost = TransportLost("/dev/ttyUSB0: unplugged")
        await emit(pilot, StateChanged(session.time), OnBus("eth", Sample(session.time, "", 5, 7)))
        top = app.main.lines("top").plain
        assert "1 press ✗ lost" in top
        assert "2 eth ▶ moving" in top
        assert "LOST - /dev/ttyUSB0: unplugged" in app.main.query_one(".banner").plain  # type: ignore[attr-defined]
        await press(pilot, "alt+2")
        assert not app.main.query_one(".banner").display


async def test_events_of_a_hidden_bus_wait_in_its_transcript() -> None:
    async with on_screen() as (pilot, app, session):
        await emit(pilot, OnBus("eth", Unsolicited(session.time, ("12 parts",))))
        assert "12 parts" not in app.main.page("press").plain
        await press(pilot, "alt+2")
        assert "« 12 parts" in app.main.page("eth").plain


async def test_the_first_screen_opens_what_is_chosen_and_stays_when_it_cannot() -> None:
    session = FakeSession()
    session.openable["/dev/ttyUSB0"] = FakeBus("ttyUSB0", {"a": FakeDrive("a")})
    async with on_screen(session) as (pilot, app, _):
        await pilot.press("enter")
        await pilot.pause()
        assert isinstance(app.screen, Start)
        assert "✗ press: no such port" in str(app.screen.query_one("#outcome").render())
        await press(pilot, "escape", "down", "enter")
        assert app.screen is app.main
        assert "1 ttyUSB0" in app.main.lines("top").plain


async def test_what_cannot_be_opened_at_the_start_leads_to_the_first_screen_with_the_reason() -> None:
    app = make_app(FakeSession(), "tcp://nowhere:503")
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert isinstance(app.screen, Start)
        assert "tcp://nowhere:503: no such port" in str(app.screen.query_one("#outcome").render())


async def test_a_small_terminal_says_so_and_comes_back_by_itself() -> None:
    async with on_screen() as (pilot, app, _):
        await pilot.resize_terminal(50, 24)
        await pilot.pause()
        assert isinstance(app.screen, TooSmall)
        said = str(app.screen.query_one("#too-small").render())
        assert said == "too small: 60x15 needed, this is 50x24; ^X still stops"
        await pilot.press("f1", "ctrl+o")
        assert isinstance(app.screen, TooSmall)
        await pilot.resize_terminal(60, 15)
        await pilot.pause()
        assert app.screen is app.main


async def test_a_bug_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    session = demo_session()

    async def run(line: str, origin: object = None, since: int | None = None) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(session, "run", run)
    app = make_app(session)
    with pytest.raises(WorkerFailed, match="a bug"):
        async with app.run_test(size=(80, 24)) as pilot:
            await press(pilot, "E", "enter")


async def test_ctrl_c_explains_and_ctrl_q_quits() -> None:
    async with on_screen() as (pilot, app, _):
        await pilot.press("ctrl+c")
        assert app.is_running
        assert toasts(app) == ["Ctrl+Q quits, Ctrl+X stops all drives"]
        await pilot.press("ctrl+q")
    assert app.return_value == 0


@pytest.fixture
def heard_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keys count without a pause after a question has come."""
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)


@pytest.mark.usefixtures("heard_at_once")
async def test_quitting_asks_while_automation_runs_or_a_drive_moves() -> None:
    session = demo_session()
    session.busy = True
    async with on_screen(session) as (pilot, app, _):
        await pilot.press("ctrl+q")
        assert [key for key, _ in app.screen.answers] == ["stop", "stay"]  # type: ignore[attr-defined]
        await pilot.press("escape")
        assert app.is_running
        session.busy = False
        session.moves = [
            "press:a moves at 600000 a second",
            "line:b is not known: last seen moving at 5 a second 3 s ago",
        ]
        await pilot.press("ctrl+q")
        assert app.screen.lines == session.moves  # type: ignore[attr-defined]
        await pilot.press("enter")
        await pilot.pause()
    assert (session.stops, app.return_value) == (1, 0)


@pytest.mark.usefixtures("heard_at_once")
async def test_quitting_asks_in_a_small_terminal_too_and_only_once() -> None:
    session = demo_session()
    session.busy = True
    async with on_screen(session, 50, 12) as (pilot, app, _):
        await pilot.press("ctrl+q", "ctrl+q")
        assert [type(screen).__name__ for screen in app.screen_stack] == ["MainScreen", "Confirm"]
        await pilot.press("escape")
        await pilot.pause()
        assert isinstance(app.screen, TooSmall)


async def test_quit_as_a_line_ends_the_app_too() -> None:
    async with on_screen() as (pilot, app, session):
        session.quitting = True
        await emit(pilot, StateChanged(session.time))
    assert app.return_value == 0


@pytest.mark.usefixtures("heard_at_once")
async def test_quit_as_a_line_asks_like_the_key() -> None:
    session = demo_session()
    session.moves = ["press:a moves at 5 a second"]
    async with on_screen(session) as (pilot, app, _):
        assert session.front.before_quit is not None
        asked = asyncio.ensure_future(session.front.before_quit())
        await pilot.pause()
        assert app.screen.lines == session.moves  # type: ignore[attr-defined]
        await pilot.press("down", "enter")
        assert await asked
    assert (session.stops, app.return_value) == (0, 0)


async def test_a_signal_stops_automation_and_nothing_else() -> None:
    async with on_screen() as (pilot, app, session):
        app.interrupted()
        await pilot.pause()
    assert (session.interrupts, session.stops, app.return_value) == (1, 0, 130)


async def test_a_drive_in_program_mode_is_marked_where_lines_are_typed() -> None:
    async with on_screen() as (pilot, app, session):
        session.buses["press"].drives["a"].programming = True
        await emit(pilot, StateChanged(session.time))
        assert "◆ stores" in app.main.lines("label").plain
        assert f"◆ {ReadoutState.STORING.word}" in app.main.lines("status").plain


async def test_the_meaning_of_what_is_typed_stands_beside_it_where_there_is_room() -> None:
    async with on_screen(width=120, height=40) as (pilot, app, _):
        await pilot.press(*"MR ")
        await pilot.pause()
        assert "move relative to where it stands" in app.main.lines("hint").plain


async def test_a_closed_bus_takes_its_transcript_with_it() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, "alt+2")
        del session.buses["eth"]
        session.selected_bus = "press"
        await emit(pilot, StateChanged(session.time))
        assert "eth" not in app.main.pages
        assert "eth" not in app.main.lines("top").plain


async def test_a_key_with_two_macros_plays_neither_and_says_so() -> None:
    session = demo_session()
    session.macros = FakeMacros(FakeMacro("away", "F3"), FakeMacro("back", "F3"), FakeMacro("home-all", "F2"))
    async with on_screen(session, width=100) as (pilot, app, _):
        await settle(pilot)
        assert "F3 2 macros!" in app.main.lines("footer").plain
        await press(pilot, "f3", "f2")
        assert session.lines == [("/play home-all", By.OPERATOR)]
        assert "away and back are both on F3" in app.main.page("press").plain


async def test_a_renamed_bus_keeps_its_transcript_its_values_and_the_line_that_is_typed() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, *"PR P", "enter", *"MR 5")
        session.buses = {("gantry" if name == "press" else name): bus for name, bus in session.buses.items()}
        session.buses["gantry"].name = session.selected_bus = "gantry"
        session.addresses["gantry"] = "a"
        assert session.front.renamed is not None
        session.front.renamed("press", "gantry")
        await emit(pilot, StateChanged(session.time))
        assert "1 gantry" in app.main.lines("top").plain and "press" not in app.main.lines("top").plain
        assert "› PR P" in app.main.page("gantry").plain and app.main.entry.value == "MR 5"
        await press(pilot, "enter")
        assert session.sent[-1] == "gantry:a MR 5"
