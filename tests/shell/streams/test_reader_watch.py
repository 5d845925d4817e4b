"""A reader of standard output that leaves while work is under way, at its end, or not at all."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any, TextIO

import pytest

from multidrop.shell.exit_codes import INTERRUPTED, READER_GONE
from multidrop.shell.streams import stdout
from multidrop.shell.streams.stdout import LONGEST_PROBLEM_TEXT, ReaderWatch, shortened

pytestmark = pytest.mark.fork


class Output:
    """Standard output as a pipe, and the signals that came."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.reading, writing = os.pipe()
        self.stream: TextIO = open(writing, "w")  # noqa: SIM115 - closed by the fixture
        monkeypatch.setattr(ReaderWatch, "LOOK", 5)
        monkeypatch.setattr(ReaderWatch, "GRACE", 0.0)
        monkeypatch.setattr(stdout, "watch", None)
        self.came: list[int] = []
        self.wakes = threading.Event()

    def take(self, number: int, _: Any) -> None:
        self.came.append(number)
        self.wakes.set()

    def leave(self) -> None:
        os.close(self.reading)
        self.reading = -1


@pytest.fixture
def output(monkeypatch: pytest.MonkeyPatch) -> Iterator[Output]:
    made = Output(monkeypatch)
    before = {each: signal.signal(each, made.take) for each in (signal.SIGUSR1, signal.SIGTERM)}
    yield made
    for number, handler in before.items():
        signal.signal(number, handler)
    if stdout.watch is not None:
        stdout.watch.over = True
    for each in threading.enumerate():
        if each.name == stdout.WATCHER:
            each.join(5)
    if made.reading >= 0:
        made.leave()
    made.stream.close()


def watching() -> list[threading.Thread]:
    return [each for each in threading.enumerate() if each.name == stdout.WATCHER]


def test_work_is_interrupted_once_its_reader_has_left_and_not_before(
    output: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", output.stream)
    watch = stdout.watch_reader(signal.SIGUSR1)
    [thread] = watching()
    assert thread.daemon
    thread.join(0.03)
    assert thread.is_alive() and output.came == [] and not stdout.reader_left()
    output.leave()
    assert output.wakes.wait(5)
    thread.join(5)
    assert not thread.is_alive()
    assert (output.came, watch.left) == ([signal.SIGUSR1], True)
    assert stdout.why_interrupted() == "the reader of standard output is gone"
    assert [stdout.final(code) for code in (0, 1, INTERRUPTED)] == [READER_GONE, 1, READER_GONE]


def test_where_its_signal_is_ignored_another_one_interrupts_the_work(
    output: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", output.stream)
    signal.signal(signal.SIGUSR1, signal.SIG_IGN)
    stdout.watch_reader(signal.SIGUSR1)
    output.leave()
    assert output.wakes.wait(5)
    assert output.came == [signal.SIGTERM]


def test_a_reader_that_leaves_after_the_work_interrupts_nothing(
    output: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", output.stream)
    stdout.watch_reader(signal.SIGUSR1)
    [thread] = watching()
    stdout.work_done()
    thread.join(5)
    output.leave()
    assert output.came == [] and not stdout.reader_left()
    assert stdout.why_interrupted() == "interrupted"
    assert stdout.final(0) == 0 and stdout.final(INTERRUPTED) == INTERRUPTED


def test_a_program_that_prints_to_a_reader_that_left_was_ended_by_it(
    output: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", output.stream)
    assert not stdout.lost_reader(BrokenPipeError())
    watch = ReaderWatch(signal.SIGUSR1)
    stdout.watch = watch
    assert not stdout.lost_reader(BrokenPipeError())  # of another pipe
    output.leave()
    assert not stdout.lost_reader(ValueError()) and output.came == []
    assert stdout.lost_reader(BrokenPipeError())
    assert output.came == [signal.SIGUSR1] and watch.left
    assert stdout.lost_reader(BrokenPipeError()) and output.came == [signal.SIGUSR1]


def test_a_line_for_a_reader_that_left_interrupts_and_the_rest_is_dropped(
    output: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", output.stream)
    stdout.watch = ReaderWatch(signal.SIGUSR1)
    output.leave()
    stdout.write(output.stream, "one")
    assert output.came == [signal.SIGUSR1] and stdout.reader_left()
    stdout.write(output.stream, "two")
    assert stdout.dropped == []


def test_a_descriptor_that_is_none_has_no_reader(output: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    watch = ReaderWatch(signal.SIGUSR1)
    watch.begin()
    assert watching() == [] and not watch.watches(output.stream)


def test_a_message_is_shortened_in_its_middle_only_where_it_is_too_long() -> None:
    assert shortened("x" * LONGEST_PROBLEM_TEXT) == "x" * LONGEST_PROBLEM_TEXT
    text = "a" * LONGEST_PROBLEM_TEXT + "b"
    half = LONGEST_PROBLEM_TEXT // 2 - 20
    assert (
        shortened(text)
        == f"{'a' * half} ... ({LONGEST_PROBLEM_TEXT + 1 - 2 * half} characters) ... {'a' * (half - 1)}b"
    )


class Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_status_line_covers_the_one_before_and_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(stdout, "get_terminal_size", lambda: os.terminal_size((9, 3)))
    line = stdout.StatusLine()
    line.erase()
    for text in ("1 of 3", "done", "much too long"):
        line.show(text)
    line.erase()
    line.erase()
    line.show("a\x1bb")
    assert screen.getvalue() == "\r1 of 3\rdone  \rmuch too\r        \r\ra\\x1bb"


def test_where_there_is_no_terminal_a_status_line_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = io.StringIO()
    monkeypatch.setattr(sys, "stderr", plain)
    line = stdout.StatusLine()
    line.show("1 of 3")
    line.erase()
    assert plain.getvalue() == ""
