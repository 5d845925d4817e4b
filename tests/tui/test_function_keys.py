"""Pages of function keys: what each key plays, and what the key row says."""

from __future__ import annotations

from multidrop.tui.keymap import FunctionKeys
from tests.support.fake_session import FakeMacro, FakeMacros


def read(*macros: FakeMacro) -> FunctionKeys:
    keys = FunctionKeys()
    keys.read(FakeMacros(*macros))
    return keys


def test_each_page_has_keys_of_its_own() -> None:
    keys = read(FakeMacro("a", "F3"), FakeMacro("b", "F3", page="jog"), FakeMacro("c", "F2", page="10"), FakeMacro("d"))
    assert keys.pages == ["1", "10", "jog"]
    seen = []
    for _ in range(4):
        seen.append((keys.place, keys.keys, keys.bound))
        keys.turn()
    assert seen == [
        ("keys 1", {"F3": "a"}, [("F3", "a")]),
        ("keys 10", {"F2": "c"}, [("F2", "c")]),
        ("keys jog", {"F3": "b"}, [("F3", "b")]),
        ("keys 1", {"F3": "a"}, [("F3", "a")]),
    ]


def test_one_page_is_not_named() -> None:
    keys = read(FakeMacro("a", "F3"))
    keys.turn()
    assert (keys.place, keys.keys) == ("", {"F3": "a"})


def test_a_page_whose_last_macro_is_gone_is_left() -> None:
    keys = read(FakeMacro("a", "F3"), FakeMacro("b", "F3", page="2"))
    keys.turn()
    keys.read(FakeMacros(FakeMacro("a", "F3")))
    assert (keys.page, keys.keys) == ("1", {"F3": "a"})


def test_a_clash_is_one_of_a_page() -> None:
    keys = read(FakeMacro("a", "F3", page="2"), FakeMacro("b", "F3", page="2"), FakeMacro("c", "F3"))
    assert (keys.clash("F3"), keys.keys) == ("", {"F3": "c"})
    keys.turn()
    assert keys.keys == {} and keys.shown == [("F3", "2 macros!")]
    assert (
        keys.clash("F3") == "a and b are both on F3, which plays none of them; /key F3 NAME --page 2 leaves one on it"
    )


def test_a_held_key_counts_once_and_another_key_or_a_later_press_again() -> None:
    keys = read()
    assert [keys.held("F3", now / 30) for now in range(90)] == [False] + [True] * 89
    assert not keys.held("F4", 3.0) and not keys.held("F3", 3.01) and not keys.held("F3", 3.3)
