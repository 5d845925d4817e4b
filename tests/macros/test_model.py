"""A macro: its braces and parts, what a line may say of a value, and which values are taken."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.macros import (
    Macro,
    MacroParameter,
    MacroStep,
    check,
    checked_values,
    escape,
    fill,
    filled,
    missing,
    value_names,
)


def macro(*lines: str, on_early_end: tuple[str, ...] = ()) -> Macro:
    return Macro("m", tuple(MacroStep(0.0, line) for line in lines), on_early_end=on_early_end)


@pytest.mark.parametrize(
    ("line", "parameter", "valid"),
    [
        ("{n}", MacroParameter("n"), "one line of text"),
        ("{n:int=10,1..100}", MacroParameter("n", "int", 10, 1, 100), "a whole number, 1 to 100"),
        ("{n:int}", MacroParameter("n", "int"), "a whole number"),
        ("{n: int = -5 , -10 .. }", MacroParameter("n", "int", -5, -10, None), "a whole number, -10 or more"),
        ("{n:float,..2.5}", MacroParameter("n", "float", None, None, 2.5), "a number, 2.5 or less"),
        ("{n:text=to, and..fro}", MacroParameter("n", "text", "to, and..fro"), "one line of text"),
        ("{n:text=}", MacroParameter("n", "text", ""), "one line of text"),
        ("{n:choice(a|b c)=b c}", MacroParameter("n", "choice", "b c", choices=("a", "b c")), "a or b c"),
    ],
)
def test_a_line_says_type_default_and_limits(line: str, parameter: MacroParameter, valid: str) -> None:
    assert macro(line).parameters == (parameter,)
    assert parameter.valid == valid


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("MR {n:whole}", "m.toml: step 1: {n:whole}: invalid type of a value; valid: {NAME:int=10,1..100}"),
        ("MR {n:int=ten}", "invalid n = 'ten'; valid: a whole number"),
        ("MR {n:int=101,1..100}", "invalid n = '101'; valid: a whole number, 1 to 100"),
        ("MR {n:int,9..1}", "no value from 9 to 1"),
        ("MR {n:int,1.5..}", "invalid limit = '1.5'"),
        ("MR {n:choice()}", "invalid choices"),
        ("MR {n:choice(a|a)}", "invalid choices"),
        ("MR {n:choice(a|b)=c}", "invalid n = 'c'; valid: a or b"),
        ("{n:int} {n:float}", "{n:float} differs from n in step 1"),
    ],
)
def test_a_wrong_type_is_told_with_its_step(line: str, says: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        check(macro(line), "m.toml")
    assert says in str(caught.value)


def test_a_plain_name_has_the_type_of_another_line() -> None:
    found = macro("VM {n}", "MR {n:int=7}", "{{n:x}}", on_early_end=("MA {n} {m}",)).parameters
    assert found == (MacroParameter("n", "int", 7), MacroParameter("m"))


def test_the_name_of_a_set_line_is_no_parameter() -> None:
    own = macro("/set far P + {n:int}", "MR {far}")
    assert [each.name for each in own.parameters] == ["n"]
    assert filled(own, {"n": "3"}) == ("/set far P + 3", "MR {far}")


@pytest.mark.parametrize(
    ("kind", "text", "taken"),
    [
        ("int", "+005", "5"),
        ("int", "-7", "-7"),
        ("float", "0.00000012", "0.00000012"),
        ("float", "3.", "3"),
        ("float", ".5", "0.5"),
        ("text", "left ä", "left ä"),
        ("choice(a|b)", "b", "b"),
    ],
)
def test_a_value_is_put_into_the_line(kind: str, text: str, taken: str) -> None:
    assert filled(macro(f"MR {{n:{kind}}} {{n}}"), {"n": text}) == (f"MR {taken} {taken}",)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("int", "1.5"),
        ("int", "1e3"),
        ("int", ""),
        ("int", "١"),
        ("int", "9" * 16),
        ("float", "nan"),
        ("float", "inf"),
        ("float", "1_0"),
        ("choice(a|b)", "A"),
        ("text", "1\rMR 2"),
        ("text", "1\n"),
        ("text", "\x1b"),
        ("text", "\x03"),
        ("text", "a\u202eb"),
    ],
)
def test_a_wrong_value_is_one_line_with_macro_name_and_valid_values(kind: str, text: str) -> None:
    wrong = macro(f"MR {{n:{kind}}}")
    with pytest.raises(Diagnostic, match=r"^macro m: invalid n = .*; valid: ") as caught:
        checked_values(wrong, {"n": text})
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("text", ["/stop", " /stop", "@b MR 1"])
def test_a_value_begins_no_verb_and_names_no_drive(text: str) -> None:
    with pytest.raises(Diagnostic, match=r"macro m, step 1: a value begins the line with [/@]"):
        filled(macro("{n}"), {"n": text})
    assert filled(macro("@{d} {n}"), {"d": "b", "n": "MR 5"}) == ("@b MR 5",)


def test_what_has_no_default_must_be_given() -> None:
    wanting = macro("MR {far:int,1..9} {fast:int=3}", "PR {what}")
    assert [each.name for each in missing(wanting, {"what": "P"})] == ["far"]
    with pytest.raises(Diagnostic, match=r"step 1: no value for \{far\}; set far=VALUE \(a whole number, 1 to 9\)"):
        checked_values(wanting, {"what": "P"})
    assert checked_values(wanting, {"what": "P", "far": "2"}) == {"far": "2", "fast": "3", "what": "P"}


@given(st.text(), st.text())
def test_any_line_with_any_value_is_filled_or_told(line: str, value: str) -> None:
    try:
        names = [each.name for each in macro(line).parameters]
        (one,) = filled(macro(line), dict.fromkeys(names, value))
    except Diagnostic as problem:
        assert str(problem)
    else:
        assert not names or ("\r" not in one.replace(line, "") and "\n" not in value)


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


ONE = (MacroStep(0.0, "MR 1"),)


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
        (Macro("a", (*ONE, MacroStep(-0.001, "x"))), "step 2: invalid after = -0.001"),
        (Macro("a", (MacroStep(float("nan"), "x"),)), "step 1: invalid after = nan"),
        (Macro("a", (MacroStep(float("inf"), "x"),)), "step 1: invalid after = inf"),
        (Macro("a", (MacroStep(0.0, "MR 1\nMR 2"),)), "more than one line"),
        (Macro("a", (MacroStep(0.0, "\ud800"),)), "half a character"),
    ],
)
def test_a_macro_that_cannot_be_kept_is_told(macro: Macro, says: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        check(macro)
    assert says in str(caught.value)
