"""Ctrl+X stops: from every screen, in every state, before any queue, ahead of the event loop."""

from __future__ import annotations

import asyncio
import threading
from typing import cast

import pytest
from textual import events
from textual.pilot import Pilot

from multidrop.drives.stopping import Fate
from multidrop.shell import stop_report
from multidrop.shell.events import By
from multidrop.tui.app import MultidropApp, is_stop
from multidrop.tui.panels.drive import program_words
from multidrop.tui.panels.view import glances_of
from multidrop.tui.polling import LIVELY, STATUS
from multidrop.tui.readout import ReadoutState
from multidrop.tui.screen_model import ScreenModel, bus_state
from multidrop.tui.screens.dialogs import Ask, Choose, Confirm, SearchDialog, TooSmall
from multidrop.tui.screens.start import Start
from multidrop.tui.terminal.keystream import STOP
from tests.support.cell_session import CellSession, bus, party
from tests.support.fake_session import (
    FakeSession,
    a_move,
    demo_session,
    emit,
    make_app,
    on_screen,
    press,
    readable,
    settle,
)
from tests.support.pty_screen import demo
from tests.support.until import PATIENCE

SCREENS = {
    "main": ((), None),
    "typing with its list open": (tuple("M"), None),
    "typing with text selected": (("M", "R", "shift+home"), None),
    "help": (("f1",), SearchDialog),
    "drive selector": (("ctrl+o",), Choose),
    "palette": (("ctrl+p",), SearchDialog),
    "palette being searched": (("ctrl+p", "s", "t"), SearchDialog),
    "history being searched": (("ctrl+r", "M"), SearchDialog),
    "name of a recording": (("ctrl+p", *"record a", "enter", "x"), Ask),
    "themes": (("ctrl+p", *"theme", "enter"), Choose),
}


def banner(app: MultidropApp) -> str:
    return str(app.main.query_one(".banner").plain) if app.main.query_one(".banner").display else ""


@pytest.mark.tui
async def test_it_stops_from_every_screen_and_says_so() -> None:
    async with on_screen() as (pilot, app, _):
        for name in SCREENS:
            await stopped_from(pilot, app, name)


async def stopped_from(pilot: Pilot[int], app: MultidropApp, name: str) -> None:
    """Go to a screen of an app that stands, and press the stop key there."""
    keys, screen = SCREENS[name]
    session = cast(FakeSession, app.session)
    session.latched, before = False, session.stops
    await pilot.press(*keys)
    assert screen is None or isinstance(app.screen, screen), name
    await pilot.press("ctrl+x")
    assert session.stops == before + 1, name
    await settle(pilot)
    assert "✗ STOP SENT 12:41:07   5 not read yet" in banner(app), name
    assert app.screen is app.main, f"{name}: what was being asked is cancelled"
    assert app.main.entry.value == "", f"{name}: what was typed before it is not sent after it"
    assert session.lines == [], name


@pytest.mark.tui
async def test_it_stops_under_the_questions_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)
    session = demo_session()
    session.busy = True
    async with on_screen(session) as (pilot, app, _):
        await pilot.press("ctrl+q")
        while app.leaving.undecided:
            await pilot.pause()
        assert isinstance(app.screen, Confirm)
        await pilot.press("ctrl+x")
        assert session.stops == 1
        assert app.screen is app.main
        app.post_message(events.Paste("PG 1\nMR 5\n"))
        await pilot.pause()
        assert isinstance(app.screen, Confirm)
        await pilot.press("ctrl+x")
        assert session.stops == 2


@pytest.mark.tui
async def test_it_stops_on_the_first_screen_and_shows_it_there() -> None:
    session = FakeSession()
    async with on_screen(session) as (pilot, app, _):
        assert isinstance(app.screen, Start)
        await pilot.press("tab", "t", "ctrl+x")
        assert session.stops == 1
        await settle(pilot)
        assert "· NO STOP SENT   no drive is open" in app.screen.query_one(".banner").plain  # type: ignore[attr-defined]


@pytest.mark.tui
async def test_it_stops_when_the_terminal_is_too_small() -> None:
    async with on_screen(width=59, height=20) as (pilot, app, session):
        assert isinstance(app.screen, TooSmall)
        await pilot.press("ctrl+x")
        assert session.stops == 1


@pytest.mark.tui
async def test_after_a_stop_every_drive_is_looked_at_and_none_is_said_to_stand_unread() -> None:
    async with on_screen() as (pilot, app, session):
        await emit(pilot, *a_move(session))
        assert "b clamp  ■ at rest" in app.main.lines("status").plain
        await press(pilot, "ctrl+x")
        assert "b clamp  ■ 0.9 s ago" in app.main.lines("status").plain
        assert set(session.buses["press"].telemetry.polled.values()) == {STATUS, LIVELY}


@pytest.mark.tui
async def test_the_banner_follows_what_is_read_without_a_word_from_anybody() -> None:
    async with on_screen(width=120, height=40) as (pilot, app, session):
        await pilot.press("ctrl+x")
        session.fates = {f"press:{name}": Fate.STANDING for name in "abc"} | {"pmx:00": Fate.NOT_REACHED}
        await settle(pilot)
        assert banner(app).strip() == (
            "‼ STOP SENT 12:41:07   3 at rest   1 not read yet   1 NOT REACHED: pmx (lost) - use the E-stop"
        )
        session.fates |= {"eth:": Fate.STANDING, "pmx:00": Fate.STANDING}
        await settle(pilot)
        assert banner(app).strip().startswith("✗ LOST - "), "a bus is lost, though all stood before"
        session.buses["pmx"].lost = None
        await settle(pilot)
        assert banner(app).strip().startswith("■ STOPPED   velocity 0 was read from all 5")


