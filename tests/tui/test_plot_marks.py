"""Marks in charts: lines, errors, limits and stops at their time on the curves, and the ends of travel."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.values import Conditions, Lamp
from multidrop.drives.events import Conditioned, Sample
from multidrop.shell.events import By, Entered, Failed, OnBus, SessionEvent
from multidrop.shell.roles import Series
from multidrop.tui.curves.raster import ASCII, EMPTY, nice_scale, steady, with_text
from multidrop.tui.panels.plot import plot_rows
from multidrop.tui.panels.view import View
from multidrop.tui.screens.plot_page import cursor_rows
from multidrop.tui.widgets.lines import width_of
from tests.support.examples import examples
from tests.support.fake_session import FakeSession, demo_session, on_screen, press
from tests.support.panel_rows import plain, view


@pytest.fixture
def session() -> FakeSession:
    return demo_session()


def climb(session: FakeSession, address: str = "a", low: int = 0, samples: int = 200) -> list[SessionEvent]:
    """Twenty seconds in which a drive goes 1000 steps a second."""
    begin, every = session.time - 20, 20 / samples
    moves = [(begin + n * every, low + int(1000 * n * every)) for n in range(samples + 1)]
    return [OnBus("press", Sample(at, address, position, 1000)) for at, position in moves]


def sent(session: FakeSession, ago: float, line: str, address: str = "a") -> Entered:
    return Entered(session.time - ago, line, By.OPERATOR, "press", address)


def conditions(session: FakeSession, ago: float, *lamps: Lamp, limits: tuple[int, int] | None = None) -> OnBus:
    return OnBus("press", Conditioned(session.time - ago, "a", (Conditions(lamps=lamps, limits=limits),)))


def charts(shown: View, width: int = 50, height: int = 12, ascii_only: bool = False) -> list[str]:
    if ascii_only:
        shown.model.look.ink = ASCII
    return plain(*plot_rows(shown, width, height)).splitlines()


def test_lines_and_errors_are_on_the_curve_at_their_time_with_their_text_where_room_is(session: FakeSession) -> None:
    failure = Failed(session.time - 5, "a: error 20 unknown variable: VX", "press", "a", code=20)
    rows = charts(view(session, *climb(session), sent(session, 15, "MR 51200"), failure), ascii_only=True)
    assert rows == [
        " a gantry steady at 1000 steps/s",
        " position a gantry steps 20000 ",
        "         │                                        ",
        "     20k ┤                     error 20      *****",
        "         │                             E******    ",
        "         │                      ********          ",
        "     10k ┤               ********                 ",
        "         │         *******                        ",
        "         │  *******>                              ",
        "       0 ┼***      MR 51200                       ",
        "         │                                        ",
        "                             ╵-10 s           now╵",
    ]


def test_the_most_urgent_mark_of_a_cell_is_shown(session: FakeSession) -> None:
    failure = Failed(session.time - 10, "a: refused", "press", "a")
    shown = view(session, *climb(session), sent(session, 10, "VX=1"), failure)
    text = "\n".join(charts(shown))
    assert "✗" in text and "›" not in text


def test_a_limit_that_is_reached_is_a_mark(session: FakeSession) -> None:
    off, lit = Lamp("I1", "lim+", on=False), Lamp("I1", "lim+", on=True)
    events = [*climb(session)[:150], conditions(session, 8, off), conditions(session, 7, lit)]
    text = "\n".join(charts(view(session, *events, *climb(session)[150:])))
    assert "!" in text and "limit+" in text


def test_verbs_are_no_marks_and_a_line_for_all_is_one_on_every_curve(session: FakeSession) -> None:
    session.plotted = (Series("press", "a"), Series("press", "b"))
    moves = [*climb(session), *climb(session, "b", 40_000)]
    shown = view(session, *moves, sent(session, 9, "/wait stopped"), sent(session, 5, "@* SL 0", "*"))
    rows = charts(shown, height=20)
    assert sum(row.count("›") for row in rows) == 2 and "/wait" not in "".join(rows)
    assert any("a SL 0" in row for row in rows) and any("b SL 0" in row for row in rows)


def test_a_stop_is_a_mark_on_every_curve(session: FakeSession) -> None:
    shown = view(session, *climb(session))
    shown.model.stopped(session.time - 5)
    assert sum(row.count("■") for row in charts(shown)) == 1


def test_the_range_follows_the_values_and_the_ends_of_travel_are_marks(session: FakeSession) -> None:
    rows = charts(view(session, *climb(session), conditions(session, 3, limits=(-50_000, 900_000))))
    assert rows[2].endswith("▲ software limit 900000") and rows[-2].endswith("▼ software limit -50000")
    assert not any("┄" in row for row in rows)
    rows = charts(view(session, *climb(session), conditions(session, 3, limits=(-50_000, 20_000))))
    line = next(row for row in rows if "software limit 20000" in row)
    assert line.count("┄") > 10 and "▼ software limit -50000" in rows[-2]


def test_the_position_itself_is_never_hidden_by_an_end_of_travel(session: FakeSession) -> None:
    without = charts(view(session, *climb(session)))
    rows = charts(view(session, *climb(session), conditions(session, 3, limits=(0, 20_000))))
    for before, now in zip(without[2:], rows[2:], strict=True):
        assert all(one in (" ", other) for one, other in zip(before, now, strict=True) if one != "│")


def test_the_mark_near_the_cursor_is_named(session: FakeSession) -> None:
    shown = view(session, *climb(session), sent(session, 10, "@a MR 51200"), sent(session, 2, "VM=5"))
    plot_rows(shown, 60, 20)
    look = shown.model.look
    look.cursor, look.paused_at = session.time - 10.2, session.time
    text = plain(*cursor_rows(shown, 100, 4))
    assert "› a gantry MR 51200 12:40:57.00" in text and "VM=5" not in text
    look.cursor = session.time - 6
    assert "MR 51200" not in plain(*cursor_rows(shown, 100, 4))


def test_of_many_marks_at_the_cursor_some_are_named_and_the_others_counted(session: FakeSession) -> None:
    shown = view(session, *climb(session), *(sent(session, 10, f"VM={n}") for n in range(9)))
    plot_rows(shown, 60, 20)
    shown.model.look.cursor, shown.model.look.paused_at = session.time - 10, session.time
    assert "and 6 more marks" in plain(*cursor_rows(shown, 200, 6))


@pytest.mark.tui
async def test_a_sent_line_is_on_the_curve_of_the_panel_and_of_the_page() -> None:
    async with on_screen(width=120, height=40) as (pilot, app, session):
        session.emit(*climb(session), sent(session, 10, "MR 51200"))
        await press(pilot)
        assert "›" in app.main.lines("panel").plain
        await press(pilot, "ctrl+g")
        assert "MR 51200" in app.screen.lines("charts").plain


@examples(30, nightly=300)
@given(
    st.lists(st.tuples(st.floats(-30, 5), st.text(max_size=40), st.sampled_from(["a", "b", "", "*"])), max_size=20),
    st.integers(10, 90),
    st.integers(1, 30),
    st.booleans(),
)
def test_marks_of_any_text_keep_a_chart_in_its_room(
    marks: list[tuple[float, str, str]], width: int, height: int, ascii_only: bool
) -> None:
    session = demo_session()
    session.plotted = (Series("press", "a"), Series("press", "b"))
    lines = [sent(session, -at, text, address) for at, text, address in marks]
    shown = view(session, *climb(session, samples=20), *climb(session, "b", -3000, 20), *lines)
    if ascii_only:
        shown.model.look.ink = ASCII
    rows = plot_rows(shown, width, height)
    assert len(rows) <= height and all(width_of(row) <= width for row in rows)


@given(st.lists(st.text("ab ", min_size=1, max_size=5), min_size=1), st.data())
def test_a_text_in_a_row_replaces_its_cells_and_no_others(pieces: list[str], data: st.DataObject) -> None:
    row = "".join(pieces)
    at = data.draw(st.integers(0, len(row) - 1))
    text = "X" * data.draw(st.integers(1, len(row) - at))
    runs = with_text([(piece, n) for n, piece in enumerate(pieces)], at, text, EMPTY)
    assert "".join(piece for piece, _ in runs) == row[:at] + text + row[at + len(text) :]
    assert (text, EMPTY) in runs


def test_values_that_go_on_rising_change_the_scale_seldom() -> None:
    scale, changes = None, 0
    for n in range(400):
        now = steady(scale, 50.0 * n, 20_000 + 50.0 * n, 12, 10)
        changes += now != scale
        scale = now
    assert changes <= 12


def test_headroom_never_makes_a_scale_much_wider_than_the_values_need() -> None:
    assert steady(None, 0, 600_000, 7, 100) == nice_scale(0, 600_000, 7, 100)


def test_lines_that_come_faster_than_columns_are_one_mark_in_each(session: FakeSession) -> None:
    many = [sent(session, 20 - n / 50, f"MR {n}") for n in range(1000)]
    rows = charts(view(session, *climb(session), *many))
    columns = ["".join(column).count("›") for column in zip(*(row.ljust(50) for row in rows[2:-1]), strict=True)]
    assert max(columns) == 1 and sum(columns) > 35
