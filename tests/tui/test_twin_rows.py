"""A drive beside its twin: the panel of the drive, rows of drives, tabs and plots, as functions of what was said."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.drives.events import Conditioned, Sample
from multidrop.shell.events import Agreed, By, OnBus, Predicted, SessionEvent, TwinEnded
from multidrop.shell.roles import DIFFERENCE, Series
from multidrop.tui.curves.raster import ASCII, BLOCK, BRAILLE, TWINS, Ink
from multidrop.tui.panels.drive import drive_rows
from multidrop.tui.panels.drive_columns import ALL_DRIVES
from multidrop.tui.panels.drive_table import drives_rows
from multidrop.tui.panels.drives import kept, narrow_rows
from multidrop.tui.panels.machine import summary, worst_first
from multidrop.tui.panels.plot import plot_rows, plot_title
from multidrop.tui.polling import Polling
from multidrop.tui.presenter import trouble_mark
from multidrop.tui.readout import ReadoutState
from multidrop.tui.screen_model import bus_state
from multidrop.tui.widgets.lines import Row, width_of
from multidrop.tui.widgets.theme import Signs, shown_as
from tests.support.fake_session import AT_LIMIT, FakeSession, demo_session, emit, make_app, on_screen, press
from tests.support.fake_twin import beside, isolated
from tests.support.panel_rows import view


def plain(*rows: Row) -> str:
    return "\n".join("".join(text for text, _ in row).rstrip() for row in rows)


def roles(row: Row) -> set[str]:
    return {role for text, role in row if text.strip()}


# The panel of the drive


@pytest.fixture
def session() -> FakeSession:
    return demo_session()


def test_what_is_predicted_is_below_what_is_measured(session: FakeSession) -> None:
    rows = drive_rows(view(session, *beside(session.time, 384_112, 600_000, -14)), 45, 20)
    assert plain(*rows[:4]).splitlines() == [
        " ▶ moving                     600000 steps/s",
        "       384112 steps",
        "       384098 twin            599986 steps/s",
        "          +14 difference",
    ]
    assert "error" not in roles(rows[3])


def test_a_divergence_has_a_sign_its_limit_and_its_causes(session: FakeSession) -> None:
    rows = drive_rows(view(session, *beside(session.time, 0, 0, 8112), isolated(session)), 45, 20)
    assert plain(*rows[3:5]).splitlines() == [
        " ≠      -8112 difference           limit 200",
        "   stall, load",
    ]
    assert "error" in roles(rows[3]) and roles(rows[4]) == {"error"}
    after = view(
        session, *beside(session.time, 0, 0, 8112), isolated(session), OnBus("press", Agreed(session.time, "a"))
    )
    assert "≠" not in plain(*drive_rows(after, 45, 20))


def test_a_twin_that_ended_is_not_shown(session: FakeSession) -> None:
    ended = OnBus("press", TwinEnded(session.time, "a"))
    shown = view(session, *beside(session.time, 0, 0, 8112), isolated(session), ended)
    text = plain(*drive_rows(shown, 45, 20), *narrow_rows(shown, 80))
    assert "twin" not in text and "≠" not in text and trouble_mark(shown.model.bus("press"), ["a"], False) == ""
    assert "a gantry twin at rest at 8112" in plain(*plot_rows(shown, 60, 20)), "it was there in the time shown"
    session.time += 21
    assert "twin" not in plain(*plot_rows(view(session, *beside(session.time - 21, 0, 0, 8112)), 60, 20))


def test_a_prediction_that_is_not_renewed_is_dim(session: FakeSession) -> None:
    old, new = beside(session.time - 3, 0, 0, 14), OnBus("press", Sample(session.time, "a", 0, 0))
    twin = drive_rows(view(session, *old, new), 45, 20)[2]
    assert roles(twin) == {"dim"} and roles(drive_rows(view(session, *old[:1], *old), 45, 20)[2]) == {"dim"}


def test_each_axis_has_its_own_twin(session: FakeSession) -> None:
    events = [*beside(session.time, 5, 0, 0, axis="x"), *beside(session.time, 7, 0, 9000, axis="y")]
    text = plain(*drive_rows(view(session, *events, isolated(session, axis="y")), 45, 20))
    assert "+0 difference" in text and "≠      -9000 difference" in text


def test_predictions_that_come_before_the_first_samples_make_no_further_axis(session: FakeSession) -> None:
    events = [*beside(session.time, 5, 0, 0, axis="x"), *beside(session.time, 7, 0, 0, axis="y")]
    shown = view(session, *reversed(events[1:]), *events)
    early = view(session, events[1], events[3], events[0], events[2])
    assert [axis.axis for axis in early.model.bus("press").readout("a").axes] == ["x", "y"]
    assert len(shown.model.bus("press").readout("a").axes) == 2


# Rows of drives, and tabs


def test_rows_of_drives_have_a_sign_and_as_many_causes_as_fit(session: FakeSession) -> None:
    shown = view(session, *beside(session.time, 0, 600_000, 8112), isolated(session))
    assert "600000/s ≠ -8112 stall, load" in plain(*narrow_rows(shown, 80))
    assert plain(drives_rows(shown, 45, 3)[0]).endswith("≠ -8112")
    agrees = view(session, *beside(session.time, 0, 0, 14))
    assert plain(narrow_rows(agrees, 80)[-1]).endswith("twin -14   polls 0.5 Hz")


@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_a_drive_that_differs_comes_first_of_all_drives(width: int, session: FakeSession) -> None:
    rests = OnBus("press", Sample(session.time, "c", 0, 0))
    shown = view(session, rests, *beside(session.time, 0, 0, 8112, "b"), isolated(session, "b"))
    places = worst_first(shown, "≠")
    assert [place.glance.address for place in places] == ["b"]
    assert next(place for place in worst_first(shown, "") if place.bus == "press").glance.address == "b"
    row = ALL_DRIVES.row(places[0], shown, width, False)
    assert "≠ -8112" in plain(row) and width_of(row) <= width
    assert kept(shown.glances, 1)[0].address == "a" and kept(shown.glances, 2)[1].address == "b"


def test_trouble_and_a_difference_are_both_said(session: FakeSession) -> None:
    error = OnBus("press", Conditioned(session.time, "a", (replace(AT_LIMIT, lamps=()),)))
    shown = view(session, *beside(session.time, 0, 0, 8112), isolated(session), error)
    assert plain(narrow_rows(shown, 80)[0]).endswith(" ✗ error ≠ -8112")
    assert plain(drives_rows(shown, 45, 3)[0]).endswith(" ✗ error ≠ -8112")
    assert plain(drives_rows(shown, 39, 3)[0]).endswith(" ✗ error ≠")
    places = worst_first(shown, "press")
    assert plain(ALL_DRIVES.row(places[0], shown, 120, False)).endswith(" ✗ error ≠ -8112")
    assert summary(places).startswith("1 error · 1 ≠ twin · ")


def test_a_tab_counts_a_drive_that_differs_as_trouble(session: FakeSession) -> None:
    facts = view(session, *beside(session.time, 0, 0, 8112), isolated(session)).model.bus("press")
    assert bus_state(facts, ["a"], False) is ReadoutState.DIFFERS and trouble_mark(facts, ["a"], False) == ""
    facts = view(session, *beside(session.time, 0, 9, 8112), isolated(session)).model.bus("press")
    assert bus_state(facts, ["a"], False) is ReadoutState.MOVING and trouble_mark(facts, ["a"], False) == "≠"
    assert bus_state(facts, ["a"], True) is ReadoutState.LOST and trouble_mark(facts, ["a"], True) == ""
    tab = make_app(session).presenter.tabs(session.time)[0]
    assert not tab.in_trouble and tab.__class__(1, "press", ReadoutState.DIFFERS, False).in_trouble


# Plots


def a_run(session: FakeSession, address: str = "a", ahead: int = 400_000) -> list[SessionEvent]:
    """Ten seconds in which the drive falls behind its twin."""
    found: list[SessionEvent] = []
    for n in range(200):
        found += beside(session.time - 10 + n / 20, n * 30_000, 600_000 + 100 * n, ahead * n // 200, address)
    return found


def test_a_plot_has_a_curve_of_the_twin_beside_that_of_the_drive(session: FakeSession) -> None:
    rows = plot_rows(view(session, *a_run(session)), 100, 30)
    text = plain(*rows)
    assert "drive 5970000" in text and "twin 6368000" in text and "velocity a gantry" in text
    assert {role for row in rows for part, role in row if part.endswith((" drive ", " twin "))} == {"series1"}, (
        "one colour a drive"
    )
    assert plain(plot_title(view(session, *a_run(session)))) == " plot last 20 s  20 Hz"


def test_a_narrow_plot_names_its_lines_in_the_title(session: FakeSession) -> None:
    assert "velocity a gantry steps/s ⠤⠤ drive ⠄ ⠠ twin" in plain(*plot_rows(view(session, *a_run(session)), 45, 20))
    session.plotted = (Series("press", "a"), Series("press", "b"))
    two = plain(*plot_rows(view(session, *a_run(session), *a_run(session, "b")), 60, 20))
    assert "velocity steps/s ⠤⠤ a ⠄ ⠠ a twin ⠄⠄ b ⠄ ⠠ b twin" in two


@pytest.mark.parametrize("ink", [BRAILLE, BLOCK, ASCII], ids=lambda ink: ink.name)
def test_without_colours_a_twin_is_told_apart(ink: Ink) -> None:
    assert ink.sample(TWINS) not in {ink.sample(number) for number in range(TWINS)}
    session = demo_session()
    shown = view(session, *a_run(session, ahead=5_000_000))
    shown.model.look.ink = ink
    rows = plot_rows(shown, 60, 20)
    curves = {"".join(text for text, role in row if role == "series1").strip() for row in rows}
    assert len(curves) > 4


@pytest.mark.parametrize(("ink", "share"), [(BRAILLE, 20), (BLOCK, 40)], ids=["full", "boxes"])
@pytest.mark.parametrize("slope", [(0, 1), (1, 0), (1, 1), (1, -1)])
def test_the_dots_of_a_twin_are_as_many_in_every_direction(slope: tuple[int, int], ink: Ink, share: int) -> None:
    line = [(100 + slope[0] * n, 500 + slope[1] * n) for n in range(100)]
    assert sum(len(ink.dots(TWINS, x, y, y)) for x, y in line) == share


def test_what_rests_where_its_twin_does_is_said_once(session: FakeSession) -> None:
    agree = [event for n in range(100) for event in beside(session.time - 5 + n / 20, 51_300, 0, 0)]
    assert plain(*plot_rows(view(session, *agree), 60, 20)) == " a gantry at rest at 51300 steps, its twin too"
    off = [event for n in range(100) for event in beside(session.time - 5 + n / 20, 51_300, 0, 0)[:1]]
    off += [OnBus("press", Predicted(session.time - 5 + n / 20, "a", 60_000, 0, -8_700)) for n in range(100)]
    assert plain(*plot_rows(view(session, *off), 60, 20)).splitlines() == [
        " a gantry at rest at 51300 steps",
        " a gantry twin at rest at 60000 steps",
    ]


def test_the_difference_is_plotted_as_a_value(session: FakeSession) -> None:
    session.plotted = (Series("press", "a", DIFFERENCE),)
    shown = view(session, *a_run(session))
    text = plain(*plot_rows(shown, 100, 20))
    assert "difference a gantry steps" in text and "velocity" not in text and "steps -398000" in text
    polling = Polling()
    polling.update(session, shown.model, {"plot", "samples"})
    assert session.buses["press"].telemetry.polled["a"] == 0.02, "it needs samples"
    assert f"a.{DIFFERENCE}" not in session.buses["press"].telemetry.polled


@given(st.integers(60, 200), st.integers(1, 40), st.lists(st.integers(-(2**31), 2**31 - 1), max_size=20), st.booleans())
def test_rows_with_a_twin_stay_in_their_room(width: int, height: int, places: list[int], several: bool) -> None:
    session = demo_session()
    session.plotted = tuple(Series("press", each) for each in "abc"[: 1 + 2 * several])
    events = [each for n, place in enumerate(places) for each in beside(50.0 + n / 2, place, place // 7, -place)]
    shown = view(session, *events, isolated(session))
    rows = plot_rows(shown, width, height)
    assert len(rows) <= height and all(width_of(row) <= width for row in rows)
    assert all(width_of(row) <= max(width, 45) for row in drive_rows(shown, max(width, 39), height))
    signs = shown_as(plain(*narrow_rows(shown, 80)), Signs.ASCII)
    assert signs.isascii()


# Keys


@pytest.mark.tui
async def test_the_palette_begins_and_ends_the_twins_of_the_line_as_typed_lines_do() -> None:
    async with on_screen(width=200, height=50) as (pilot, app, session):
        await app.run_action("act.switch('twin')")
        await pilot.pause()
        session.predicted.add(session.buses["press"])
        await emit(pilot, *beside(session.time, 0, 0, 8112), isolated(session))
        assert "≠" in app.main.lines("side").plain
        assert "≠ twin" in app.main.lines("top").plain
        assert "Twin off" in {each.title for each in app.act.commands()}
        await app.run_action("act.switch('twin')")
        await pilot.pause()
        session.predicted.clear()
        session.emit(OnBus("press", TwinEnded(session.time, "a")))
        await press(pilot, "ctrl+pagedown")
        await app.run_action("act.switch('twin')")
        await pilot.pause()
        assert session.sent == ["press:a /twin on", "press:a /twin off", "eth: /twin on"]
        assert "≠" not in app.main.lines("top").plain and "Twin on" in {each.title for each in app.act.commands()}


@pytest.mark.tui
async def test_w_plots_the_difference_and_plots_it_no_longer() -> None:
    async with on_screen(width=100, height=30) as (pilot, _, session):
        await press(pilot, "ctrl+g", "w")
        session.plotted = (Series("press", "a"), Series("press", "a", DIFFERENCE), Series("press", "b", "VM"))
        await pilot.press("w")
        session.plotted = (Series("press", "a", DIFFERENCE),)
        await press(pilot, "w")
        assert session.lines == [
            ("/plot press:a press:a.difference", By.OPERATOR),
            ("/plot press:a press:b.VM", By.OPERATOR),
        ]
