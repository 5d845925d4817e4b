"""The conditions of `--expect`: when they hold, what is reported as seen, and which are refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.features.sweeps.trial import TrialOutcome, parse_condition

SEEN = TrialOutcome(51198, (86, 81), ("at 51200", "7"), 1.5, "E")
STAGE = TrialOutcome((100, -200), ("?Moving",), (), 0.25, "until")


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("position == 51198", True),
        ("position == 51200", False),
        ("position == 51200 +- 2", True),
        ("position != 51200 +- 1", True),
        ("51200 - position <= 2", True),
        ("errors == [86, 81]", True),
        ("errors == [81, 86]", False),
        ("errors == []", False),
        ("errors != []", True),
        ("[86,81] == errors", True),
        ('prints == ["at 51200", "7"]', True),
        ("prints == ['at 51200', 7]", True),
        ("prints == [at 51200, 7.5 ] ", False),
        ("prints == ['at 51200', 7.5] +- 1", True),
        ("prints == []", False),
        ("virtual_s < 2", True),
        ("virtual_s < 2 - 1", False),
        ("ended == 1", True),
        ("ended == 0", False),
        ('ended == "E"', True),
        ("ended == E", True),
        ("ended != until", True),
        ("ended == 'error'", False),
        ("1 == ended", True),
    ],
)
def test_a_condition_is_a_comparison_over_the_results(text: str, holds: bool) -> None:
    assert parse_condition(text, SEEN).holds(SEEN) is holds


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("position == [100, -200]", True),
        ("position == [102, -198] +- 2", True),
        ("position == [100]", False),
        ('errors == ["?Moving"]', True),
        ("ended == 1", False),
        ("ended == until", True),
    ],
)
def test_a_controller_has_a_position_for_each_axis_and_texts_as_errors(text: str, holds: bool) -> None:
    assert parse_condition(text, STAGE).holds(STAGE) is holds


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("errors == []", "errors == [86, 81]"),
        ("position == 5 +- 2", "position == 51198"),
        ('prints == ["x"]', 'prints == ["at 51200", "7"]'),
        ("ended == until", 'ended == "E"'),
        ("position < virtual_s * 2", "position == 51198, virtual_s == 1.5"),
    ],
)
def test_what_was_seen_is_said_in_the_words_of_conditions(text: str, seen: str) -> None:
    assert parse_condition(text, SEEN).seen(SEEN) == seen


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("position", "not one comparison"),
        ("position = 5", "== compares"),
        ("", "a value is missing"),
        ("speed == 5", "speed is not a result; valid: position, errors, prints, virtual_s, ended"),
        ("@a P == 5", "@a P is not a result"),
        ("1 == 1", "not about a result"),
        ("errors == 86", "a list"),
        ("errors < [86]", "a list"),
        ("errors + 1 == 5", "a list"),
        ("position == [5]", "a list"),
        ("[5] == [5]", "not about a result"),
        ("errors == [[5]]", "] at column 15 is not part"),
        ("errors == [5,,6]", "not a list"),
        ("errors == [", "a line for a drive ends"),
        ("position == 5 and errors == []", "not one comparison"),
    ],
)
def test_a_wrong_condition_is_one_line(text: str, what: str) -> None:
    with pytest.raises(Diagnostic, match=what) as problem:
        parse_condition(text, SEEN)
    assert "\n" not in str(problem.value)


def test_a_calculation_without_a_result_is_said() -> None:
    with pytest.raises(Diagnostic, match="/ 0 has no result"):
        parse_condition("position / errors_0 == 1".replace("errors_0", "(virtual_s - virtual_s)"), SEEN).holds(SEEN)


@given(st.text("positnerv_sd =[]()\"'+-<>!.,0123456789/*%@", max_size=30))
def test_no_text_breaks_the_parser(text: str) -> None:
    try:
        parse_condition(text, SEEN).holds(SEEN)
    except Diagnostic as problem:
        assert "\n" not in str(problem)
