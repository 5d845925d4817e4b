"""What is left of keys, pastes and stops, however the bytes are grouped: without a terminal."""

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st
from prompt_toolkit.keys import Keys

from multidrop.shell.prompt.keys import BEGIN, END, PASTE_TIMEOUT, KeyboardInput

PIECES = ["MR 5", "\r", BEGIN, END, "\x1b[A", "\x1b", "PR P\r", "é"]


class Typed:
    """The keyboard's part that an input uses, without a terminal."""

    descriptor, closed = 99, False

    def __init__(self):
        self.typed = ""

    def take(self):
        piece, self.typed = self.typed[:3], self.typed[3:]
        return piece

    def pick(self, start, end):
        picked, self.typed = self.typed[start:end], self.typed[:start] + self.typed[end:]
        return picked


def keys(found):
    return [(press.key, press.data) for press in found]


async def read(data):
    """The keys of a stream of text with stops (\\x18) in it, read as the keyboard does, in the groups given."""
    typed = Typed()
    made, found, told = KeyboardInput(typed), [], []
    made.notify = told.append
    for group in data:
        before, stop, behind = group.rpartition("\x18")
        if stop:
            dropped, typed.typed = typed.typed + before.replace("\x18", ""), ""
            made.forget(dropped)
            found.clear()
        typed.typed += behind
        while typed.typed:
            found += keys(made.read_keys())
    found += keys(made.flush_keys())
    return found, told


@given(st.lists(st.sampled_from(PIECES), max_size=8), st.lists(st.integers(1, 9), min_size=1, max_size=5))
def test_keys_are_the_same_however_they_are_grouped(pieces, sizes):
    text = "".join(pieces)
    groups, at = [], 0
    while at < len(text):
        size = sizes[len(groups) % len(sizes)]
        groups.append(text[at : at + size])
        at += size
    assert asyncio.run(read(groups)) == asyncio.run(read([text]))


@given(st.lists(st.sampled_from([*PIECES, "\x18"]), max_size=10))
def test_nothing_from_before_a_stop_is_a_key_after_it(pieces):
    text = "".join(pieces)
    found, _ = asyncio.run(read([text]))
    before, stop, behind = text.rpartition("\x18")
    in_paste = stop and before.replace("\x18", "").rfind(BEGIN) > before.replace("\x18", "").rfind(END)
    if in_paste:
        behind = behind.partition(END)[2]
    assert found == asyncio.run(read([behind]))[0]


@pytest.mark.parametrize("cut", range(1, 6))
async def test_a_paste_that_a_stop_was_in_is_dropped_to_its_end_in_pieces(cut):
    found, told = await read([BEGIN + "MR 5\rMR", "\x18 6\rMR 7\r" + END[:cut], END[cut:] + "x"])
    assert found == [("x", "x")]
    assert told == ["the rest of the paste in which the stop came was dropped, too"]


async def test_a_paste_behind_the_old_one_is_a_paste():
    found, _ = await read([BEGIN + "MR 5\x18 6\r" + END + BEGIN + "PR P\r" + END])
    assert found == [(Keys.BracketedPaste, "PR P\r")]


@pytest.mark.virtual
async def test_a_paste_without_an_end_is_said_once_and_again_where_a_stop_came_in_it():
    typed, told = Typed(), []
    made = KeyboardInput(typed)
    made.notify = told.append
    typed.typed = BEGIN + "MR 5"
    while typed.typed:
        made.read_keys()
    await asyncio.sleep(3 * PASTE_TIMEOUT)
    assert len(told) == 1 and told[0].startswith("a paste has not ended")
    assert made.forget("").endswith("MR 5")
    await asyncio.sleep(3 * PASTE_TIMEOUT)
    assert told == told[:1] * 2


@pytest.mark.virtual
async def test_a_stop_without_a_paste_says_nothing_of_one():
    typed, told = Typed(), []
    made = KeyboardInput(typed)
    made.notify = told.append
    made.forget("MR 5")
    await asyncio.sleep(3 * PASTE_TIMEOUT)
    assert told == []


def test_it_is_known_whether_another_line_has_been_typed():
    typed = Typed()
    made = KeyboardInput(typed)
    for text, follows in (("", False), ("MR 5", False), ("MR 5\rPR", True), ("PR P\n", True)):
        typed.typed = text
        assert made.enters_follow is follows
