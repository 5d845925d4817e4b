import contextlib
import io
import os
import signal
import socket
import sys

import pytest

from multidrop.base.errors import Diagnostic, DriveError, Inexpressible, NoAnswer, Refused, Stopped, TransportLost
from multidrop.drives.events import Unsolicited
from multidrop.shell.events import Failed, Notified, OnBus, Output, Printed
from multidrop.shell.exit_codes import exit_code
from multidrop.shell.streams.event_printer import EventPrinter
from multidrop.shell.streams.stdout import ReaderWatch, report, write
from multidrop.transports import Unreachable
from tests.support.posix import pty


@pytest.mark.parametrize(
    ("failure", "code"),
    [
        (Refused("x"), 1),
        (NoAnswer("x"), 1),
        (Inexpressible("x"), 1),
        (DriveError("x"), 1),
        (Diagnostic("x"), 2),
        (TransportLost("x"), 3),
        (Unreachable("x"), 3),
        (Stopped("x"), 4),
    ],
)
def test_every_failure_has_its_exit_code(failure, code):
    assert exit_code(failure) == code


def test_a_failure_is_one_line_behind_its_place():
    failure = Refused("first\nsecond")
    failure.add_note("s.txt:3")
    assert report(failure) == "s.txt:3: first second"


def test_replies_and_results_go_to_standard_output_and_only_warnings_to_the_other(capsys):
    printer = EventPrinter()
    for event in (
        Printed(0.0, "press", "a", "51200"),
        OnBus("press", Unsolicited(0.0, ("!", "12\x1b[2J"))),
        Output(0.0, "* a"),
        Notified(0.0, "opened"),
        Notified(0.0, "was in program mode", warning=True),
        Failed(0.0, "no"),
    ):
        printer.show(event)
    out, err = capsys.readouterr()
    assert (out, err) == ("51200\n!\n12\\x1b[2J\n* a\n", "was in program mode\n")


def test_where_a_person_reads_everything_is_told(capsys):
    printer = EventPrinter(talkative=True)
    printer.show(Notified(0.0, "opened"))
    printer.show(Failed(0.0, "no"))
    assert capsys.readouterr().err == "opened\nno\n"


def test_a_reader_that_went_away_is_no_failure(monkeypatch):
    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr(sys, "stdout", Closed())
    EventPrinter().show(Output(0.0, "line"))
    gone = io.StringIO()
    gone.close()
    write(gone, "line")
    assert gone.closed


def test_what_a_wire_says_does_not_act_on_the_terminal(capsys):
    EventPrinter().show(Printed(0.0, "press", "", "\x1b[2Jat\thome\x06\x9b"))
    assert capsys.readouterr().out == "\\x1b[2Jat\thome\\x06\\x9b\n"


def test_a_character_that_the_output_does_not_know_is_written_out():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    write(stream, "Copyright\xa9")
    write(stream, "more")
    assert stream.buffer.getvalue().split() == [b"Copyright\\xa9", b"more"]


def test_a_full_disk_is_told_at_the_end(monkeypatch):
    monkeypatch.setattr("multidrop.shell.streams.stdout.dropped", [])
    from multidrop.shell.streams import stdout

    class Full(io.StringIO):
        def write(self, text):
            raise OSError(28, "No space left on device")

    write(Full(), "line")
    assert stdout.dropped == ["the output cannot be written: No space left on device"]


@contextlib.contextmanager
def ends(kind, folder):
    """The two ends of a way: what reads, if anything does, and the descriptor that is written."""
    if kind == "socket":
        near, far = socket.socketpair()
        yield far.detach(), near.detach()
    elif kind == "terminal":
        yield pty.openpty()
    elif kind == "pipe":
        yield os.pipe()
    else:
        yield None, os.open(os.devnull if kind == "null" else folder / "kept.txt", os.O_WRONLY | os.O_CREAT)


@pytest.mark.parametrize("kind", ["pipe", pytest.param("socket", marks=pytest.mark.fork), "terminal", "file", "null"])
def test_a_reader_is_gone_once_its_end_is_closed_and_a_file_has_none(kind, tmp_path, monkeypatch):
    with ends(kind, tmp_path) as (reader, writer), os.fdopen(writer, "w") as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        watch = ReaderWatch(signal.SIGINT)
        assert watch.watches(stream) == (reader is not None) and not watch.is_gone()
        if reader is not None:
            os.close(reader)
        assert watch.is_gone() == (reader is not None)


def test_a_reader_that_leaves_interrupts_work_once_and_nothing_after_it(monkeypatch):
    came = []
    before = signal.signal(signal.SIGUSR2, lambda *_: came.append("interrupted"))
    try:
        for over in (False, True):
            watch = ReaderWatch(signal.SIGUSR2)
            watch.over = over
            watch.gone()
            watch.gone()
            assert watch.left and came == ["interrupted"]
    finally:
        signal.signal(signal.SIGUSR2, before)


def test_what_may_be_a_gateways_greeting_is_not_on_standard_output(capsys):
    printer = EventPrinter()
    printer.show(OnBus("gw", Unsolicited(0.0, ("Welcome", "12345\x1b"), greeting=True)))
    printer.show(OnBus("gw", Unsolicited(0.0, ("500",))))
    assert capsys.readouterr() == ("500\n", "")
