"""The one table of keys: every key that is shown does something, and means the same wherever it works."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import pytest
from textual import actions, events
from textual.pilot import Pilot

from multidrop.base.files import rows
from multidrop.shell.channel import AskedValue
from multidrop.tui import palette
from multidrop.tui.actions import ScreenActions
from multidrop.tui.app import MultidropApp, bindings
from multidrop.tui.key_table import SHEETS, all_groups, footer
from multidrop.tui.keymap import keymap
from multidrop.tui.screens.dialogs import InputField
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.screens.page import PAGES
from multidrop.tui.widgets.bars import STOP, footer_row
from tests.support import key_docs
from tests.support.fake_session import FakeSession, a_move, a_talk, binding_of, demo_session, make_app, settle

SIZES = [(80, 24), (120, 40), (200, 50)]


def single_keys(name: str) -> list[tuple[str, str]]:
    """(key, action) of every key of a sheet, each alternative by itself."""
    return [
        (key, action) for each in SHEETS[name].keys for keys, action, _ in each.single for key in keys.split(",") if key
    ]


def test_the_table_in_the_documentation_is_the_table_of_the_program() -> None:
    page = key_docs.PAGE.read_text(encoding="utf-8")
    assert key_docs.written(page) == page, "python -m tests.support.key_docs writes it anew"


KINDS = {
    "^B, Ins": {"hold", "break", "end", "raw", "backup"},  # hold, end or keep
    "^D": {"traffic", "download"},
    "^E": {"program", "open", "edit"},  # a text in the editor
    "^F": {"find", "next error", "compare", "find drives"},  # find
    "^K": {"macros", "key"},
    "^R": {"lines before", "run", "restore"},  # lines to send
    "^T": {"step", "times"},
}
"""The keys that have several words, each of one page."""


def test_a_letter_and_a_key_with_ctrl_do_one_kind_of_thing_wherever_they_work() -> None:
    words: dict[str, set[str]] = defaultdict(set)
    for sheet in SHEETS.values():
        for each in sheet.keys:
            if each.word and key_docs.kind(each) != "other":
                words[key_docs.spelled(each)].add(each.word)
    assert {keys: found for keys, found in words.items() if len(found) > 1} == KINDS


def footer_of(name: str, width: int) -> str:
    keys = [(key.shown, key.word) for key in footer(name)]
    row = footer_row(keys, False, False, width, "", "F1")
    return "".join(text for text, _ in row).strip()


FOOTERS_80 = {
    "main": "F1 help  ^P everything  ^Y why  ^O drive  ^A all drives",
    "setup": "Enter edit  ^S save  ↑↓ choose  Tab axis  Esc back  F1 help",
    "drives": "Enter select  Esc back  ^Y why  ^N controls  ^O drive  F1 help",
    "why": "r read error  t traffic  ^N controls  ^E program  Esc back  F1",
    "plot": "Space hold  g trigger  ←→ cursor  +- time  Esc back  F1 help",
    "macros": "Enter play  ^B end  ^E edit  ^K key  ^T times  Del delete  F1",
    "program": "^D download  ^R run  ^B break  ^F next error  ^E open  F1 help",
    "parameters": "Enter edit  ^S save  ^F compare  ^R restore  ^B backup  F1",
    "controls": "←→ jog  m move to  h home  Space stop  e enable  d disable  F1",
    "traffic": "Space hold  ↑↓ look back  End follow  i its polls  f form  F1",
}
MORE_AT_120 = {
    "main": "^N controls  ^G plots  ^E program",
    "setup": "^P everything",
    "drives": "^P everything",
    "why": "^P everything",
    "plot": "↑↓ values  x cursor 2",
    "macros": "Esc back  Tab key page  ^P everything",
    "program": "^S save  ^T step  Esc back  ^O drive",
    "parameters": "Esc back  ^P everything",
    "controls": "↑↓ step  Esc back",
    "traffic": "Esc back  ^P everything",
}


@pytest.mark.parametrize("name", FOOTERS_80)
def test_the_footer_of_a_page_begins_with_its_own_keys_and_has_the_help_at_80_and_120_columns(name: str) -> None:
    assert footer_of(name, 80) == f"{STOP}    {FOOTERS_80[name]}"
    own = FOOTERS_80[name].removesuffix("  F1").removesuffix("  F1 help")
    wide = footer_of(name, 120)
    assert wide.startswith(f"{STOP}    {own}  {MORE_AT_120[name]}") and "  F1" in wide


@pytest.mark.parametrize("name", [page.name for page in PAGES])
def test_any_page_names_one_of_its_own_keys_first_and_the_help_at_80_columns(name: str) -> None:
    assert footer(name)[0] in SHEETS[name].keys
    assert "  F1" in footer_of(name, 80)


@pytest.mark.parametrize("name", ["main", *(page.name for page in PAGES)])
def test_each_word_of_a_footer_is_that_of_a_key_and_no_key_is_in_it_twice(name: str) -> None:
    words = [key.word for key in footer(name)]
    assert [word for word in SHEETS[name].foot if word != "*" and word not in words] == []
    assert len({*words}) == len(words)


def test_no_capital_is_a_key() -> None:
    assert [key for name in SHEETS for key, _ in single_keys(name) if len(key) == 1 and key != key.lower()] == []


def test_the_prefixes_of_screen_and_tmux_have_an_alternative() -> None:
    for prefix, other in (("ctrl+a", "home"), ("ctrl+b", "insert")):
        on = [name for name in SHEETS if any(key == prefix for key, _ in single_keys(name))]
        assert on
        for name in on:
            beside = "main" if name == "app" else name
            assert any(key == other for key, _ in single_keys(beside)), (prefix, name)


def test_no_function_key_but_those_of_macros_moves_and_none_is_a_stop() -> None:
    keys = {key: action for name in SHEETS for key, action in single_keys(name) if key[0] == "f" and key[1:].isdigit()}
    assert keys.pop("f1") == "act.help"
    assert set(keys.values()) == {f"act.play('F{n}')" for n in range(2, 13)}


@pytest.mark.parametrize("name", SHEETS)
def test_a_sheet_says_what_it_is_for_in_five_sentences_at_most(name: str) -> None:
    sheet = SHEETS[name]
    assert bool(sheet.about) is (sheet.title not in ("everywhere", "boxes"))
    assert sheet.about.count(". ") + 1 <= 5
    assert all(len(sentence.split()) <= 24 for sentence in sheet.about.split(". "))


def noticed(app: MultidropApp, key: str) -> bool:
    """True if a key has a function now that exists, or is a character for the part with the focus."""
    found = binding_of(app, key)
    if found is None:
        return False
    place, name, _ = actions.parse(found[0].action)
    target = app if place == "app" else getattr(app, place) if place else found[1]
    return hasattr(target, f"action_{name}") or hasattr(target, f"_action_{name}")


def shown_keys(name: str) -> list[str]:
    """Every key that footer and F1 show on a page, each alternative by itself, those that leave it last."""
    keys = [
        key
        for of_group in all_groups(name).values()
        for each in of_group
        for keys, _, _ in each.single
        for key in keys.split(",")
        if key
    ]
    return list(dict.fromkeys(keys))


async def pressed(app: MultidropApp, key: str) -> None:
    """Press a key, and let it do what it does."""
    app.post_message(events.Key(key, key if len(key) == 1 else None))
    for _ in range(2000):
        if app.keyboard.idle and not app.leaving.undecided:
            return
        await asyncio.sleep(0)


async def walked(pilot: Pilot[int], session: FakeSession, name: str, keys: Iterable[str]) -> None:
    """Press every key on a page: each is noticed, and after each the stop works."""
    app = pilot.app
    assert isinstance(app, MultidropApp)

    screen = app.screen
    for key in keys:
        while app.screen is not app.main and getattr(app.screen, "SHEET", "") != name:
            app.screen.dismiss(None)
            await pilot.pause()
        if name != "main" and app.screen is app.main:
            await app.run_action(f"act.page('{name}')")
        if name != "main" and isinstance(app.focused, InputField) or app.screen is not screen:
            await settle(pilot)  # a field that the stop has closed, or another page
            screen = app.screen
        assert noticed(app, key), f"{key} on {name}"
        stops = session.stops
        await pressed(app, key)
        await pressed(app, "ctrl+x")
        assert session.stops == stops + 1, f"the stop after {key} on {name}"
        app.tick()
        assert app.return_code != 1, f"{key} on {name}"


@pytest.mark.tui
@pytest.mark.wide
@pytest.mark.parametrize("size", SIZES, ids=lambda size: "x".join(map(str, size)))
@pytest.mark.parametrize("name", ["main", *(page.name for page in PAGES)])
async def test_every_key_that_is_shown_is_noticed_and_the_stop_works_after_it(
    name: str, size: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.mxt").write_text("PG 1\nLB G1\nH 100\nE\nPG\n")
    session = demo_session()
    session.moves = ["a moves"]  # else ^Q ends the program without a question
    app = make_app(session)
    async with app.run_test(size=size) as pilot:
        session.emit(*a_talk(session), *a_move(session))
        app.texts.open("a.mxt")
        await settle(pilot)
        await walked(pilot, session, name, shown_keys(name))


async def opened(app: MultidropApp, name: str) -> None:
    """Open a box, or a bar of the main screen."""
    if name in BOXES:
        for key in BOXES[name]:
            await pressed(app, key)
    elif name == "start":
        await app.run_action("act.open")
    elif name == "answers":
        await app.questions.paste(["MR 1", "MR 2"], lambda lines: None)
    elif name == "question":
        app.run_worker(app.questions.go_on("Send it?"))
    else:
        app.run_worker(app.questions.fill("go", [AskedValue("speed", "a number", "5", lambda text: "")]))


BOXES = {
    "list": ("ctrl+p",),
    "line": ("f9",),
    "find": ("P", "ctrl+f", "P"),
    "pick": ("shift+up",),
}


@pytest.mark.tui
@pytest.mark.parametrize("name", [*BOXES, "start", "answers", "question", "form"])
async def test_every_key_of_a_box_is_noticed_and_the_stop_works_after_it(name: str) -> None:
    session = demo_session()
    session.moves = ["a moves"]
    app = make_app(session)
    async with app.run_test(size=(80, 24)) as pilot:
        session.emit(*a_talk(session))
        await settle(pilot)
        for key in shown_keys(name):
            session.time += 1
            await opened(app, name)
            await pilot.pause()
            assert noticed(app, key), f"{key} on {name}"
            stops = session.stops
            await pressed(app, key)
            await pressed(app, "ctrl+x")
            assert session.stops > stops, f"the stop after {key} on {name}"
            await settle(pilot)
            assert app.screen is app.main and not app.main.reader.open


def test_every_command_of_the_palette_has_an_action_and_a_key_that_can_be_set() -> None:
    targets = {"act": ScreenActions, "app": MultidropApp, "": MainScreen}
    named = keymap(bindings(), {}).keys
    for row in rows(palette.__file__, "commands.csv"):
        target, _, action = row["action"].partition("(")[0].rpartition(".")
        assert hasattr(targets[target], f"action_{action}"), row
        assert row["key"] in {"", *named} or row["key"].startswith("/"), row
