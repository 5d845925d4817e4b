"""Values and bytes as text."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from multidrop.tui.text import LONGEST_SHOWN_TEXT, age, at_words, digits, fit, short, shorter, visible


def test_control_characters_are_written_out() -> None:
    assert visible("at home\x06\r\x1b[2J") == "at home\\x06\\x0d\\x1b[2J"


@given(st.text())
def test_nothing_that_a_terminal_would_obey_is_left(text: str) -> None:
    assert not any(ord(char) < 0x20 or 0x7F <= ord(char) < 0xA0 for char in visible(text))


def test_prose_is_broken_between_words_and_within_one_only_where_it_must() -> None:
    assert at_words("raise VM first", 8) == ["raise VM", "first"]
    assert at_words("see /sys/class/tty now", 7) == ["see", "/sys/cl", "ass/tty", "now"]
    assert at_words("", 5) == [""]


@given(st.text(alphabet=" ab界é", max_size=60), st.integers(2, 12))
def test_no_row_of_prose_is_too_wide_and_no_word_is_lost(text: str, width: int) -> None:
    rows = at_words(text, width)
    assert all(cell_len(row) <= width for row in rows)
    assert "".join(rows).replace(" ", "") == text.replace(" ", "")


def test_endless_garbage_is_cut_and_says_how_long_it_was() -> None:
    shown = visible("x" * 100_000)
    assert shown.endswith("(100000 characters)")
    assert len(shown) < LONGEST_SHOWN_TEXT + 40


@pytest.mark.parametrize(
    ("value", "step", "label"),
    [
        (600_000, 200_000, "600k"),
        (-1_250_000, 250_000, "-1.25M"),
        (0, 200_000, "0"),
        (384_200, 100, "384.2k"),
        (1_000_000, 500_000, "1.0M"),
        (-5, 5, "-5"),
        (0.0, 2.0, "0"),
        (-100_000, 2, "-100000"),
        (-2_147_483_648, 2, "…7483648"),
    ],
)
def test_ticks_are_labelled_in_k_and_m(value: float, step: float, label: str) -> None:
    assert short(value, step) == label


def test_numbers_have_no_separators_and_the_unknown_a_dash() -> None:
    assert digits(-2_147_483_648) == "-2147483648"
    assert digits(None) == "–"


def test_ages_grow_coarser() -> None:
    assert [age(0.44), age(3.2), age(720)] == ["0.4 s", "3 s", "12 min"]


@given(st.text(st.characters(exclude_categories=["C", "M", "Z"])), st.integers(0, 40))
def test_fit_takes_exactly_its_width(text: str, width: int) -> None:
    assert cell_len(fit(text, width)) == width


@pytest.mark.parametrize(
    ("width", "shown"),
    [
        (70, "MR <position>[,<0/1>][,<0/1>]   move relative; manual 5.1.84"),
        (50, "MR <position>   move relative; manual 5.1.84"),
        (30, "MR <position>   move relative"),
        (20, "MR   move relative"),
        (9, "move rel…"),
    ],
)
def test_a_hint_keeps_its_meaning_longest(width: int, shown: str) -> None:
    assert shorter("MR <position>[,<0/1>][,<0/1>]   move relative; manual 5.1.84", width) == shown


def test_of_a_verb_the_usage_stays() -> None:
    assert shorter("/times [off|clock]   Show the times.", 20) == "/times [off|clock]"


@given(st.text(max_size=80), st.integers(1, 60))
def test_no_hint_is_wider_than_its_room(hint: str, width: int) -> None:
    assert cell_len(shorter(hint, width)) <= width
