"""Keys under the names of functions: read, changed, refused where they clash or stop; pages of function keys."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual.binding import Binding

from multidrop.shell.configuration import ScreenSettings
from multidrop.tui.app import MultidropApp, bindings
from multidrop.tui.keymap import FunctionKeys, keymap, read_key
from multidrop.tui.screens.all_drives import AllDrives
from multidrop.tui.screens.dialogs import SearchDialog
from multidrop.tui.screens.page import PAGES, Page, PageEntry
from multidrop.tui.widgets.theme import Signs
from tests.support.fake_session import FakeAssist, FakeMacro, FakeMacros, demo_session, press, settle


@pytest.mark.parametrize(
    ("written", "key"),
    [
        ("^T", "ctrl+t"),
        ("Ctrl+T", "ctrl+t"),
        ("ctrl + pgup", "ctrl+pageup"),
        ("F3", "f3"),
        ("Alt+1", "alt+1"),
        ("shift+ctrl+f5", "ctrl+shift+f5"),
        ("Home", "home"),
        ("t", ""),
        ("", ""),
        ("^^", ""),
        ("Hyper+T", ""),
        ("F99", ""),
    ],
)
def test_a_key_is_read_as_people_write_it(written: str, key: str) -> None:
    assert read_key(written) == key


def test_no_two_functions_have_the_same_key_of_their_own() -> None:
    assert keymap(bindings(), {}).troubles == []
    keys = [key for keys in keymap(bindings(), {}).keys.values() for key in keys.split(",")]
    assert sorted(keys) == sorted(set(keys))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_has_no_key_that_can_be_set_as_it_is_imported_after_the_keys_are_read(page: PageEntry) -> None:
    own = [each for each in page.page().BINDINGS if isinstance(each, Binding) and each not in Page.BINDINGS]
    assert [each.id for each in own if each.id] == []


@pytest.mark.parametrize(
    ("wanted", "trouble"),
    [
        ({"paltte": "^T"}, "keys.paltte: no such function"),
        ({"palette": "^X"}, "keys.palette: ^X stops all drives"),
        ({"palette": "ctrl+shift+x"}, "stops all drives"),
        ({"palette": "Enter"}, "keys.palette: Enter cannot be given away"),
        ({"palette": "^I"}, "keys.palette: ^I cannot be given away"),
        ({"palette": "p"}, "keys.palette: p is not a key"),
        ({"palette": "^O"}, "keys.palette: ^O is the key of drive"),
        ({"palette": "^T", "drive": "^T"}, "is the key of"),
    ],
)
def test_a_wrong_setting_is_said_and_changes_nothing(wanted: dict[str, str], trouble: str) -> None:
    found = keymap(bindings(), wanted)
    assert any(trouble in each for each in found.troubles)
    assert found.keys["palette"] in ("ctrl+p", "ctrl+t")


def test_two_functions_can_exchange_their_keys() -> None:
    found = keymap(bindings(), {"palette": "^O", "drive": "^P"})
    assert found.troubles == []
    assert found.changed == {"palette": "ctrl+o", "drive": "ctrl+p"}


@given(st.dictionaries(st.sampled_from(["palette", "drive", "nothing"]), st.text(max_size=8)))
def test_whatever_is_set_the_stop_stays_the_stop_and_every_function_has_its_own_key(wanted: dict[str, str]) -> None:
    found = keymap(bindings(), wanted)
    keys = [key for keys in found.keys.values() for key in keys.split(",")]
    assert len(keys) == len(set(keys)) and not any(key.endswith("+x") for key in keys)


@pytest.mark.tui
async def test_a_key_that_was_set_works_and_is_shown() -> None:
    screen_settings = ScreenSettings(
        signs="full", keys={"palette": "^T", "page-drives": "F9", "play-f9": "Ctrl+F9"}, where="multidrop.toml"
    )
    app = MultidropApp(demo_session(), (), FakeAssist(), screen_settings=screen_settings)
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot)
        assert "^T everything" in app.main.lines("footer").plain and "F9 all drives" in app.main.lines("footer").plain
        await pilot.press("ctrl+p")
        assert app.screen is app.main
        await pilot.press("ctrl+t")
        assert isinstance(app.screen, SearchDialog)
        await pilot.press("escape", "f9")
        assert isinstance(app.screen, AllDrives)
        await pilot.press("ctrl+t")
        assert isinstance(app.screen, SearchDialog)
        await press(pilot, "ctrl+x")
        assert app.session.stops == 1


@pytest.mark.tui
async def test_a_wrong_setting_is_said_at_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("multidrop.toml").write_text('[screen]\ntheme = "no-such"\nsigns = "ascii"\n[keys]\nnothing = "^T"\n')
    screen_settings = ScreenSettings("no-such", "ascii", keys={"nothing": "^D"}, where="multidrop.toml")
    app = MultidropApp(demo_session(), (), FakeAssist(), screen_settings=screen_settings)
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot)
        shown = app.main.page("press").plain
        assert "multidrop.toml:5: keys.nothing: no such function" in shown
        assert "multidrop.toml:2: screen.theme: no theme no-such" in shown
        assert app.signs.font is Signs.ASCII


@pytest.mark.tui
async def test_ctrl_a_goes_to_the_start_of_a_line_and_from_there_to_all_drives() -> None:
    app = MultidropApp(demo_session(), (), FakeAssist(), screen_settings=ScreenSettings(signs="full"))
    async with app.run_test(size=(80, 24)) as pilot:
        await pilot.press(*"R 5", "ctrl+a", "M")
        assert app.main.entry.value == "MR 5"
        await pilot.press("ctrl+a", "ctrl+a")
        assert isinstance(app.screen, AllDrives)
        await pilot.press("escape")
        assert app.main.entry.value == "MR 5"


@pytest.mark.tui
async def test_help_is_for_where_you_are_and_can_be_searched() -> None:
    app = MultidropApp(demo_session(), (), FakeAssist(), screen_settings=ScreenSettings(signs="full"))
    async with app.run_test(size=(80, 24)) as pilot:
        await pilot.press("ctrl+a", "f1")
        assert isinstance(app.screen, SearchDialog)
        shown = [match.text.plain for match in app.screen.found]
        assert shown[0] == "All drives" and shown[1].startswith("Every drive of every line has a row")
        assert shown[2] == "Used most" and [row.split()[0] for row in shown[3:9]] == [
            "^X",
            "Enter",
            "Esc",
            "^Y",
            "^N",
            "^O",
        ]
        assert shown[9] == "Rows" and shown[10].startswith("↑↓")
        assert next(each for each in shown if each.startswith("^G")) in shown[shown.index("Near") :]
        assert not any(each.startswith("^A") for each in shown)
        await pilot.press(*"stop all")
        assert [match.text.plain.split()[0] for match in app.screen.found] == ["^X"]
        await pilot.press("escape", "escape")
        assert app.screen is app.main


@pytest.mark.tui
async def test_what_was_used_lately_comes_after_the_stop() -> None:
    app = MultidropApp(demo_session(), (), FakeAssist(), screen_settings=ScreenSettings(signs="full"))
    async with app.run_test(size=(80, 24)) as pilot:
        await pilot.press("ctrl+p", *"mouse off", "enter", "ctrl+p")
        assert isinstance(app.screen, SearchDialog)
        first, second = app.screen.found[:2]
        assert first.text.plain.startswith("Stop all") and first.text.plain.endswith("^X")
        assert second.text.plain.startswith("Mouse on")


# Pages of function keys


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
