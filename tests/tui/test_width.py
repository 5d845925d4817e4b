"""The use of the width: on a large screen nearly every row carries something in each half of it."""

from __future__ import annotations

import asyncio
import contextlib
import re
import tempfile
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest
from textual.pilot import Pilot

from multidrop.dialects.values import Conditions
from multidrop.drives.events import Conditioned, Sample
from multidrop.drives.stopping import Fate
from multidrop.shell.configuration import Settings
from multidrop.shell.events import By, Entered, Failed, OnBus, ProgramRead
from multidrop.shell.session import Session
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from multidrop.tui.panels.facts import next_rows, selected_rows
from multidrop.tui.panels.table import panel
from tests.support.fake_session import demo_session, emit, make_app, on_screen, painted, press, settle
from tests.support.panel_rows import own_keys, plain, view

pytestmark = pytest.mark.tui

MOST_WORDS = 220
"""The words on the screen at rest; a word is what is left after splitting at spaces."""
UNKNOWN = ("not read", "none seen", "nothing yet", "not known", "no error")


@contextlib.asynccontextmanager
async def the_demo(size: tuple[int, int]) -> AsyncIterator[tuple[Pilot[int], MultidropApp]]:
    """The app on the demo cell, two seconds after its lines are open."""
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings({}, Path(folder) / "config", Path(folder) / "state", data=Path(folder) / "data")
        session = Session(settings)
        app = MultidropApp(session, ["sim:"], Assist(session, settings))
        try:
            async with app.run_test(size=size) as pilot:
                while len(session.buses) < 3 or not all(bus.drives for bus in session.buses.values()):
                    await asyncio.sleep(0.05)
                await asyncio.sleep(2.0)
                await settle(pilot)
                yield pilot, app
        finally:
            await session.close()


async def test_the_screen_of_a_machine_at_rest_is_calm_and_says_nothing_of_what_is_not_known() -> None:
    async with the_demo((120, 40)) as (_, app):
        shown = "\n".join("".join(segment.text for segment in strip) for strip in painted(app.main))
    assert len(shown.split()) <= MOST_WORDS, shown
    assert not [words for words in UNKNOWN if words in shown], shown


@pytest.mark.parametrize("size", [(120, 40), (200, 50)])
async def test_the_places_depend_on_the_size_alone(size: tuple[int, int]) -> None:
    """What moves, what is read and what is in trouble change the contents of a place, and never where it is."""
    session = demo_session()
    app = make_app(session)

    def titles() -> list[tuple[str, int]]:
        found = []
        for name, places in app.main.columns():
            rows = app.main.lines(name).plain.split("\n")
            found += [(name, y) for y, row in enumerate(rows) if row[:1] in "├┼─" and row[:1]]
            assert len(rows) == app.main.size_of(name).height and places
        return found

    async with app.run_test(size=size) as pilot:
        await settle(pilot)
        before = titles()
        await emit(pilot, *(OnBus("press", Sample(session.time, each, 5, 70_000)) for each in "abc"))
        assert set(before) <= set(titles())
        await emit(pilot, ProgramRead(session.time, "press", "a", tuple((n, "H") for n in range(1, 60))))
        assert set(before) <= set(titles())


async def test_the_plot_has_a_curve_for_each_drive_that_moves_and_goes_when_they_rest() -> None:
    async with on_screen(width=120, height=40) as (pilot, app, session):
        below = app.main.lines("panel")
        await settle(pilot)
        assert "drive        state" in below.plain and "plot" not in below.plain
        for bus, address in (("press", "b"), ("eth", "")):
            samples = [Sample(session.time - 2 + n / 10, address, n * 1000, 1000 + n) for n in range(20)]
            await emit(pilot, *(OnBus(bus, each) for each in samples))
        assert "plot last 20 s" in below.plain and "drive        state" in below.plain
        for name, last in ((name, last) for name in ("press:b", "eth") for last in (1019, 19000)):
            assert re.search(rf"{name}( clamp)? +{last} ", below.plain), "a legend by name, with the last value"
        assert session.buses["eth"].telemetry.polled[""] == 0.25  # a curve is no reason to poll faster
        session.time += 25
        await emit(pilot, OnBus("press", Sample(session.time, "b", 20_000, 0)))
        assert "plot" not in below.plain


