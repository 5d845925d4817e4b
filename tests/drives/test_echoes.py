"""The repetition of our own bytes by an adapter, and what came before the first reply."""

from dataclasses import dataclass, field
from typing import Any

import pytest

from multidrop.drives.echoes import ENOUGH, LONGEST_TAIL, MOST_HEARD, WATCHED, EchoWatch, FirstBytes, LocalEcho


@dataclass
class Language:
    """A language as far as a repetition is judged by it."""

    answer: bool = True
    asked: list[tuple[bytes, bytes, bool]] = field(default_factory=list)

    def repeated(self, sent: bytes, rest: bytes, over: bool) -> bool:
        self.asked.append((sent, rest, over))
        return self.answer


def watching(sent: bytes = b"PR P\r", answer: bool = True) -> tuple[EchoWatch, Any]:
    watch, language = EchoWatch(), Language(answer)
    watch.note_written(sent, language)  # type: ignore[arg-type]
    return watch, language


def test_a_repetition_is_removed_however_it_comes():
    echo = LocalEcho()
    assert echo.sift(b"ab") == (b"", b"ab")
    assert echo.note_written(b"PR\r") == b""
    assert [echo.sift(each) for each in (b"x", b"P", b"R\r12")] == [(b"", b""), (b"", b""), (b"x", b"12")]
    assert echo.own == echo.held == b""
    assert echo.sift(b"more") == (b"", b"more")
    echo.note_written(b"PR\r")
    assert echo.sift(b"PR\r12345") == (b"", b"12345")


def test_the_next_write_returns_what_was_held_for_the_one_before():
    echo = LocalEcho()
    echo.note_written(b"AB")
    echo.sift(b"A?")
    assert echo.note_written(b"CD") == b"A?"
    assert (echo.own, echo.held) == (b"CD", b"")
    assert echo.forget() == b"" and echo.own == b""


@pytest.mark.parametrize(
    ("heard", "rest"),
    [
        (b"PR P\r", b""),
        (b"PR P\r12", b"12"),
        (b"noise\rPR P\r", b""),
        (b"noise\nPR P\r\n", b"\n"),
    ],
)
def test_a_repetition_at_the_beginning_of_a_line_is_judged_by_the_language(heard, rest):
    watch, language = watching()
    assert watch.repeated(heard, over=True) == b"PR P\r"
    assert language.asked == [(b"PR P\r", rest, True)]


@pytest.mark.parametrize("heard", [b"", b"PR P", b"?PR P\r", b"noisePR P\r", b"pr p\r"])
def test_what_is_no_repetition_is_none(heard):
    watch, language = watching()
    assert watch.repeated(heard) == b"" and language.asked == []


def test_the_language_may_say_that_a_drive_repeats():
    watch, language = watching(answer=False)
    assert watch.repeated(b"PR P\r") == b""
    assert language.asked == [(b"PR P\r", b"", False)]


@pytest.mark.parametrize(("sent", "found"), [(b"x" * ENOUGH, True), (b"x" * (ENOUGH - 1), False)])
def test_a_few_bytes_behind_others_prove_nothing(sent, found):
    watch, _ = watching(sent)
    assert watch.repeated(b"noise\r" + sent) == (sent if found else b"")
    alone, _ = watching(sent)
    assert alone.repeated(sent) == sent


def test_bytes_come_one_by_one_and_those_before_the_last_write_are_forgotten():
    watch, language = watching()
    assert EchoWatch().repeated(b"PR P\r") == b""
    assert [watch.repeated(b"PR P\r"[at : at + 1]) for at in range(5)] == [b"", b"", b"", b"", b"PR P\r"]
    watch.note_written(b"PR V\r", language)
    assert watch.repeated(b"PR P\r") == b"" and watch.repeated(b"PR V\r") == b"PR V\r"


def test_only_so_much_is_kept_to_look_for_it():
    watch, _ = watching()
    assert watch.repeated(b"\r" * (LONGEST_TAIL - 5)) == b""
    assert watch.repeated(b"PR P\r") == b"PR P\r"
    watch, _ = watching()
    assert watch.repeated(b"\r" * (LONGEST_TAIL - 4)) == b""
    assert watch.repeated(b"PR P\r") == b""


def test_only_requests_are_looked_for_and_only_so_many():
    watch, language = watching()
    watch.note_written(b"\x1b\x1b\x1b\x1b", None)
    assert watch.repeated(b"\x1b\x1b\x1b\x1b") == b""
    watch.note_written(b"", language)
    assert watch.repeated(b"x") == b""
    for _ in range(WATCHED - 2):
        watch.note_written(b"PR P\r", language)
    assert watch.repeated(b"PR P\r") == b"PR P\r"
    watch.note_written(b"PR P\r", None)
    watch.note_written(b"PR P\r", language)
    assert watch.repeated(b"PR P\r") == b""


def test_until_a_drive_has_replied_what_came_is_kept_without_our_own_bytes():
    heard = FirstBytes()
    heard.received(b"aPR P\rb")
    heard.note_written(b"PR P\r")
    heard.received(b"PR P\r")
    assert heard.came == b"aPR P\rbPR P\r" and not heard.answered
    assert heard.foreign() == b"abPR P\r"
    heard.note_written(b"PR P\r")
    assert heard.foreign() == b"ab"


def test_after_a_reply_nothing_is_kept():
    heard = FirstBytes()
    heard.received(b"x")
    heard.note_written(b"PR P\r")
    heard.replied("a")
    heard.received(b"PR P\ry")
    heard.note_written(b"z")
    assert heard.answered and heard.came == heard.foreign() == b""


def test_only_so_much_is_kept():
    heard = FirstBytes()
    heard.received(b"x" * (MOST_HEARD + 1))
    assert heard.came == b"x" * MOST_HEARD
    for _ in range(MOST_HEARD):
        heard.note_written(b"y")
    heard.note_written(b"x")
    assert heard.foreign() == heard.came, "what was written after that is not kept"
