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
from textual.geometry import Region
from textual.pilot import Pilot

from multidrop.dialects.values import Conditions
from multidrop.drives.events import Conditioned, Sample
from multidrop.shell.configuration import Settings
from multidrop.shell.events import By, Entered, Failed, OnBus, ProgramRead
from multidrop.shell.session import Session
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from multidrop.tui.panels.facts import cards_rows, next_rows, selected_rows
from multidrop.tui.panels.table import panel
from tests.support.fake_session import demo_session, emit, make_app, on_screen, painted, press, settle
from tests.support.panel_rows import plain, view

pytestmark = pytest.mark.tui

ENOUGH = 0.7
"""The least share of the rows between head and foot that carry something in a half of the width."""
MOVES = ("@b SL 20000", "@c SL -50000", "SL 100000")
BORDERS = "│├┤┼─┬┴ "


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


def carried(app: MultidropApp) -> list[float]:
    """The share of the rows that carry something, of each half; the unfilled end of the transcript is not counted."""
    rows = ["".join(segment.text for segment in strip) for strip in painted(app.main)]
    body, transcript = app.main.query_one("#body").region, app.main.transcript
    unfilled = Region.from_corners(
        transcript.region.x, transcript.region.y + len(transcript.plain.split("\n")), *transcript.region.bottom_right
    )
    found = []
    for left, right in ((0, app.size.width // 2), (app.size.width // 2, app.size.width)):
        counted = [
            y for y in range(body.y, body.bottom) if not (unfilled.contains(left, y) and unfilled.right >= right)
        ]
        found.append(sum(bool(rows[y][left:right].strip(BORDERS)) for y in counted) / len(counted))
    return found


@pytest.mark.parametrize("moves", [(), MOVES], ids=["at rest", "three move"])
@pytest.mark.parametrize("size", [(120, 40), (200, 50)])
async def test_most_rows_carry_something_in_each_half_of_the_width(
    size: tuple[int, int], moves: tuple[str, ...]
) -> None:
    async with the_demo(size) as (pilot, app):
        for line in moves:
            app.main.entry.value = line
            await pilot.press("enter")
            await asyncio.sleep(0.3)
        await settle(pilot)
        assert ("plot last" in app.main.lines("panel").plain + app.main.lines("far").plain) is bool(moves)
        left, right = carried(app)
    assert min(left, right) >= ENOUGH, (left, right)


@pytest.mark.parametrize("size", [(120, 40), (200, 50)])
async def test_places_rest_on_the_size_alone(size: tuple[int, int]) -> None:
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
        assert "lines and drives" in below.plain
        for bus, address in (("press", "b"), ("eth", "")):
            samples = [Sample(session.time - 2 + n / 10, address, n * 1000, 1000 + n) for n in range(20)]
            await emit(pilot, *(OnBus(bus, each) for each in samples))
        assert "plot last 20 s" in below.plain and "lines and drives" not in below.plain
        for name, last in ((name, last) for name in ("press:b", "eth") for last in (1019, 19000)):
            assert re.search(rf"{name}( clamp)? +{last} ", below.plain), "a legend by name, with the last value"
        assert session.buses["eth"].telemetry.polled[""] == 0.25  # a curve is no reason to poll faster
        session.time += 25
        await emit(pilot, OnBus("press", Sample(session.time, "b", 20_000, 0)))
        assert "lines and drives" in below.plain


async def test_a_key_gives_the_room_of_the_plot_to_the_transcript_and_a_split_takes_it() -> None:
    async with on_screen(width=120, height=40) as (pilot, app, _):
        await settle(pilot)
        small = app.main.transcript.size.height
        await press(pilot, "ctrl+g", "ctrl+g", "escape")
        assert app.main.transcript.size.height > small + 10 and not app.main.lines("panel").display
        await press(pilot, "ctrl+g", "ctrl+g", "escape")
        await app.run_action("act.split")
        await press(pilot, "down", "enter")
        assert not app.main.lines("panel").display and "lines and drives" in app.main.lines("side").plain


def test_a_card_says_what_a_drive_is_and_what_was_last_known_of_it() -> None:
    session = demo_session()
    session.units.give("b", "5 mm/turn")
    at = session.time
    shown = view(
        session,
        Entered(at, "PR VX", By.OPERATOR, "press", "b"),
        Failed(at, "b refused 'PR VX': error 35: this cannot be printed", "press", "b", code=35),
        Failed(at, "b does not reply", "press", "b"),
        Entered(at, "/list b", By.OPERATOR, "press", "b"),
        ProgramRead(at, "press", "b", ((1, "H"), (3, "E"))),
    )
    text = plain(*cards_rows(shown, 60, 40))
    for words in (
        "press sim:#press",
        "b clamp    LMDCM 6.002",
        "5 mm/turn",
        "2 lines, read 12:41:07",
        "12:41:07 error 35: this cannot be printed",
        "12:41:07 PR VX",
        "✗ lost: tcp://10.0.0.5:503: closed",
    ):
        assert words in text, words
    assert "a gantry" not in text  # the selected drive has a panel
    assert "not read: /list a" in plain(*selected_rows(shown, 60, 14))


def test_what_to_press_begins_with_what_the_state_asks_for() -> None:
    session = demo_session()
    session.latched, session.recording = True, "go"
    first = [row[0][0].strip() for row in next_rows(view(session), 40, 30)][:3]
    assert first == ["/resume", "/record stop", "/list a"]


def test_what_to_press_clears_the_error_of_whichever_axis_has_one_or_explains_its_number() -> None:
    session = demo_session()
    x = Conditions("x")

    def asked(wrong: Conditions) -> tuple[str, str]:
        shown = view(session, OnBus("press", Conditioned(session.time, "a", (x, wrong))))
        return next((row[0][0].strip(), row[1][0].strip()) for row in next_rows(shown, 90, 30))

    limit = Conditions("y", error=128, error_text="plus limit error", clears="CLRY")
    assert asked(limit) == ("CLRY", "clears it: plus limit error")
    assert asked(replace(limit, clears=""))[0] == "/help 128"


async def test_what_to_press_has_the_macros_and_the_keys_that_a_person_set() -> None:
    async with on_screen(width=200, height=50) as (pilot, app, _):
        await settle(pilot)
        side = app.main.lines("side").plain
        assert "F2           home-all: all axes to their switches" in side and "F3           plays shuttle" in side
        assert "^A           every drive of every line" in side and "^K           play, record" in side


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
        assert "LMDCE" in below and "velocity eth steps/s" in below and "not read: /list" in below