async def test_hidden_panels_give_their_room_to_the_transcript_and_a_split_takes_it() -> None:
    async with on_screen(width=120, height=40) as (pilot, app, _):
        await settle(pilot)
        small = app.main.transcript.size.height
        for name in ("drives", "plot"):
            await app.run_action(f"act.panel('{name}')")
        await settle(pilot)
        assert app.main.transcript.size.height > small + 10 and not app.main.lines("panel").display
        for name in ("drives", "plot"):
            await app.run_action(f"act.panel('{name}')")
        await app.run_action("act.split")
        await press(pilot, "down", "enter")
        assert not app.main.lines("panel").display and "├ drives " in app.main.lines("side").plain


def test_the_panel_of_a_drive_has_what_is_known_of_it_and_nothing_else() -> None:
    session = demo_session()
    session.units.give("a", "5 mm/turn")
    at = session.time
    shown = view(
        session,
        Entered(at, "PR VX", By.OPERATOR, "press", "a"),
        Failed(at, "a refused 'PR VX': error 35: this cannot be printed", "press", "a", code=35),
        Failed(at, "a does not reply", "press", "a"),
        Entered(at, "/list a", By.OPERATOR, "press", "a"),
        ProgramRead(at, "press", "a", ((1, "H"), (3, "E"))),
    )
    text = plain(*selected_rows(shown, 60, 20))
    for words in ("5 mm/turn", "2 lines, read 12:41:07", "12:41:07 error 35: this cannot be printed", "12:41:07 PR VX"):
        assert words in text, words
    nothing = plain(*selected_rows(view(demo_session()), 60, 20))
    assert not [word for word in ("program", "last", "units", "travel", "none seen") if word in nothing], nothing


def test_what_is_next_begins_with_what_the_state_asks_for() -> None:
    session = demo_session()
    session.latched, session.recording = True, "go"
    keys = replace(view(session), keys=own_keys())
    assert [row[0][0].strip() for row in next_rows(keys, 40, 30)] == ["/record stop", "^N", "^E"], "not read since"
    session.fates = {f"{bus.name}:{each}": Fate.STANDING for bus in session.buses.values() for each in bus.drives}
    assert [row[0][0].strip() for row in next_rows(keys, 40, 30)] == ["/resume", "/record stop", "^N"]
    calm = replace(view(demo_session()), keys=own_keys())
    assert [row[0][0].strip() for row in next_rows(calm, 40, 30)] == ["^N", "^E", "^G"]


def test_what_is_next_clears_the_error_of_whichever_axis_has_one_or_explains_its_number() -> None:
    session = demo_session()
    x = Conditions("x")

    def asked(wrong: Conditions) -> tuple[str, str]:
        shown = view(session, OnBus("press", Conditioned(session.time, "a", (x, wrong))))
        return next((row[0][0].strip(), row[1][0].strip()) for row in next_rows(shown, 90, 30))

    limit = Conditions("y", error=128, error_text="plus limit error", clears="CLRY")
    assert asked(limit) == ("CLRY", "clears it: plus limit error")
    assert asked(replace(limit, clears=""))[0] == "/help 128"


async def test_what_is_next_has_the_macros_on_keys() -> None:
    async with on_screen(width=200, height=50) as (pilot, app, _):
        await settle(pilot)
        side = app.main.lines("side").plain
        assert re.search(r"F2 +home-all: all axes to their switches", side) and re.search(r"F3 +plays shuttle", side)


def test_a_program_that_is_not_known_gives_its_room_away() -> None:
    session = demo_session()
    assert not panel("program").shows(view(session))
    assert panel("program").shows(view(session, ProgramRead(session.time, "press", "a", ((1, "H"),))))


async def test_the_page_of_all_drives_shows_the_chosen_one_in_the_room_that_the_list_leaves() -> None:
    async with on_screen(width=120, height=40) as (pilot, app, session):
        samples = [Sample(session.time - 2 + n / 10, "", n * 1000, 1000 + n) for n in range(20)]
        await emit(pilot, *(OnBus("eth", each) for each in samples))
        await press(pilot, "ctrl+a", *"eth")
        below = app.screen.lines("chosen").plain  # type: ignore[attr-defined]
        assert "LMDCE" in below and "velocity eth steps/s" in below
