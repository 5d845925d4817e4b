"""The terminal's bytes as keys and pastes: whole, byte by byte, and divided by a stop."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual import constants, events
from textual.message import Message

from multidrop.tui.terminal.keystream import LONGEST_PASTE, PASTE_TIMEOUT, InputPiece, KeyStream, PieceKind, Splitter

PASTE = b"\x1b[200~MR 1\rMR 2\r\x1b[201~"
TYPED: dict[bytes, list[str]] = {
    b"MR 5\r": ["M", "R", "space", "5", "enter"],
    b"\x1b[A\x1b[B\x1b[H": ["up", "down", "home"],
    b"\x1bOP\x1bOR\x1b[18~\x1b[[A": ["f1", "f3", "f7", "f1"],
    b"\x1b[6;5~\x1b[1;5D\x1b[1;5Q": ["ctrl+pagedown", "ctrl+left", "ctrl+f2"],
    b"\x1b[1;5S": ["ctrl+f4"],
    b"\x1b1\x1b9": ["alt+1", "alt+9"],
    b"\x1bMR 5\r": ["escape", "M", "R", "space", "5", "enter"],
    b"\x1bO1=1\r": ["escape", "O", "1", "equals_sign", "1", "enter"],
    b"\x1b\x1b[A": ["escape", "up"],
    b"\x1b[?1;2cMR\r": ["M", "R", "enter"],
    b"\x1b[1;\x1b[AM": ["up", "M"],
    b"\x1b[12\rM": ["enter", "M"],
    "é·\r".encode(): ["é", "middle_dot", "enter"],
    b"\xffM": ["replacement_character", "M"],
    PASTE + b"M": ["paste MR 1\rMR 2\r", "M"],
    b"\x1b[200~\x1b[A\x1b[20\x1b[201~\r": ["paste \x1b[A\x1b[20", "enter"],
}


class SessionView:
    def __init__(self) -> None:
        self.keys: list[str] = []
        self.told: list[str] = []
        self.more = False
        self.dropped = ""
        self.stream = KeyStream(self.emit, self.told.append, self.drop, lambda: self.more)

    def drop(self, text: str) -> None:
        self.dropped += text

    def emit(self, message: Message) -> None:
        self.keys.append(message.key if isinstance(message, events.Key) else f"paste {message.text}")  # type: ignore[attr-defined]

    async def done(self) -> list[str]:
        while not self.stream.idle:
            await asyncio.sleep(0)
        return self.keys


@pytest.mark.parametrize("text", TYPED)
async def test_bytes_are_the_same_keys_whole_and_byte_by_byte(text: bytes) -> None:
    whole = SessionView()
    whole.stream.take(text)
    assert await whole.done() == TYPED[text]
    single = SessionView()
    for byte in text:
        single.stream.take(bytes([byte]))
    assert await single.done() == TYPED[text]


@given(st.lists(st.sampled_from(sorted(TYPED)), max_size=6), st.sets(st.integers(1, 150)))
def test_pieces_do_not_depend_on_where_the_text_is_cut(texts: list[bytes], cuts: set[int]) -> None:
    text = b"".join(texts).decode("utf-8", "replace")
    whole = list(Splitter().split(text))
    splitter, found, at = Splitter(), [], 0
    for cut in [*sorted(cuts), len(text)]:
        found += splitter.split(text[at:cut])
        at = max(at, cut)
    assert joined(found) == joined(whole)


def joined(pieces: list[InputPiece]) -> list[InputPiece]:
    """Join neighbouring texts."""
    found: list[InputPiece] = []
    for piece in pieces:
        if found and piece.kind is found[-1].kind is PieceKind.TEXT:
            found[-1] = InputPiece(PieceKind.TEXT, found[-1].text + piece.text)
        else:
            found.append(piece)
    return found


@pytest.mark.virtual
async def test_an_escape_is_one_when_nothing_has_followed_and_nothing_waits() -> None:
    session = SessionView()
    session.stream.take(b"\x1b")
    await session.done()
    assert session.keys == []
    await asyncio.sleep(constants.ESCAPE_DELAY + 0.01)
    assert await session.done() == ["escape"]
    session.keys.clear()
    session.stream.take(b"\x1b")
    session.more = True
    await asyncio.sleep(10)
    assert await session.done() == [], "the rest is in the terminal and was not read yet"
    session.stream.take(b"[A")
    assert await session.done() == ["up"]


@pytest.mark.virtual
async def test_each_escape_has_its_own_time() -> None:
    session = SessionView()
    session.stream.take(b"\x1b")
    await session.done()
    await asyncio.sleep(constants.ESCAPE_DELAY * 0.6)
    session.stream.take(b"[A\x1b")
    await session.done()
    await asyncio.sleep(constants.ESCAPE_DELAY * 0.6)
    session.stream.take(b"[B")
    assert await session.done() == ["up", "down"]


@pytest.mark.virtual
async def test_half_a_sequence_is_never_typed_however_late_the_rest_is() -> None:
    session = SessionView()
    session.stream.take(b"\x1b[1;")
    await asyncio.sleep(60)
    session.stream.take(b"5CM")
    assert await session.done() == ["ctrl+right", "M"]


@pytest.mark.parametrize(
    "before", [b"SL 5", b"SL 5\r", b"\x1b", b"\x1b[", b"\xc3", b"\x1bO", b"SL 1\r\x18SL 2\r", PASTE, b"x" * 9000]
)
async def test_of_a_read_with_a_stop_in_it_only_what_is_behind_the_last_one_is_typed(before: bytes) -> None:
    session = SessionView()
    session.stream.take(b"M")
    session.stream.take(before + b"\x18" + b"PR\r")
    assert await session.done() == ["P", "R", "enter"]
    typed = before.replace(b"\x18", b"\r").decode("utf-8", "ignore")
    typed = {PASTE: "\0"}.get(before, typed.partition("\x1b")[0])
    assert session.dropped == "M" + typed, "what was dropped is told"


@pytest.mark.parametrize("size", [1, 2, 3, 7, 100])
async def test_the_rest_of_a_paste_in_which_the_stop_came_is_dropped_whenever_it_comes(size: int) -> None:
    text = b"\x1b[200~MR 1\rMR\x18 2\rMR 3\r\x1b[201~PR P\r"
    session = SessionView()
    for at in range(0, len(text), size):
        session.stream.take(text[at : at + size])
    assert await session.done() == ["P", "R", "space", "P", "enter"]
    assert session.told == ["the rest of the paste in which the stop came was dropped, too"]


@pytest.mark.virtual
async def test_a_paste_that_does_not_end_says_so_and_ctrl_c_leaves_it() -> None:
    session = SessionView()
    session.stream.take(b"\x1b[200~MR 1\r")
    session.stream.take(b"\x03")
    assert session.told == [], "it goes on: this belongs to it"
    await asyncio.sleep(PASTE_TIMEOUT + 0.1)
    assert session.told == ["a paste has not ended; until it does, keys belong to it. Ctrl+C drops it"]
    session.stream.take(b"\x03")
    session.stream.take(b"M")
    assert await session.done() == ["M"]
    assert session.told[1:] == ["the paste that did not end was dropped"]


async def test_a_paste_that_is_too_long_is_dropped_whole() -> None:
    session = SessionView()
    session.stream.take(b"\x1b[200~" + b"MR 5\r" * (LONGEST_PASTE // 4) + b"\x1b[201~M")
    assert await session.done() == ["M"]
    assert session.told == ["a paste of more than 1048576 characters was dropped"]


async def test_more_than_anybody_means_is_dropped_whole() -> None:
    session = SessionView()
    session.stream.take(b"MR 5\r" * (LONGEST_PASTE // 4))
    assert await session.done() == []
    assert "all of it was dropped" in session.told[0]
    session.stream.take(b"M")
    assert await session.done() == ["M"]


async def test_thousands_of_keys_leave_the_loop_free_for_others() -> None:
    session = SessionView()
    session.stream.take(b"MR 51200\r" * 600)
    turns = 0
    while not session.stream.idle:
        await asyncio.sleep(0)
        turns += 1
    assert len(session.keys) == 5400
    assert turns > 5, "it was parsed in slices"
    session.stream.take(b"MR 51200\r" * 600)
    await asyncio.sleep(0)
    session.stream.drop()
    before = len(session.keys)
    assert len(await session.done()) == before, "a stop drops what is not parsed"
    assert session.dropped == ("MR 51200\r" * 600)[before - 5400 :]


async def test_an_enter_waits_until_it_is_a_key() -> None:
    session = SessionView()
    session.stream.take(b"MR 5\rMR 6")
    assert session.stream.enter_waits
    await session.done()
    assert not session.stream.enter_waits
    session.stream.take(b"\x1b[200~MR 7\r\x1b[201~")
    assert not session.stream.enter_waits, "in a paste it is text"
    session.stream.take(b"\x1b[A\r")
    assert session.stream.enter_waits
    await session.done()
