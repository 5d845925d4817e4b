"""What a line of usage allows: its forms, the words that may follow, the part that fits, and how many it takes."""

from __future__ import annotations

from math import inf

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.line_syntax import split
from multidrop.shell.operations.usage import Place, following, forms, is_placeholder, limits, narrowed
from tests.support.cases import for_each

NAMES, STOP, PORT = "[a|b FILE] NAME ... [--all]", "stop [NOW]", "[HOST:]PORT c"
USAGE = f"/x {NAMES} | {STOP} | {PORT}"


def test_brackets_may_be_left_out_bars_are_a_choice_and_dots_repeat() -> None:
    name, file, every = Place(("NAME",), True), (Place(("a", "b")), Place(("FILE",))), Place(("--all",))
    assert forms(USAGE) == [
        (name,),
        (name, every),
        (*file, name),
        (*file, name, every),
        (Place(("stop",)),),
        (Place(("stop",)), Place(("NOW",))),
        (Place(("[HOST:]PORT",)), Place(("c",))),
    ]
    assert forms("/y") == [()]
    assert forms("/y [[A] b]") == [(), (Place(("b",)),), (Place(("A",)), Place(("b",)))]


@for_each(
    "typed, words",
    [
        ("", ["NAME", "a", "b", "stop", "[HOST:]PORT"]),
        ("a", ["FILE"]),
        ("b", ["FILE"]),
        ("a f", ["NAME"]),
        ("a f n", ["NAME", "--all"]),
        ("a f n n", ["NAME", "--all"]),
        ("stop", ["NOW"]),
        ("stop now", []),
        ("x", ["NAME", "--all", "c"]),
        ("x y", ["NAME", "--all"]),
        ("x y --all", []),
        ("x c", []),  # a literal takes precedence
        ("--all", []),
        ("--other", []),
    ],
)
def test_the_words_that_may_follow_are_named_once(typed: str, words: list[str]) -> None:
    assert following(USAGE, typed.split()) == words


@for_each(
    "typed, part",
    [
        ("a", NAMES),
        ("b f", NAMES),
        ("stop", STOP),
        ("stop no", STOP),
        ("1 c", PORT),
        ("s", f"{NAMES} | {STOP} | {PORT}"),
        ("st", f"{NAMES} | {STOP} | {PORT}"),
        ("FILE", f"{NAMES} | {PORT}"),
        ("x", f"{NAMES} | {PORT}"),
        ("1 c d", f"{NAMES} | {STOP} | {PORT}"),
        ("no fit --zz", f"{NAMES} | {STOP} | {PORT}"),
        ("", f"{NAMES} | {STOP} | {PORT}"),
    ],
)
def test_only_the_forms_that_begin_so_are_shown_else_all(typed: str, part: str) -> None:
    assert narrowed(USAGE, typed.split()) == f"/x {part}"


@for_each(
    "usage, least, most",
    [
        (USAGE, 1, inf),
        ("/y", 0, 0),
        ("/y A [B]", 1, 2),
        ("/y A | B C D", 1, 3),
        ("/y [A ...]", 0, inf),
        ("/y A ...", 1, inf),
    ],
)
def test_a_line_takes_so_many_words(usage: str, least: int, most: float) -> None:
    assert limits(usage) == (least, most)


@for_each("word, is_one", [("NAME", True), ("name", False), ("--ALL", False), ("[HOST:]PORT", True), ("5", False)])
def test_a_placeholder_has_a_capital_letter(word: str, is_one: bool) -> None:
    assert is_placeholder(word) is is_one


@for_each(
    "text, words",
    [
        ('a "b c" d', ["a", "b c", "d"]),
        ("'x  y' z", ["x  y", "z"]),
        (r"C:\new a#b", [r"C:\new", "a#b"]),
        ('""', [""]),
        ("", []),
    ],
)
def test_words_lose_their_quotation_marks_only(text: str, words: list[str]) -> None:
    assert split(text, "/w") == words


def test_a_quotation_mark_that_is_not_closed_is_named_with_its_place() -> None:
    with pytest.raises(Diagnostic) as caught:
        split('a "b', "/w")
    assert str(caught.value) == "/w: a quotation mark is not closed"
