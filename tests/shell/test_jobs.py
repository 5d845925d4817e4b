"""The progress of long jobs: what is published, and what a terminal and a pipe show of it."""

import io
import sys

import pytest

from multidrop.shell.channel import running
from multidrop.shell.events import Notified, Printed, Progressed
from multidrop.shell.streams.event_printer import EventPrinter


class Channel:
    def __init__(self):
        self.at, self.events = 0.0, []

    def now(self):
        return self.at

    def publish(self, event):
        self.events.append(event)


@pytest.fixture
def channel():
    return Channel()


def steps(channel, numbers, total, step):
    with running(channel, "a: download") as progress:
        for done in numbers:
            progress(done, total)
            channel.at += step


def test_progress_is_published_ten_times_a_second_and_its_end_always(channel):
    steps(channel, range(100), 100, 0.02)
    counts = [event.done for event in channel.events]
    assert counts[0] == 0 and counts[-1] == 100 and 18 <= len(counts) <= 22
    assert [event.over for event in channel.events] == [False] * (len(counts) - 1) + [True]


def test_the_time_left_follows_the_pace(channel):
    steps(channel, range(10), 10, 1.0)
    assert [event.left for event in channel.events[:3]] == [None, 9.0, 8.0]


def test_the_pace_of_another_part_of_the_job_is_measured_from_its_beginning(channel):
    with running(channel, "a: scan") as progress:
        progress(0, 2)
        channel.at = 100.0
        progress(0, 10)
        channel.at = 101.0
        progress(1, 10)
    assert channel.events[-2].left == 9.0


def test_a_failure_ends_the_progress_too(channel):
    with pytest.raises(OSError), running(channel, "a: download") as progress:
        progress(3, 10)
        raise OSError
    assert [event.over for event in channel.events] == [False, True]


def test_a_job_that_was_over_at_once_shows_nothing(channel):
    with running(channel, "a: download") as progress:
        progress(5, 5)
    assert channel.events == []


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (Progressed(0, "a: download", 120, 400), "a: download: 120 of 400"),
        (Progressed(0, "a: download", 120, 400, 2.1), "a: download: 120 of 400, 3 s left"),
        (Progressed(0, "scan", 0, 1), "scan"),
        (Progressed(0, "scan", 1, 900, 119.5), "scan: 1 of 900, 2 min left"),
        (Progressed(0, "scan", 1, 900, 8000), "scan: 1 of 900, 2 h 14 min left"),
        (Progressed(0, "scan", 1, 900, 0.0), "scan: 1 of 900, 1 s left"),
    ],
)
def test_progress_in_words(event, words):
    assert event.text == words


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown(monkeypatch, errors, printer, *events):
    monkeypatch.setattr(sys, "stderr", errors)
    monkeypatch.setattr(sys, "stdout", errors)
    for event in events:
        printer.show(event)
    return errors.getvalue()


def test_a_terminal_has_one_line_that_gives_way_to_others(monkeypatch):
    text = shown(
        monkeypatch,
        Terminal(),
        EventPrinter(),
        Progressed(0, "load", 100, 200),
        Progressed(1, "load", 7, 9),
        Printed(1, "press", "a", "51200"),
        Progressed(2, "load", 8, 9),
        Progressed(2, "load", 9, 9),
    )
    first, second = "load: 100 of 200", "load: 7 of 9"
    wiped = f"\r{' ' * len(second)}\r"
    assert text == f"\r{first}\r{second.ljust(len(first))}{wiped}51200\n\rload: 8 of 9{wiped}"


def test_a_line_is_cut_at_the_width_of_the_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    assert shown(monkeypatch, Terminal(), EventPrinter(), Progressed(0, "x" * 50, 1, 2)) == f"\r{'x' * 19}"


def test_a_pipe_sees_no_progress(monkeypatch):
    events = Progressed(0, "load", 1, 2), Notified(0, "careful", warning=True), Progressed(0, "load", 2, 2)
    assert shown(monkeypatch, io.StringIO(), EventPrinter(), *events) == "careful\n"


def test_the_prompt_writes_no_progress_among_its_lines(monkeypatch):
    assert shown(monkeypatch, Terminal(), EventPrinter(talkative=True), Progressed(0, "load", 1, 2)) == ""
