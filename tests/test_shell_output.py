import io
import sys

import pytest

from dialects import Diagnostic, DriveError, Inexpressible, NoAnswer, Refused, Stopped
from shell.events import Failed, Narrated, Output, Printed
from shell.output import Printer, exit_code, report, write
from transports import TransportLost, Unreachable


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
    printer = Printer()
    for event in (
        Printed(0.0, "press", "a", "51200"),
        Printed(0.0, "press", "", "!", solicited=False),
        Output(0.0, "* a"),
        Narrated(0.0, "opened"),
        Narrated(0.0, "was in program mode", warning=True),
        Failed(0.0, "no"),
    ):
        printer.show(event)
    out, err = capsys.readouterr()
    assert (out, err) == ("51200\n!\n* a\n", "was in program mode\n")


def test_where_a_person_reads_everything_is_told(capsys):
    printer = Printer(talkative=True)
    printer.show(Narrated(0.0, "opened"))
    printer.show(Failed(0.0, "no"))
    assert capsys.readouterr().err == "opened\nno\n"


def test_a_reader_that_went_away_is_no_failure(monkeypatch):
    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr(sys, "stdout", Closed())
    Printer().show(Output(0.0, "line"))
    gone = io.StringIO()
    gone.close()
    write(gone, "line")
    assert gone.closed
