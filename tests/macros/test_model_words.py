"""What a person reads of a macro: its values, its line in the list, and what is wrong with a part of it."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.macros import (
    Macro,
    MacroParameter,
    MacroStep,
    check,
    check_name,
    checked_values,
    fill,
    filled,
    is_role,
    page_order,
)
from multidrop.macros.model import describe_clash, written
from tests.support.cases import for_each

ONE = (MacroStep(0.0, "MR 1"),)


def refusal(macro: Macro) -> str:
    """What `check` says of a macro, with the places that a file would have."""
    with pytest.raises(Diagnostic) as caught:
        check(macro, "m.toml", lambda key, step: f"m.toml:{key}.{step}")
    return str(caught.value)


@for_each(
    "parameter, summary, example",
    [
        (MacroParameter("n"), "n", "x"),
        (MacroParameter("n", default=""), "n=", "x"),
        (MacroParameter("n", default="to"), "n=to", "x"),
        (MacroParameter("n", "int", 10, 1, 100), "n=10 (a whole number, 1 to 100)", "1"),
        (MacroParameter("n", "int", 0), "n=0 (a whole number)", "0"),
        (MacroParameter("n", "int", None, None, 7), "n (a whole number, 7 or less)", "0"),
        (MacroParameter("n", "int", None, None, -7), "n (a whole number, -7 or less)", "-7"),
        (MacroParameter("n", "int", None, 0), "n (a whole number, 0 or more)", "0"),
        (MacroParameter("n", "float", 0.5, 0.0, 2.5), "n=0.5 (a number, 0 to 2.5)", "0"),
        (MacroParameter("n", "float", 1e-7, 1e-7), "n=0.0000001 (a number, 0.0000001 or more)", "0.0000001"),
        (MacroParameter("n", "choice", "b", choices=("a", "b")), "n=b (a or b)", "a"),
    ],
)
def test_a_value_is_listed_with_its_default_and_what_is_valid(
    parameter: MacroParameter, summary: str, example: str
) -> None:
    assert (parameter.summary, parameter.example) == (summary, example)
    parameter.take(example)


@for_each(
    "value, text",
    [
        (7, "7"),
        (2.0, "2"),
        (-0.5, "-0.5"),
        (1e15, "1000000000000000"),
        (1e-9, "0.000000001"),
        ("2.0", "2.0"),
        (20.0, "20"),
    ],
)
def test_a_number_is_written_without_an_exponent(value: int | float | str, text: str) -> None:
    assert written(value) == text


@for_each(
    "kind, text, taken",
    [
        ("int", "1000000000000000", 10**15),
        ("int", "-1000000000000000", -(10**15)),
        ("int", "1000000000000001", None),
        ("int", "-1000000000000001", None),
        ("int", "00000000000000007", None),
        ("int", "0000000000000007", 7),
        ("float", "1000000000000000.", 1e15),
        ("float", "0.1000000000000000", 0.1),
        ("float", "+.5", 0.5),
        ("float", "-0", 0.0),
        ("float", "007.50", 7.5),
        ("float", ".", None),
        ("float", "5e3", None),
    ],
)
def test_numbers_are_taken_up_to_their_limits(kind: str, text: str, taken: int | float | None) -> None:
    try:
        assert MacroParameter("n", kind).take(text, "here") == taken
    except Diagnostic as problem:
        assert taken is None and str(problem).startswith(f"here: invalid n = '{text}'; valid: ")


def test_limits_are_valid_values_themselves_and_digits_that_would_be_lost_are_told() -> None:
    parameter = MacroParameter("n", "int", low=-5, high=5)
    assert [parameter.take(each) for each in ("-5", "5")] == [-5, 5]
    for each in ("-6", "6"):
        with pytest.raises(Diagnostic, match=f"invalid n = '{each}'; valid: a whole number, -5 to 5"):
            parameter.take(each)
    with pytest.raises(
        Diagnostic, match=r"^here: n = 1234567.1234567890123 has more digits than are kept; as 1234567.1"
    ):
        MacroParameter("n", "float").take("1234567.1234567890123", "here")


@for_each(
    "line, parameter",
    [
        ("{n:int,5..5}", MacroParameter("n", "int", None, 5, 5)),
        ("{n:float=2,..}", MacroParameter("n", "float", 2.0)),
        ("{n:choice( a | b )=a}", MacroParameter("n", "choice", "a", choices=("a", "b"))),
        ("{n: text=1,2..3}", MacroParameter("n", "text", "1,2..3")),
        ("{n:int = 3 , 1 .. 9}", MacroParameter("n", "int", 3, 1, 9)),
    ],
)
def test_a_type_may_be_written_in_many_ways(line: str, parameter: MacroParameter) -> None:
    assert Macro("m", (MacroStep(0.0, line),)).parameters == (parameter,)


@for_each(
    "macro, told",
    [
        (
            Macro("m", (*ONE, MacroStep(0.0, "{n:choice(a|b),1..2}"))),
            "m.toml:line.2: step 2: {n:choice(a|b),1..2}: invalid choi",
        ),
        (
            Macro("m", (*ONE, MacroStep(0.0, "{n:choice(a||b)}"))),
            "m.toml:line.2: step 2: {n:choice(a||b)}: invalid choices",
        ),
        (
            Macro("m", (MacroStep(0.0, "{n:int}"),), on_early_end=("SL 0", "{n:float}")),
            "m.toml:on_early_end.0: on_early_end 2: {n:float} differs from n in step 1; write {n} in one of them, or "
            "the same type in both",
        ),
        (Macro("m", ONE, key="F1"), "m.toml:key.0: invalid key 'F1'; use F2 to F12, or key = \"\""),
        (
            Macro("m", ONE, page="a b"),
            "m.toml:page.0: invalid page 'a b'; use a number, or up to 16 letters, digits, - a",
        ),
        (Macro("m", ONE, page="x" * 17), "m.toml:page.0: invalid page"),
        (Macro("m", ONE, note="\ud800"), "m.toml:note.0: note: half a character at position 1; type the line again"),
        (Macro("m", ONE, roles=("a b",)), "m.toml:roles.0: invalid role 'a b'; use letters, digits, - and _"),
        (Macro("m", ONE, roles=("a", "b", "a")), "m.toml:roles.0: a role is named twice; name each role once"),
        (
            Macro("m", (MacroStep(0.0, "{b} {a}"),), roles=("a", "b")),
            "m.toml:roles.0: a is a role and a value; give one of them another name",
        ),
        (
            Macro("m", (*ONE, MacroStep(0.0, "a\rb"))),
            "m.toml:line.2: step 2: more than one line of text; give each line a [[",
        ),
        (
            Macro("m", (*ONE, MacroStep(-1.0, "x"))),
            "m.toml:after.2: step 2: invalid after = -1.0; valid: 0.0 s or more",
        ),
        (
            Macro("m", (*ONE, MacroStep(0.0, "x", "\ud800"))),
            "m.toml:replies.2: step 2: what was recorded: half a character at position 1",
        ),
        (
            Macro("m", (*ONE, MacroStep(0.0, "x", "", ("ok", "no\ud800")))),
            "m.toml:replies.2: step 2: what was recorded: half a character at position 3",
        ),
        (Macro("m", ONE, on_early_end=("SL 0", "a\nb")), "m.toml:on_early_end.0: on_early_end 2: more than one line"),
        (Macro("m", ()), "m.toml: a macro without steps; add a [[step]] with after = 0.0 and line ="),
        (Macro("-m", ONE), "m.toml:name.0: invalid macro name '-m'; use up to 64 letters, digits, - and _, the first"),
    ],
)
def test_a_wrong_part_of_a_macro_is_told_at_its_place(macro: Macro, told: str) -> None:
    assert refusal(macro).startswith(told)


def test_a_macro_of_all_parts_is_right() -> None:
    check(
        Macro(
            "a" * 64,
            (MacroStep(0.0, "@press:a MR {n:int=1}", "press:a", ("ok",)),),
            "F12",
            "a note",
            "page-of_16-chars",
            ("press", "gantry"),
            ("SL 0",),
        )
    )
    for key in ("F2", "F12", ""):
        check(Macro("m", ONE, key))


@for_each(
    "text, is_one", [("press", True), ("a-B_9", True), ("", False), ("a b", False), ("a.b", False), ("\u00e4", False)]
)
def test_a_role_is_one_word(text: str, is_one: bool) -> None:
    assert is_role(text) == is_one


@pytest.mark.parametrize("name", ["con", "COM5"])
def test_a_device_of_windows_is_no_name_there(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr("sys.platform", "linux")
        check_name(name)
        patched.setattr("sys.platform", "win32")
        check_name("press")
        with pytest.raises(Diagnostic, match=f"^here: Windows takes {name} for a device; use another name$"):
            check_name(name, "here")


@for_each(
    "macro, place, values, summary",
    [
        (Macro("m", ONE), "", "", "m                -    1 line"),
        (Macro("m", ONE * 2, "F3", "a note"), "F3", "", "m                F3   2 lines  a note"),
        (Macro("m", ONE, "F3", page="2"), "F3 (page 2)", "", "m                F3 (page 2) 1 line"),
        (Macro("m", ONE, page="2"), "", "", "m                -    1 line"),
        (
            Macro("a-name-of-17-char", (MacroStep(0.0, "{n:int=1} {m}"),), roles=("press", "gantry"), note="x"),
            "",
            "values: n=1 (a whole number), m  roles: press, gantry",
            "a-name-of-17-char -    1 line  values: n=1 (a whole number), m  roles: press, gantry  x",
        ),
        (Macro("m", ONE, roles=("press",)), "", "roles: press", "m                -    1 line  roles: press"),
    ],
)
def test_a_macro_is_listed_in_one_line(macro: Macro, place: str, values: str, summary: str) -> None:
    assert (macro.place, macro.values, macro.summary) == (place, values, summary)


def test_pages_come_as_numbers_and_then_as_words() -> None:
    assert sorted(["b", "10", "a", "2", "1"], key=page_order) == ["1", "2", "10", "a", "b"]


@for_each(
    "names, told",
    [
        (["a", "b"], "a and b are both on F5, which plays none of them"),
        (["a", "b", "c"], "a and b and c are all on F5, which plays none of them"),
    ],
)
def test_macros_on_one_key_are_named(names: list[str], told: str) -> None:
    assert describe_clash("F5", names) == told


@for_each(
    "lines, given, told",
    [
        (["MR 1"], {"n": "1"}, "macro m: no line takes the value n; the macro takes no values"),
        (["{a} {b}"], {"n": "1"}, "macro m: no line takes the value n; valid: a, b"),
        (["MR 1", "MR {a}"], {}, "macro m, step 2: no value for {a}; set a=VALUE, or write {{ for a brace"),
        (
            ["MR 1", "{a}"],
            {"a": "/stop"},
            "macro m, step 2: a value begins the line with /; valid: text for the drive only",
        ),
        (["  {a}"], {"a": "@b"}, "macro m, step 1: a value begins the line with @"),
    ],
)
def test_values_that_do_not_fit_are_told_with_the_step(lines: list[str], given: dict[str, str], told: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        checked_values(Macro("m", tuple(MacroStep(0.0, line) for line in lines)), given)
    assert str(caught.value).startswith(told)


@for_each(
    "line, given, played",
    [
        ("MR {n}", {"n": "5 mm"}, "MR {5 mm}"),
        ("MR {n}", {"n": "-2.5 turn/s"}, "MR {-2.5 turn/s}"),
        ("MR {n}", {"n": "300 rpm"}, "MR {300 rpm}"),
        ("MR {n}", {"n": "5 apples"}, "MR 5 apples"),
        ('PR "{n}"', {"n": "5 mm"}, 'PR "5 mm"'),
        ('PR "a" {n}', {"n": "5 mm"}, 'PR "a" {5 mm}'),
        ("/print {n}", {"n": "5 mm"}, "/print 5 mm"),
        ("/expect {n}", {"n": "5 mm"}, "/expect 5 mm"),
        ("/printed {n}", {"n": "5 mm"}, "/printed {5 mm}"),
        ("MR {12.5 mm} {{x}}", {}, "MR {12.5 mm} {x}"),
    ],
)
def test_a_value_that_is_a_quantity_is_in_braces_but_in_a_text(line: str, given: dict[str, str], played: str) -> None:
    assert fill(line, given) == played
    assert filled(Macro("m", (MacroStep(0.0, line),)), given) == (played,)


def test_a_lone_brace_is_told_with_its_column_and_how_to_write_one() -> None:
    for line, told in (
        ("a { b", "x: a lone { at column 3; write {{ for a brace"),
        ("}", "x: a lone } at column 1; write }} for a brace"),
        ("{N}", "x: no value for {N}; set N=VALUE, or write {{ for a brace"),
    ):
        with pytest.raises(Diagnostic) as caught:
            fill(line, {}, "x")
        assert str(caught.value) == told
