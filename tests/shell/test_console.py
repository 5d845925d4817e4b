"""Records of a console of Windows as the bytes of a terminal."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.shell.console import ALT, CONTROL, MENU, SHIFT, KeyBytes, KeyRecord, X, may_swallow, whole_characters

CONTROL_RIGHT, ALT_LEFT = 0x04, 0x02


def typed(*keys):
    return KeyBytes().take(keys)


def pressed(code, character="\0", held=0, repeats=1):
    return KeyRecord(True, code, character, held, repeats)


@pytest.mark.parametrize(
    "key, sent",
    [
        (pressed(0x41, "a"), b"a"),
        (pressed(0x41, "\xe4"), b"\xc3\xa4"),
        (pressed(0x41, "a", repeats=3), b"aaa"),
        (pressed(0x41, "a", repeats=0), b"a"),
        (pressed(0x41, "a", ALT_LEFT), b"\x1ba"),
        (pressed(0x51, "@", ALT_LEFT | CONTROL), b"@"),  # AltGr+Q of a German layout
        (pressed(0x0D, "\r"), b"\r"),
        (pressed(0x08, "\b"), b"\x7f"),
        (pressed(0x08, "\x7f", CONTROL_RIGHT), b"\b"),
        (pressed(0x09, "\t"), b"\t"),
        (pressed(0x09, "\t", SHIFT), b"\x1b[Z"),
        (pressed(X, "\x18", CONTROL_RIGHT), b"\x18"),
        (pressed(X, "\0", CONTROL_RIGHT), b"\x18"),  # a layout without Latin letters
        (pressed(X, "\0", CONTROL_RIGHT | ALT), b""),
        (pressed(0x26), b"\x1b[A"),
        (pressed(0x26, held=SHIFT | CONTROL_RIGHT), b"\x1b[1;6A"),
        (pressed(0x2E), b"\x1b[3~"),
        (pressed(0x2E, held=ALT_LEFT), b"\x1b[3;3~"),
        (pressed(0x70), b"\x1bOP"),
        (pressed(0x70, held=SHIFT), b"\x1b[1;2P"),
        (pressed(0x74), b"\x1b[15~"),
        (pressed(0x7B), b"\x1b[24~"),
        (pressed(0x11, held=CONTROL_RIGHT), b""),  # Control by itself
        (pressed(0, "\x1b"), b"\x1b"),  # the console's own sequences come as keys without a code
        (pressed(0, "[", ALT_LEFT), b"["),
        (KeyRecord(False, 0x41, "a"), b""),
        (KeyRecord(False, MENU, "\u20ac"), b"\xe2\x82\xac"),  # Alt and 0128
    ],
)
def test_a_key_is_what_a_terminal_sends_for_it(key, sent):
    assert typed(key) == sent


@given(st.text(max_size=8), st.integers(0, 8))
def test_text_is_utf8_however_reads_group_its_units(text, at):
    units = text.encode("utf-16-le")
    keys = [pressed(0, units[n : n + 2].decode("utf-16-le", "surrogatepass")) for n in range(0, len(units), 2)]
    both = KeyBytes()
    assert both.take(keys[:at]) + both.take(keys[at:]) == text.replace("\0", "").encode()


def test_half_a_character_holds_no_stop_back():
    keys = KeyBytes()
    assert keys.take([pressed(0, "\ud83d")]) == b""
    assert keys.take([pressed(X, "\x18", CONTROL_RIGHT)]).endswith(b"\x18")


@given(st.text(max_size=40), st.integers(4, 20))
def test_a_write_ends_between_characters(text, most):
    data, pieces = text.encode(), []
    while data:
        pieces.append(whole_characters(data, most))
        assert 0 < len(pieces[-1]) <= most
        data = data[len(pieces[-1]) :]
    assert "".join(piece.decode() for piece in pieces) == text


def test_only_the_consoles_that_openssh_makes_before_windows_11_may_swallow_the_stop_key():
    there = {"SSH_CONNECTION": "10.0.0.2 50000 10.0.0.5 22"}
    assert [may_swallow(build, there) for build in (17763, 19045, 22000, 26100)] == [True, True, False, False]
    assert not may_swallow(19045, {})
