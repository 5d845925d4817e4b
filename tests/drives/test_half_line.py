"""What the drives hold of a begun line: by the bytes written, the ends of lines they know, and their replies."""

import pytest

from multidrop.drives.half_line import LONGEST_KEPT_TEXT, REPLIED, FrameDivider, HalfLine, Rest

CR, LF = 13, 10
EITHER, RETURN, FEED = b"\r\n", b"\r", b"\n"


def begun(ends: bytes, *writes: tuple[bytes, float]) -> HalfLine:
    line = HalfLine(ends)
    for data, at in writes:
        line.written(data, at)
    return line


def held(line: HalfLine) -> tuple[bytes, dict[int, float], bool, bool]:
    return line.text, line.open, line.begun, line.waits


NOTHING = (b"", {}, False, False)


@pytest.mark.parametrize(
    ("ends", "data", "ended", "text", "open_"),
    [
        (RETURN, b"PR", [], b"PR", {}),
        (RETURN, b"PR\r", [b"PR"], b"", {}),
        (RETURN, b"A\rB\rC", [b"A", b"B"], b"C", {}),
        (RETURN, b"A\nB\r", [b"A", b"B"], b"", {}),
        (RETURN, b"A\nB", [b"A"], b"AB", {}),
        (RETURN, b"A\r\nB", [b"A", b""], b"B", {}),
        (FEED, b"A\n", [b"A"], b"", {}),
        (FEED, b"A\r", [b"A"], b"", {CR: 1.0}),
        (FEED, b"A\rB\n", [b"A", b"B"], b"", {}),
        (FEED, b"A\r\n", [b"A", b""], b"", {}),
        (EITHER, b"A\r", [b"A"], b"", {CR: 1.0}),
        (EITHER, b"A\n", [b"A"], b"", {LF: 1.0}),
        (EITHER, b"\r", [b""], b"", {}),
        (EITHER, b"\n", [b""], b"", {}),
        (EITHER, b"A\r\n", [b"A", b""], b"", {}),
        (EITHER, b"A\n\r", [b"A", b""], b"", {LF: 1.0}),
        (EITHER, b"A\rB\n", [b"A", b"B"], b"", {CR: 1.0, LF: 1.0}),
        (EITHER, b"A\rB", [b"A"], b"B", {CR: 1.0}),
    ],
)
def test_what_is_held_follows_from_the_bytes_that_may_end_a_line(ends, data, ended, text, open_):
    line = HalfLine(ends)
    assert line.written(data, 1.0) == ended
    assert held(line) == (text, open_, bool(text or open_), CR in open_)
    bytewise = HalfLine(ends)
    for at in range(len(data)):
        bytewise.written(data[at : at + 1], 1.0)
    assert held(bytewise) == held(line)


def test_a_line_feed_that_is_no_end_of_a_line_is_no_part_of_it():
    line = begun(RETURN, (b"A\nB", 1.0))
    assert line.text == b"AB" and not line.waits


def test_the_last_bytes_of_a_long_line_are_kept():
    line = begun(RETURN, (b"x" + b"y" * LONGEST_KEPT_TEXT, 1.0))
    assert line.text == b"y" * LONGEST_KEPT_TEXT


def test_messages_that_carry_their_length_begin_no_line():
    line = HalfLine(b"")
    assert line.written(b"A\rB", 1.0) == [b"A\rB"]
    assert held(line) == NOTHING
    line.doubted(2.0)
    assert held(line) == NOTHING


@pytest.mark.parametrize("reply", [b"\r\n", b"12\r\n", b"\x06", b"\x15"])
def test_a_reply_proves_the_last_end_of_a_line(reply):
    line = begun(EITHER, (b"A\r", 1.0))
    line.replied(reply)
    assert held(line) == NOTHING


@pytest.mark.parametrize("reply", [b"", b"A", b"\r", b"\n", b">"])
def test_what_is_no_reply_proves_nothing(reply):
    line = begun(EITHER, (b"A\r", 1.0))
    line.replied(reply)
    assert line.waits


