"""Curves as text: what is kept of samples, what is drawn of them, and how little is drawn again."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.tui.curves.chart import SPANS, Chart, ChartView, ColumnWindow
from multidrop.tui.curves.raster import (
    ASCII,
    BLOCK,
    BRAILLE,
    CURSOR,
    INKS,
    Curve,
    Ink,
    PlotFrame,
    Raster,
    TickScale,
    magnified,
    nice_scale,
    row_of,
    steady,
    ticks,
    with_cursor,
)
from multidrop.tui.curves.samples import KEPT_SECONDS, MOST_POINTS, Columns, Trace, TraceQuantity, Traces
from multidrop.tui.panels.plotted import role_of

values = st.floats(-2.2e9, 2.2e9, allow_nan=False)
times = st.floats(0, 30)


def trace(*points: tuple[float, float]) -> Trace:
    found = Trace()
    for at, value in points:
        found.add(at, value)
    return found


def drawn(found: Trace, span: float, columns: int, rows: int, scale: TickScale, ink: Ink = BRAILLE) -> list[str]:
    """The picture of a trace from time 0 on."""
    kept = Columns(found, span / columns / ink.wide, 0)
    kept.update(0)
    frame = PlotFrame(0, columns, rows, scale, ink)
    return ["".join(text for text, _ in row) for row in Raster().draw([Curve(kept, 0)], frame)]


def test_a_rising_line_goes_from_the_lower_left_to_the_upper_right() -> None:
    ramp = trace(*((n / 10, n / 10) for n in range(40)))
    assert drawn(ramp, 4, 2, 2, TickScale(0, 4, 1)) == [" ⡼", "⡞⠁"]
    assert drawn(ramp, 4, 4, 2, TickScale(0, 4, 1), BLOCK) == ["  ▄█", "█▀▀ "]
    assert drawn(ramp, 4, 4, 2, TickScale(0, 4, 1), ASCII) == ["  **", "**  "]


def test_a_step_is_one_upright_line() -> None:
    step = trace((0.5, 0), (1.5, 0), (2.5, 4), (3.5, 4))
    assert drawn(step, 4, 4, 3, TickScale(0, 4, 2), ASCII) == ["  **", "  * ", "**  "]


def test_where_nothing_is_known_nothing_is_drawn() -> None:
    assert drawn(trace((0.2, 1), (0.4, 1), (0.6, 1), (9.5, 1)), 10, 10, 1, TickScale(0, 2, 1))[0][1:9] == " " * 8


def test_samples_that_come_slowly_are_joined_all_the_same() -> None:
    slow = trace(*((n * 2.0, 1) for n in range(6)))
    assert " " not in drawn(slow, 10, 10, 1, TickScale(0, 2, 1))[0]


def test_a_value_beyond_the_scale_is_not_drawn_at_its_edge() -> None:
    assert drawn(trace((0.5, 9), (1.5, 9)), 2, 2, 2, TickScale(0, 4, 1)) == ["  ", "  "]


@given(st.lists(st.tuples(times, values), max_size=60).map(sorted), st.integers(1, 80), st.integers(1, 20))
def test_a_drawing_has_its_size_whatever_is_drawn(points: list[tuple[float, float]], columns: int, rows: int) -> None:
    scale = nice_scale(min((v for _, v in points), default=0), max((v for _, v in points), default=0), rows)
    for ink in INKS.values():
        found = drawn(trace(*points), 20, columns, rows, scale, ink)
        assert [len(row) for row in found] == [columns] * rows


@given(st.lists(st.tuples(times, values), min_size=1, max_size=60).map(sorted), st.integers(1, 59), st.data())
def test_what_is_drawn_bit_by_bit_is_what_is_drawn_at_once(
    points: list[tuple[float, float]], columns: int, data: st.DataObject
) -> None:
    """The kept picture is true, however samples and frames fall."""
    scale = nice_scale(min(v for _, v in points), max(v for _, v in points), 4)
    found, raster, dot = Trace(), Raster(), 20 / columns / 2
    kept = Columns(found, dot, 0)
    for at, value in points:
        found.add(at, value)
        if data.draw(st.booleans()):
            kept.update(0)
            raster.draw([Curve(kept, 0)], PlotFrame(data.draw(st.integers(0, 5)), columns, 4, scale, BRAILLE))
    kept.update(0)
    once = Columns(found, dot, 0)
    once.update(0)
    frame = PlotFrame(3, columns, 4, scale, BRAILLE)
    assert raster.draw([Curve(kept, 0)], frame) == Raster().draw([Curve(once, 0)], frame)


def test_a_sample_draws_one_column_and_a_new_column_one_more() -> None:
    found = trace(*((n / 50, n % 7) for n in range(1000)))
    columns, raster = Columns(found, 0.25, 0), Raster()
    columns.update(0)
    frame = PlotFrame(0, 40, 8, TickScale(0, 8, 2), BRAILLE)
    raster.draw([Curve(columns, 0)], frame)
    before = raster.drawn
    found.add(20.0, 3)
    columns.update(0)
    raster.draw([Curve(columns, 0)], frame._replace(first=1))
    assert raster.drawn - before <= 2


def test_two_series_differ_by_dashes_in_braille_and_by_marks_in_ascii() -> None:
    line = trace(*((n / 10, 1) for n in range(100)))
    columns = Columns(line, 0.125, 0)
    columns.update(0)
    pictures = [
        Raster().draw([Curve(columns, number)], PlotFrame(0, 20, 1, TickScale(0, 2, 1), BRAILLE))[0][0][0]
        for number in range(6)
    ]
    assert len(set(pictures)) == 6
    assert len({ASCII.sample(number) for number in range(6)}) == 6


def test_twelve_curves_differ_by_colour_or_dashes_and_in_ascii_by_marks() -> None:
    line = trace(*((n / 10, 1) for n in range(100)))
    columns = Columns(line, 0.125, 0)
    columns.update(0)
    frame = PlotFrame(0, 20, 1, TickScale(0, 2, 1), BRAILLE)
    pictures = {(role_of(n), Raster().draw([Curve(columns, n)], frame)[0][0][0]) for n in range(12)}
    assert len(pictures) == len({ASCII.sample(n) for n in range(12)}) == 12


def test_the_cursor_hides_no_curve() -> None:
    assert with_cursor([("ab ", 0), ("  ", 1)], 1, "│") == [("a", 0), ("b", CURSOR), (" ", 0), ("  ", 1)]
    assert with_cursor([("ab ", 0), ("  ", 1)], 3, "│") == [("ab ", 0), ("│", CURSOR), (" ", 1)]


# Scales


@given(values, values, st.integers(1, 60))
def test_a_scale_holds_its_values_and_is_not_much_wider(one: float, other: float, rows: int) -> None:
    low, high = sorted((one, other))
    scale = nice_scale(low, high, rows, least=10)
    slack = 1e-6 * max(1.0, abs(low), abs(high))
    assert scale.low <= low + slack and scale.high >= high - slack
    assert scale.high - scale.low <= (2.0 if rows > 7 else 10) * max(high - low, 10) + slack


@given(values, st.floats(1, 1e9), st.integers(4, 60))
def test_ticks_are_round_the_same_rows_apart_and_not_many(low: float, span: float, rows: int) -> None:
    scale = nice_scale(low, low + span, rows)
    marks = ticks(scale, rows)
    places = sorted(marks)
    assert 2 <= len(marks) <= 11 and len({later - row for row, later in pairwise(places)}) == 1
    assert set(marks) <= set(range(rows))
    mantissa = float(f"{scale.step:.9e}".partition("e")[0])
    assert mantissa in (1, 2, 5) and all(
        value / scale.step == pytest.approx(round(value / scale.step)) for value in marks.values()
    )


@given(st.sampled_from(SPANS), st.integers(18, 240))
def test_ticks_of_time_are_the_same_cells_apart(span: float, columns: int) -> None:
    look = ChartView()
    look.shorter(SPANS.index(look.span) - SPANS.index(span))
    window = look.window(1000.0, columns, 2)
    cells = window.step / window.cell
    assert cells == pytest.approx(round(cells)) and span <= window.span * (1 + 1e-9) and window.span <= span * 1.1
    assert window.step == span or float(f"{window.step / (60 if window.step >= 60 else 1):e}"[0]) in (1, 2, 5)


def test_the_ends_of_a_scale_are_the_first_and_the_last_row() -> None:
    scale = nice_scale(0, 600, 9)
    assert (row_of(scale.high, scale, 9), row_of(0, scale, 9)) == (0, 8)


def test_a_scale_grows_at_once_and_shrinks_only_when_much_too_wide() -> None:
    scale = steady(None, 0, 900, 9, 1)
    assert steady(scale, 0, 600, 9, 1) == scale
    assert steady(scale, 0, 2000, 9, 1).high >= 2000
    assert steady(scale, 0, 100, 9, 1).high <= 200


def test_a_magnified_scale_is_a_round_part_around_a_value() -> None:
    found = magnified(TickScale(0, 1000, 200), 11, 4, 500)
    assert found.low <= 400 and found.high >= 600 and found.high - found.low <= 500


# What is kept


def test_a_trace_keeps_minutes_and_not_more() -> None:
    found = trace(*((n / 10, n) for n in range(12_000)))
    assert KEPT_SECONDS < found.at[-1] - found.at[0] < KEPT_SECONDS + 250
    assert found.count == 12_000
    assert len(trace(*((n / 1e6, n) for n in range(MOST_POINTS + 5000))).at) <= MOST_POINTS


def test_columns_that_are_long_past_are_forgotten() -> None:
    found = Trace()
    columns = Columns(found, 0.1, 0)
    for n in range(5000):
        found.add(n / 10, n)
        columns.update(n - 100)
    assert len(columns.columns) < 500


def test_a_closed_bus_leaves_nothing() -> None:
    traces = Traces()
    traces.add(TraceQuantity("press", "a", "", "position"), 1.0, 2.0)
    traces.rename("press", "left")
    assert traces.get(TraceQuantity("left", "a", "", "position")) is not None
    traces.forget("left")
    assert traces.get(TraceQuantity("press", "a", "", "position")) is None


def test_a_view_that_goes_back_in_time_finds_what_is_kept() -> None:
    traces, quantity = Traces(), TraceQuantity("press", "a", "", "position")
    for n in range(3000):
        traces.add(quantity, n / 10, n)
    chart = Chart()
    newest = chart.take(traces, [quantity], ColumnWindow(20.0, 1400, 100, 2))
    assert newest[quantity].low == pytest.approx(2800, abs=3)
    back = chart.take(traces, [quantity], ColumnWindow(20.0, 100, 100, 2))
    assert (back[quantity].low, back[quantity].high) == (pytest.approx(200, abs=3), pytest.approx(400, abs=3))


# How a person looks


def test_a_pause_holds_the_picture_and_the_cursor_pauses() -> None:
    look = ChartView()
    look.pause(100.0)
    assert look.window(110.0, 40, 2) == look.window(100.0, 40, 2)
    look.pause(110.0)
    assert look.window(110.0, 40, 2).last > look.window(100.0, 40, 2).last
    look.move_cursor(-1, 110.0, 40)
    assert look.paused_at == 110.0 and look.cursor == pytest.approx(109.5)


@given(
    st.lists(st.sampled_from(["left", "right", "far", "longer", "shorter", "closer", "farther", "pause"]), max_size=60)
)
def test_the_cursor_is_always_in_view(keys: list[str]) -> None:
    look, now = ChartView(), 1000.0
    for key in keys:
        now += 0.1
        match key:
            case "left" | "right":
                look.move_cursor(-3 if key == "left" else 3, now, 40)
            case "far":
                look.move_cursor(-100, now, 40)
            case "longer" | "shorter":
                look.shorter(1 if key == "shorter" else -1)
            case "closer" | "farther":
                look.closer(1 if key == "closer" else -1)
            case "pause":
                look.pause(now)
        assert look.span in SPANS and 1 <= look.zoom <= 64
        if look.cursor is not None:
            window = look.window(now, 40, 2)
            at = math.floor(look.cursor / window.cell)
            assert window.first - 1 <= at <= window.last + 1
            assert look.cursor <= now