DWELLS = 'program_text = """\nPG 1\nLB G1\nMR 51200\nH\nH 500\nBR G1\nE\nPG\n"""'


@pytest.mark.virtual
async def test_rows_and_tabs_never_say_the_contrary_of_the_banner_on_a_line_of_twelve_programs(tmp_path):
    names = "abcdefghijkl"
    async with CellSession(tmp_path, bus("press", *(f"{party(name)}\n{DWELLS}" for name in names))) as shop:
        session, model = shop.session, ScreenModel(lambda: "press", lambda: {"press"})
        session.subscribe(model.take)
        line = session.buses["press"]
        polls = line.telemetry.subscribe(tuple(names), 2.0), line.telemetry.watch(tuple(names), 12.0)
        await session.run("@* EX G1")
        await asyncio.sleep(20.0)
        readouts = model.bus("press").readouts
        assert all(readouts[name].program.runs for name in names)
        deaf, escape = shop.device("press:g"), shop.device("press:g").escape
        deaf.escape = lambda now: None
        session.stop()
        model.stopped(session.now())
        said = set()

        def agree(_event: object) -> None:
            tally = session.tally()
            said.add(stop_report.headline(tally).split(" ")[1])
            for glance, found in zip(glances_of(session, model, line), tally.found, strict=True):
                row = f"{glance.sign(session.now())[0]} {program_words(glance.readout, session.now())}"
                if found.fate is Fate.STANDING:
                    assert "■" in row and "program" not in row, (found, row)
                assert found.fate is not Fate.RUNNING or "program running" in row
            runs = any(each.fate is Fate.RUNNING for each in tally.found)
            state = bus_state(model.bus("press"), list(names), False)
            assert (
                state in (ReadoutState.MOVING, ReadoutState.DWELL)
                if runs
                else state is not ReadoutState.AT_REST or tally.stand
            )

        session.subscribe(agree)
        await asyncio.sleep(5.0)
        assert "STOPPED" not in said and any(each.fate is not Fate.STANDING for each in session.tally().found)
        deaf.escape = escape
        session.stop()
        model.stopped(session.now())
        await asyncio.sleep(5.0)
        assert said == {"STOP", "STOPPED"} and bus_state(model.bus("press"), list(names), False) is ReadoutState.AT_REST
        for each in polls:
            each.close()


@pytest.mark.tui
async def test_it_does_not_wait_for_what_the_app_is_doing() -> None:
    session = demo_session()
    app = make_app(session)
    async with app.run_test(size=(80, 24)):
        for char in "MR 5":
            app.post_message(events.Key(char, char))
        app.post_message(events.Key("ctrl+x", STOP.decode()))
        assert session.stops == 1, "stopped inside post_message, while the keys before it still wait"


@pytest.mark.tui
async def test_the_banner_goes_when_automation_may_run_again() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, "ctrl+x")
        assert banner(app)
        session.resume()
        await settle(pilot)
        assert not banner(app)


@pytest.mark.tui
async def test_escape_closes_and_never_stops() -> None:
    async with on_screen() as (pilot, app, session):
        for opener in ("f1", "ctrl+o", "ctrl+p", "ctrl+r", "M"):
            await pilot.press(opener, "escape")
            await pilot.pause()
        assert app.screen is app.main
        assert not app.main.entry.listing.open
        assert session.stops == 0


@pytest.mark.tui
async def test_pasted_lines_that_wait_are_never_sent_after_a_stop() -> None:
    session = demo_session()
    session.gate = asyncio.Event()
    async with on_screen(session) as (pilot, app, _):
        await paste(pilot, "MR 1\nMR 2\nMR 3\n")
        readable(pilot)
        await pilot.press("enter")
        await pilot.pause()
        assert session.lines == [("MR 1", By.OPERATOR)]
        await pilot.press("ctrl+x")
        session.gate.set()
        await settle(pilot)
        assert session.lines == [("MR 1", By.OPERATOR)]
        assert "stopped; 2 lines were not sent: MR 2 · MR 3" in app.main.page("press").plain


async def paste(pilot: Pilot[int], text: str) -> None:
    pilot.app.post_message(events.Paste(text))
    await pilot.pause()


@pytest.mark.parametrize("key", ["ctrl+x", "ctrl+X", "ctrl+shift+x", "alt+ctrl+x"])
def test_however_a_terminal_spells_it_it_is_the_stop(key: str) -> None:
    assert is_stop(events.Key(key, None))


@pytest.mark.parametrize("key", ["x", "X", "alt+x", "ctrl+c", "escape"])
def test_nothing_else_is(key: str) -> None:
    assert not is_stop(events.Key(key, None))


# Ahead of the event loop


@pytest.mark.tui
async def test_the_stop_is_written_while_the_event_loop_is_held_up() -> None:
    session = demo_session()
    written = threading.Event()
    session.stop_ahead = written.set
    async with demo(session) as (screen, _, _):
        screen.write(b"MR 5\x18")
        assert written.wait(PATIENCE)  # and nothing else runs in the loop meanwhile
        assert session.stops == 0
        await screen.rest()
        assert (session.stops, session.lines) == (1, [])
