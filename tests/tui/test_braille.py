"""Curves in braille."""

from hypothesis import given
from hypothesis import strategies as st
from tui.panels.braille import draw, nice_range, row_of, ticks

values = st.floats(-2.2e9, 2.2e9, allow_nan=False)


def test_a_rising_line_goes_from_the_lower_left_to_the_upper_right() -> None:
    drawn = draw([(0.0, 0.0), (3.99, 7.0)], 0, 4, 0, 7, (2, 2), gap=10)
    assert drawn == [" ⡠", "⡠⠊"] or drawn[1][0] != " " and drawn[0][1] != " " and drawn[0][0] == " "


def test_where_nothing_is_known_nothing_is_drawn() -> None:
    joined = draw([(0.0, 1.0), (8.0, 1.0)], 0, 10, 0, 2, (10, 1), gap=10)
    broken = draw([(0.0, 1.0), (8.0, 1.0)], 0, 10, 0, 2, (10, 1), gap=1)
    assert " " not in joined[0][:8]
    assert broken[0].count(" ") == 8


def test_samples_before_the_start_only_lead_in() -> None:
    drawn = draw([(-5.0, 0.0), (5.0, 10.0)], 0, 10, 0, 10, (10, 4), gap=20)
    assert drawn[3].strip() == ""
    assert drawn[0].rstrip().endswith(drawn[0].strip()[-1])


@given(st.lists(st.tuples(st.floats(0, 30), values), max_size=60).map(sorted), st.integers(1, 80), st.integers(1, 20))
def test_a_drawing_always_has_the_size_that_was_asked_for(
    curve: list[tuple[float, float]], columns: int, rows: int
) -> None:
    low, high, _ = nice_range(min((v for _, v in curve), default=0), max((v for _, v in curve), default=0))
    drawn = draw(curve, 5, 25, low, high, (columns, rows), gap=1)
    assert [len(row) for row in drawn] == [columns] * rows
    assert all(char == " " or 0x2800 < ord(char) <= 0x28FF for row in drawn for char in row)


@given(values, values)
def test_a_range_holds_its_values_and_is_not_much_wider(one: float, other: float) -> None:
    low, high = sorted((one, other))
    bottom, top, _ = nice_range(low, high, least=10)
    slack = 1e-6 * max(1.0, abs(low), abs(high))
    assert bottom <= low + slack
    assert top >= high - slack
    assert top - bottom <= 2.5 * max(high - low, 10) + slack


@given(values, st.floats(1, 1e9), st.integers(2, 30))
def test_both_ends_have_a_tick_and_no_two_crowd_a_row(low: float, span: float, rows: int) -> None:
    axis = nice_range(low, low + span)
    marks = ticks(axis, rows)
    assert {0, rows - 1} <= set(marks) <= set(range(rows))
    assert len(marks) <= max(2, (rows + 1) // 2)


def test_the_ends_of_a_range_are_the_first_and_the_last_row() -> None:
    assert row_of(600, 0, 600, 9) == 0
    assert row_of(0, 0, 600, 9) == 8
