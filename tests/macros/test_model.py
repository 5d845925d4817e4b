import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.errors import Diagnostic
from multidrop.macros import Macro, Step, check, escape, fill, value_names


@given(st.text())
def test_an_escaped_line_is_played_as_it_was_typed(line: str) -> None:
    assert fill(escape(line), {}) == line
    assert value_names(escape(line)) == set()


def test_values_stand_where_their_names_stood() -> None:
    assert value_names("MR {FAR} {{x}} {b-2}{FAR}") == {"FAR", "b-2"}
    assert fill("MR {FAR} {{x}}{{{FAR}}}", {"FAR": "512"}) == "MR 512 {x}{512}"


def test_a_value_with_braces_is_not_filled_again() -> None:
    assert fill("{A}", {"A": "{B}"}) == "{B}"


@pytest.mark.parametrize(
    ("line", "says"),
    [("MR {FAR}", "no value for {FAR}"), ("a } b", "a lone } at column 3"), ("{a b}", "a lone { at column 1")],
)
def test_a_line_that_cannot_be_filled_is_told(line: str, says: str) -> None:
    with pytest.raises(Diagnostic, match="x.toml: ") as caught:
        fill(line, {}, "x.toml")
    assert says in str(caught.value)


ONE = (Step(0.0, "MR 1"),)


@pytest.mark.parametrize(
    ("macro", "says"),
    [
        (Macro("", ONE), "invalid macro name ''"),
        (Macro("../up", ONE), "invalid macro name"),
        (Macro("-x", ONE), "invalid macro name"),
        (Macro("a\n", ONE), "invalid macro name"),
        (Macro("ä", ONE), "invalid macro name"),
        (Macro("a" * 65, ONE), "invalid macro name"),
        (Macro("a", ONE, key="F1"), "key 'F1'"),
        (Macro("a", ONE, key="F13"), "key 'F13'"),
        (Macro("a", ()), "without steps"),
        (Macro("a", (*ONE, Step(-0.001, "x"))), "step 2: invalid after = -0.001"),
        (Macro("a", (Step(float("nan"), "x"),)), "step 1: invalid after = nan"),
        (Macro("a", (Step(float("inf"), "x"),)), "step 1: invalid after = inf"),
        (Macro("a", (Step(0.0, "MR 1\nMR 2"),)), "more than one line"),
        (Macro("a", (Step(0.0, "\ud800"),)), "half a character"),
    ],
)
def test_a_macro_that_cannot_be_kept_is_told(macro: Macro, says: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        check(macro)
    assert says in str(caught.value)
