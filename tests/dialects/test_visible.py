"""Text from elsewhere cannot act on a terminal."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.text import visible


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("51200", "51200"),
        ("\x1b]52;c;cm0gLXJm\x07", r"\x1b]52;c;cm0gLXJm\x07"),
        ("\x1b]0;title\x1b\\", r"\x1b]0;title\x1b" + "\\"),
        ("\x9b2J", r"\x9b2J"),
        ("\x1b[?1049h", r"\x1b[?1049h"),
        ("© München 5 µm", "© München 5 µm"),
        ("a\u202egnp.exe", r"a\u202egnp.exe"),
        ("\u2066x\u2069", r"\u2066x\u2069"),
        ("\ud800", r"\ud800"),
        ("a\tb\r\n", r"a\x09b\x0d\x0a"),
    ],
)
def test_control_and_direction_characters_are_written_out(text, shown):
    assert visible(text) == shown


def test_a_tab_may_stay():
    assert visible("a\tb\x0b", tabs=True) == "a\tb\\x0b"


@given(st.text())
def test_nothing_that_acts_is_left_and_what_is_shown_stays(text):
    shown = visible(text)
    assert all(unicodedata.category(each) not in ("Cc", "Cs", "Zl", "Zp") for each in shown)
    assert all(
        unicodedata.bidirectional(each) not in ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")
        for each in shown
    )
    assert visible(shown) == shown
