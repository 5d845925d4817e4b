"""The characters for terminals without braille, rare signs, or anything but ASCII."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from multidrop.tui.widgets.theme import BRAILLE, TABLES, Signs, shown_as, signs_for
from tests.support.fake_session import a_move, a_talk, demo_session, make_app, painted, press
from tests.support.paths import ROOT


@given(st.text(), st.sampled_from(Signs))
def test_a_text_keeps_its_width_and_ascii_is_ascii(text: str, signs: Signs) -> None:
    shown = shown_as(text, signs)
    assert cell_len(shown) == cell_len(text)
    assert signs is not Signs.ASCII or shown.isascii()


def test_every_sign_of_the_tables_is_as_wide_as_what_stands_for_it() -> None:
    for table in TABLES.values():
        assert all(cell_len(chr(code)) == cell_len(sign) == 1 for code, sign in table.items())
        assert not table or set(BRAILLE) <= set(table)


def test_every_sign_that_the_screen_uses_has_a_place_in_the_tables() -> None:
    texts = [file.read_text(encoding="utf-8") for file in (ROOT / "tui").rglob("*.py")]
    used = {char for text in texts for char in text if ord(char) > 127}
    assert not {char for char in used - {"£"} if shown_as(char, Signs.ASCII) == "?"}, "£ is a key of some keyboards"


@pytest.mark.parametrize(
    ("wanted", "environment", "signs"),
    [
        ("auto", {"LANG": "de_DE.UTF-8"}, Signs.FULL),
        ("auto", {"LANG": "en_US.utf8", "TERM": "linux"}, Signs.BOXES),
        ("auto", {"LANG": "C"}, Signs.ASCII),
        ("auto", {"LANG": "C", "LC_ALL": "C.UTF-8"}, Signs.FULL),
        ("auto", {}, Signs.FULL),
        ("ascii", {"LANG": "de_DE.UTF-8"}, Signs.ASCII),
        ("full", {"LANG": "C"}, Signs.FULL),
    ],
)
def test_the_signs_are_those_set_or_those_of_the_terminal(
    wanted: str, environment: dict[str, str], signs: Signs
) -> None:
    assert signs_for(wanted, environment) is signs


@pytest.mark.tui
@pytest.mark.parametrize("keys", [("ctrl+g", "ctrl+g"), ("ctrl+x", "ctrl+p")])
async def test_nothing_but_ascii_reaches_a_terminal_of_ascii(keys: tuple[str, ...]) -> None:
    session = demo_session()
    app = make_app(session)
    app.act.show_signs(Signs.ASCII)
    async with app.run_test(size=(120, 40)) as pilot:
        session.emit(*a_talk(session), *a_move(session))
        await press(pilot, *keys)
        screen = "".join(strip.text for screen in app.screen_stack for strip in painted(screen))
        assert screen.isascii() and "> moving" in screen
