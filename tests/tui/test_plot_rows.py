"""Plots as rows: words for what rests, charts for what moves, and the page of plots."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.drives.events import Lost, Sample, Valued
from multidrop.shell.events import By, OnBus
from multidrop.shell.roles import RunningPlot, Series
from multidrop.tui.curves.raster import ASCII
from multidrop.tui.curves.samples import TraceQuantity
from multidrop.tui.curves.trigger import TriggerState
from multidrop.tui.panels.plot import plot_rows, plot_title
from multidrop.tui.screens.dialogs import InputField
from multidrop.tui.screens.plot_page import PlotPage, cursor_rows, parse_trigger, typed_trigger
from multidrop.tui.widgets.lines import width_of
from tests.support.fake_session import FakeBus, FakeDrive, FakeSession, a_move, demo_session, on_screen, press, settle
from tests.support.foreign_features import delete_features
from tests.support.panel_rows import plain, view


def rest(address: str, position: int, session: FakeSession) -> list[OnBus]:
    return [OnBus("press", Sample(session.time - 12 + n / 20, address, position, 0)) for n in range(240)]


def wave(address: str, session: FakeSession) -> list[OnBus]:
    return [
        OnBus("press", Sample(session.time - 12 + n / 20, address, int(500 * math.sin(n / 20)), int(900 * math.cos(n))))
        for n in range(240)
    ]


@pytest.fixture
def session() -> FakeSession:
    return demo_session()


def test_a_resting_drive_is_one_line(session: FakeSession) -> None:
    rows = plot_rows(view(session, *rest("a", 51_300, session)), 60, 20)
    assert plain(*rows) == " a gantry at rest at 51300 steps"


def test_an_encoder_between_two_counts_rests(session: FakeSession) -> None:
    shown = view(session, *rest("a", 51_300, session), OnBus("press", Sample(session.time, "a", 51_301, 0)))
    assert plain(*plot_rows(shown, 60, 20)) == " a gantry at rest at 51300 to 51301 steps"


def test_a_steady_velocity_is_one_line_while_the_position_changes(session: FakeSession) -> None:
    events = [OnBus("press", Sample(session.time - 25 + n / 20, "a", 100 * n, 2000)) for n in range(500)]
    text = plain(*plot_rows(view(session, *events), 60, 20))
    assert text.startswith(" a gantry steady at 2000 steps/s\n position a gantry steps ")


def test_without_samples_it_says_so(session: FakeSession) -> None:
    assert plain(*plot_rows(view(session), 60, 20)) == " a gantry no samples yet"
    old = view(session, OnBus("press", Sample(session.time - 100, "a", 5, 0)))
    assert plain(*plot_rows(old, 60, 20)) == " a gantry no samples in this time"


def test_a_drive_that_is_not_read_any_more_says_so_where_its_value_stands(session: FakeSession) -> None:
    session.plotted = (Series("press", "a"), Series("press", "b"))
    events = [*rest("a", 5, session), *wave("b", session)]
    session.time += 4
    rows = plot_rows(view(session, *events), 100, 20)
    assert " a gantry at rest at 5 steps, read 4 s ago" in plain(*rows) and " (4 s)" in plain(*rows[2:])
    assert {role for row in rows for text, role in row if "4 s" in text and "-" not in text} == {"dim"}


def test_the_title_says_the_span_and_the_real_rate(session: FakeSession) -> None:
    events = rest("a", 5, session)
    assert plain(plot_title(view(session, *events))) == " plot last 20 s  20 Hz "
    assert "polling off" in plain(plot_title(view(session, *events, polling=False)))
    assert "no samples" in plain(plot_title(view(session)))


def test_what_rests_is_said_and_does_not_widen_the_scale_of_what_moves(session: FakeSession) -> None:
    session.plotted = (Series("press", "a"), Series("press", "b"))
    text = plain(*plot_rows(view(session, *wave("a", session), *rest("b", 2_048_000, session)), 60, 20))
    assert " b clamp at rest at 2048000 steps" in text
    assert "M ┤" not in text


def test_lines_bear_their_names_at_their_ends_with_their_last_values(session: FakeSession) -> None:
    session.plotted = (Series("press", "a"), Series("press", "b"))
    rows = plot_rows(view(session, *a_move(session)[:480], *wave("b", session)), 100, 30)
    assert "a gantry 600000" in plain(*rows) and "b clamp" in plain(*rows)
    assert {role for row in rows for text, role in row if "b clamp" in text} == {"series2"}


def test_values_are_plotted_by_their_words_on_any_line(session: FakeSession) -> None:
    session.plotted = (Series("press", "b", "I1"), Series("eth", "", "VM"))
    inputs = [OnBus("press", Valued(session.time - 5 + n / 10, "b", "I1", float(n > 25))) for n in range(50)]
    text = plain(*plot_rows(view(session, *inputs, OnBus("eth", Valued(session.time - 1, "", "VM", 768000))), 100, 20))
    assert " I1 press:b clamp " in text and " eth VM steady at 768000" in text


def test_each_drive_may_have_charts_of_its_own(session: FakeSession) -> None:
    session.plotted = (Series("press", "a"), Series("press", "b"))
    shown = view(session, *wave("a", session), *wave("b", session))
    shown.model.look.apart = True
    titles = [plain(row)[1:].split(" steps")[0] for row in plot_rows(shown, 100, 40) if plain(row)[1:2] in "vp"]
    assert titles == ["velocity a gantry", "position a gantry", "velocity b clamp", "position b clamp"]


def test_what_finds_no_room_is_named(session: FakeSession) -> None:
    rows = plot_rows(view(session, *wave("a", session)), 40, 6)
    assert plain(rows[-1]).strip() == "no room: position a gantry"


def test_the_cursor_shows_the_values_there(session: FakeSession) -> None:
    shown = view(session, *wave("a", session))
    look = shown.model.look
    plot_rows(shown, 60, 20)
    look.move_cursor(-20, session.now(), 50)
    rows = plot_rows(shown, 60, 20)
    assert sum("strong" in {role for _, role in row} for row in rows) > 10
    text = plain(*cursor_rows(shown, 60, 4))
    assert "12:40:58.66" in text and "a gantry position " in text and "not known" not in text


def test_two_cursors_show_their_differences(session: FakeSession) -> None:
    moves = [OnBus("press", Sample(session.time - 12 + n / 20, "a", 100 * n, 2000 + n)) for n in range(240)]
    shown = view(session, *moves)
    look = shown.model.look
    plot_rows(shown, 60, 20)
    look.move_cursor(-10, session.now(), 50)
    look.change_cursor(session.now(), 50)
    assert look.other == look.cursor
    look.move_cursor(-10, session.now(), 50)
    plot_rows(shown, 60, 20)
    text = plain(*cursor_rows(shown, 60, 6))
    assert "dt -4.167 s" in text and "1/dt 0.24 Hz" in text and "velocity 2158 to 2075 (-83)" in text
    cells = [row for row in plot_rows(shown, 60, 20) if "┊" in plain(row) and "│" in plain(row)[11:]]
    assert len(cells) > 5, "both are drawn"
    look.change_cursor(session.now(), 50)
    assert "dt +4.167 s" in plain(*cursor_rows(shown, 60, 6)), "keys move the other one"
    assert "1/dt" not in plain(*cursor_rows(shown, 60, 6)) or look.cursor != look.other


def test_a_lost_line_leaves_a_gap(session: FakeSession) -> None:
    first = [OnBus("press", Sample(session.time - 18 + n / 20, "a", n, 20)) for n in range(100)]
    then = [OnBus("press", Sample(session.time - 4 + n / 20, "a", n, 20)) for n in range(80)]
    lost = OnBus("press", Lost(session.time - 13, TransportLost("unplugged")))
    shown = view(session, *first, lost, *then)
    chart = [plain(row)[10:] for row in plot_rows(shown, 60, 20)[2:-1]]
    columns = ["".join(column).strip() for column in zip(*chart, strict=True)]
    assert not any(columns[19:38]) and any(columns[4:14]) and any(columns[42:])


@given(st.integers(1, 130), st.integers(0, 40), st.lists(st.integers(-(2**31), 2**31 - 1), max_size=30), st.booleans())
def test_a_plot_stays_in_its_room(width: int, height: int, positions: list[int], apart: bool) -> None:
    session = demo_session()
    session.plotted = tuple(Series("press", each) for each in "abc")
    points = [
        OnBus("press", Sample(52 + n / 2, address, position, position // 400))
        for n, position in enumerate(positions)
        for address in "ab"
    ]
    shown = view(session, *points)
    shown.model.look.apart = apart
    if apart:
        shown.model.look.ink = ASCII
        shown.model.look.move_cursor(-5, session.now(), 40)
    rows = plot_rows(shown, width, height)
    assert len(rows) <= height
    assert all(width_of(row) <= max(width, 1) for row in rows)


def test_many_drives_at_rest_are_counted() -> None:
    session = FakeSession(FakeBus("press", {str(n): FakeDrive(str(n)) for n in range(62)}))
    session.plotted = tuple(Series("press", str(n)) for n in range(62))
    events = [event for n in range(62) for event in rest(str(n), n, session)]
    rows = plot_rows(view(session, *events), 80, 20)
    assert len(rows) == 8 and plain(rows[-1]) == " and 55 more that do not change"


# The page


@pytest.mark.tui
async def test_keys_of_the_page() -> None:
    async with on_screen(width=100, height=30) as (pilot, app, session):
        session.emit(*a_move(session))
        await press(pilot, "ctrl+g")
        page = app.screen
        assert isinstance(page, PlotPage)
        assert session.buses["press"].telemetry.polled["a"] == 0.02
        look = app.model.look
        await press(pilot, "space")
        assert look.paused_at is not None and "paused" in page.lines("heading").plain
        await press(pilot, "space", "left", "left", "plus", "up")
        assert look.cursor is not None and look.zoom == 2 and look.span == 10.0
        assert "a gantry velocity 600000" in page.lines("below").plain
        await press(pilot, "0", "s", "v")
        assert look.cursor is None and look.apart and "velocity" not in page.lines("charts").plain
        await press(pilot, "p")
        assert look.hidden == {"velocity"}
        await press(pilot, "2", "o")
        assert session.lines[:2] == [
            ("/plot press:a press:b", By.OPERATOR),
            ("/plot press:a --serve 9876", By.OPERATOR),
        ]
        await press(pilot, "space", "escape", "escape")
        assert app.screen is app.main and look.paused_at is None


@pytest.mark.tui
async def test_escape_goes_on_before_it_leaves_and_a_stop_leaves_the_page() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, "ctrl+g", "left", "escape")
        assert isinstance(app.screen, PlotPage) and app.model.look.paused_at is None
        await press(pilot, "ctrl+x")
        assert session.stops == 1 and isinstance(app.screen, PlotPage)


@pytest.mark.tui
async def test_what_is_plotted_is_polled_and_values_are_read() -> None:
    async with on_screen() as (pilot, app, session):
        session.plotted = (Series("press", "b"), Series("press", "c", "I1"))
        await press(pilot, "ctrl+g")
        app.model.changed = True
        await settle(pilot)
        polled = session.buses["press"].telemetry.polled
        assert (polled["b"], polled["c.I1"]) == (0.02, 0.1)
        await press(pilot, "escape")
        app.model.changed = True
        await settle(pilot)
        assert "c.I1" not in session.buses["press"].telemetry.polled


@pytest.mark.tui
async def test_what_is_typed_after_a_line_that_opens_a_page_is_no_key_of_the_page() -> None:
    async with on_screen() as (pilot, app, session):
        await press(pilot, *"/page plot", "enter", "o", "a")
        assert isinstance(app.screen, PlotPage)
        assert session.lines == [("/page plot", By.OPERATOR)]


@pytest.mark.tui
async def test_a_refused_line_of_the_page_is_seen_on_the_page(session: FakeSession) -> None:
    session.refuses["/plot press:a --serve 9876"] = "cannot serve at 127.0.0.1:9876 (Address already in use)"
    async with on_screen(session) as (pilot, app, _):
        await press(pilot, "ctrl+g", "o")
        await settle(pilot)
        assert isinstance(app.screen, PlotPage)
        assert "✗ cannot serve at 127.0.0.1:9876" in app.screen.lines("below").plain
        await press(pilot, "a")
        assert "cannot" not in app.screen.lines("below").plain


# Trigger, single shot, and saving


def run_up(session: FakeSession, begin: float) -> list[OnBus]:
    """Drive a stands, and from one second on its velocity rises by 1000 a second."""
    return [OnBus("press", Sample(begin + n / 20, "a", n, max(0, 50 * (n - 20)))) for n in range(100)]


@pytest.mark.tui
async def test_a_trigger_holds_the_picture_around_the_edge_and_space_waits_for_the_next_one() -> None:
    async with on_screen() as (pilot, app, session):
        session.emit(*rest("a", 5, session))
        await press(pilot, "ctrl+g", "g")
        field = app.focused
        assert isinstance(field, InputField) and field.value.startswith("a velocity rise ")
        field.value = "a velocity rise 1000 25%"
        await press(pilot, "enter")
        look = app.model.look
        assert look.trigger.state is TriggerState.ARMED and look.paused_at is None
        assert "armed a velocity rise 1000 25%" in app.screen.lines("heading").plain
        assert session.buses["press"].telemetry.polled["a"] == 0.02
        session.emit(*run_up(session, session.time))
        session.time += 5
        app.model.changed = True
        await settle(pilot)
        assert look.trigger.state is TriggerState.TRIGGERED and look.trigger.at == pytest.approx(
            session.time - 3, abs=0.06
        )
        assert look.paused_at == pytest.approx(look.trigger.at + 15)
        assert "╵edge" in app.screen.lines("charts").plain and "▸" in app.screen.lines("charts").plain
        session.time += 30
        app.model.changed = True
        await settle(pilot)
        assert look.trigger.state.value == "held"
        await press(pilot, "escape")
        assert app.screen is app.main and look.paused_at is None, "the panel runs"
        await press(pilot, "ctrl+g")
        assert "held a velocity" in app.screen.lines("heading").plain
        await press(pilot, "j")
        assert look.trigger.single and look.trigger.state.value == "armed"
        await press(pilot, "0")
        assert look.trigger.state.value == "off" and "velocity rise" not in app.screen.lines("heading").plain


@pytest.mark.tui
@pytest.mark.parametrize("keys", ["g", "j", "ctrl+s", "x", "g enter", "g enter x left x"])
async def test_the_stop_goes_first_whatever_the_page_of_plots_waits_for(keys: str) -> None:
    async with on_screen() as (pilot, app, session):
        session.emit(*wave("a", session))
        await press(pilot, "ctrl+g", *keys.split())
        assert isinstance(app.focused, InputField) == (keys in ("g", "j", "ctrl+s"))
        await press(pilot, "ctrl+x")
        assert session.stops == 1 and isinstance(app.screen, PlotPage)
        assert not isinstance(app.focused, InputField), "what was begun before a stop is not used"


@pytest.mark.tui
async def test_the_rows_of_two_cursors_have_room_of_their_own() -> None:
    async with on_screen() as (pilot, app, session):
        session.emit(*wave("a", session), *wave("b", session))
        await press(pilot, "ctrl+g", "a", "space", "left", "x", *["left"] * 9)
        await settle(pilot)
        below = app.screen.lines("below")
        assert below.size.height == len(below.rows) > 1 and "dt -" in below.plain
        await press(pilot, "escape")
        await settle(pilot)
        assert below.size.height == 1


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "no trigger ''; valid: CURVE rise|fall LEVEL [SHARE%], as a velocity rise "),
        ("a velocity rise", "no trigger 'a velocity rise'; valid: "),
        ("a velocity up 5", "no trigger"),
        ("a velocity rise nan", "no trigger"),
        ("a velocity rise 5 120%", "no trigger"),
        ("a velocity rise 5 20% 7", "no trigger"),
        ("q velocity rise 5", "no plotted curve is 'q velocity'; plotted: a velocity, a position"),
        ("a rise 5", "several curves are 'a'; plotted: a velocity, a position"),
        ("rise 5", "several curves are 'without a name'; plotted: a velocity, a position"),
    ],
)
def test_a_wrong_trigger_has_one_line(session: FakeSession, text: str, why: str) -> None:
    with pytest.raises(Diagnostic) as failure:
        parse_trigger(view(session, *wave("a", session)), text)
    assert str(failure.value).startswith(why)


def test_a_trigger_is_typed_in_the_unit_that_is_shown_and_shown_as_it_was_typed(session: FakeSession) -> None:
    shown = view(session, *wave("a", session))
    assert typed_trigger(shown).startswith("a velocity rise ")
    setting = parse_trigger(shown, "press:a position fall -100 50%")
    assert setting == (TraceQuantity("press", "a", "", "position"), -100, False, 0.5)
    shown.model.look.arm(setting, False, shown.model.traces)
    assert typed_trigger(shown) == "a position fall -100 50%"


@pytest.mark.tui
async def test_what_is_visible_is_saved_as_a_table_and_nothing_is_overwritten(tmp_path: Path) -> None:
    async with on_screen() as (pilot, app, session):
        session.emit(*rest("a", 5, session), *wave("b", session))
        session.plotted = (Series("press", "b"),)
        await press(pilot, "ctrl+g", "minus", "plus", "plus", "plus", "ctrl+s")  # the last 5 s
        file = tmp_path / "seen.csv"
        for expected in ("196 values of 2 curves are in", "is there already; use another name"):
            if not isinstance(app.focused, InputField):
                await press(pilot, "ctrl+s")
            assert isinstance(app.focused, InputField)
            app.focused.value = str(file)
            await press(pilot, "enter")
            await app.workers.wait_for_complete()
            await settle(pilot)
            below = app.screen.lines("below").plain
            assert expected in below, below
        rows = file.read_text().splitlines()
        assert len(rows) == 197 and rows[0].startswith("time,elapsed,bus,drive,axis,name,value,unit,text")
        assert {row.split(",")[5] for row in rows[1:]} == {"position", "velocity"}
        assert all(0 <= float(row.split(",")[1]) <= 5.6 for row in rows[1:])


@pytest.mark.tui
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("seen.txt", "✗ no plot file 'seen.txt'; valid: a name that ends in"),
        ("nowhere/seen.csv", "✗ no folder nowhere"),
        ("rerun+http://desk:9876/proxy", "is not a file"),
        ("seen.rrd", "✗ plots need rerun, which is not installed"),
    ],
)
async def test_what_cannot_be_saved_has_one_line(
    name: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "rerun", None)
    async with on_screen() as (pilot, app, session):
        session.emit(*wave("a", session))
        await press(pilot, "ctrl+g", "ctrl+s")
        assert isinstance(app.focused, InputField)
        app.focused.value = name
        await press(pilot, "enter")
        await app.workers.wait_for_complete()
        await settle(pilot)
        assert why in app.screen.lines("below").plain
        assert not list(tmp_path.iterdir())


@pytest.mark.tui
async def test_a_plot_that_runs_elsewhere_is_named_in_its_own_words() -> None:
    async def end() -> str:
        return ""

    async with on_screen() as (pilot, app, session):
        session.plots.append(RunningPlot("there", "", "", "", "the recorder writes there", end))
        await press(pilot, "ctrl+g")
        assert app.screen.lines("below").plain.rstrip() == " the recorder writes there"  # type: ignore[attr-defined]


@pytest.mark.tui
async def test_without_the_feature_of_files_nothing_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    delete_features(monkeypatch)
    async with on_screen() as (pilot, app, session):
        session.emit(*wave("a", session))
        await press(pilot, "ctrl+g", "ctrl+s")
        assert not isinstance(app.focused, InputField)
        assert "the feature plot_files is not there" in app.screen.lines("below").plain