def test_a_reply_proves_nothing_shortly_after_an_end_of_the_other_kind():
    soon = begun(EITHER, (b"A\r", 1.0), (b"B\n", 1.0 + REPLIED / 2))
    soon.replied(b"\r\n")
    assert soon.open == {CR: 1.0, LF: 1.0 + REPLIED / 2}
    late = begun(EITHER, (b"A\r", 1.0), (b"B\n", 1.5))
    late.replied(b"\r\n")
    assert late.open == {}


def test_an_empty_line_of_the_other_kind_has_a_reply_too():
    line = begun(EITHER, (b"\n", 1.0), (b"A\r", 1.1))
    line.replied(b"\r\n")
    assert line.open == {CR: 1.1}


def test_just_after_that_time_a_reply_counts():
    line = begun(EITHER, (b"A\r", 0.0), (b"B\n", REPLIED))
    line.replied(b"\r\n")
    assert line.open == {}


def test_the_first_reply_that_contradicts_those_before_shows_nothing_and_the_next_one_counts():
    line = begun(EITHER, (b"A\r", 1.0))
    line.replied(b"\r\n")
    line.written(b"B\n", 2.0)
    line.replied(b"\r\n")
    assert line.open == {LF: 2.0}
    line.replied(b"\r\n")
    assert line.open == {}
    line.written(b"C\n", 3.0)
    line.replied(b"\r\n")
    assert line.open == {}


def test_where_one_byte_ends_a_line_a_reply_shows_nothing_more():
    line = begun(FEED, (b"A\r", 1.0))
    line.replied(b"\r\n")
    assert line.waits


def test_what_was_cleared_is_forgotten_with_the_return_before_a_line_feed():
    line = begun(EITHER, (b"A\rB", 1.0))
    line.cleared()
    assert held(line) == NOTHING
    line.written(b"A\r", 1.0)
    line.cleared()
    line.open = {CR: 1.0}
    line.written(b"\n", 2.0)
    assert line.open == {CR: 1.0}


def test_an_overflow_makes_the_text_harmless_and_not_what_waits():
    line = begun(EITHER, (b"A\rB", 1.0))
    line.overflowed()
    assert held(line) == (b"", {CR: 1.0}, True, True)


@pytest.mark.parametrize(
    ("ends", "written", "text", "open_"),
    [
        (RETURN, b"", b"?", {}),
        (RETURN, b"PR", b"PR", {}),
        (EITHER, b"", b"?", {CR: 2.0}),
        (EITHER, b"A\n", b"?", {LF: 1.0, CR: 2.0}),
        (FEED, b"", b"?", {CR: 2.0}),
    ],
)
def test_bytes_that_may_not_have_left_may_be_any_part_of_them(ends, written, text, open_):
    line = begun(ends, (written, 1.0))
    line.doubted(2.0)
    assert (line.text, line.open) == (text, open_)


@pytest.mark.parametrize(
    ("data", "left", "dropping"),
    [(b"B", b"", True), (b"B\rC", b"C", False), (b"B\nC\r", b"C\r", False), (b"\r", b"", False), (b"", b"", True)],
)
def test_the_rest_of_a_line_is_dropped_up_to_its_end(data, left, dropping):
    rest = Rest()
    assert rest.left(data) == data and not rest.dropping
    rest.dropping = True
    assert (rest.left(data), rest.dropping) == (left, dropping)


def test_frames_pass_once_they_are_whole():
    parts = FrameDivider(3)
    assert [parts.whole(each) for each in (b"ab", b"", b"cd", b"efgh", b"i")] == [b"", b"", b"abc", b"def", b"ghi"]
    assert parts.whole(b"jk") == b"" and parts.held == b"jk"
    assert parts.forgotten() == b"jk" and parts.held == b""
    assert parts.whole(b"lmn") == b"lmn"


def test_without_frames_all_bytes_pass():
    parts = FrameDivider(0)
    assert parts.whole(b"ab") == b"ab" and parts.held == b""
