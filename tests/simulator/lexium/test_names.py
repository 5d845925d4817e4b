"""The name of a drive: what it may be, and a move that sends it at its end."""

import pytest

from tests.support.lexium import drive, printed, printed_lines, run, say


@pytest.mark.parametrize("line", ["DN=a", "DN='a'", "DN=5", 'DN="ab"', 'DN=""', 'DN="!"', "DN=*"])
def test_a_name_is_one_letter_or_digit_in_quotation_marks(line):
    assert say(drive('DN="Z"'), line, "PR DN") == ["?21", '"Z"']


@pytest.mark.parametrize(
    ("before", "line", "told"),
    [
        ("A=1000000", "PR P", ["!"]),
        ("A=1000000", "SL 0", []),
        ("A=1000000", "SL 5", []),
        ("A=1000000", "MR 5", []),
        ("A=1000000", "DE=0", []),
        ("LS=1,200000,1", "PR P", []),
        ("LM=4", "LS=1,1,1", []),
    ],
)
def test_the_name_is_sent_when_a_move_is_complete_and_not_when_it_was_stopped(before, line, told):
    device = drive(before, "MA 300000,1")
    device.advance(0.3)
    device.execute(line, 0.3)
    assert printed_lines(device, 3.0) == told


def test_a_pause_keeps_the_name_for_the_end_of_the_move():
    device = drive(program="PG 1\nLB G1\nMA 300000,1\nH\nE\nPG")
    say(device, "EX G1")
    device.advance(0.3)
    assert say(device, "PS") == []
    assert printed_lines(device, 2.0) == []
    assert say(device, "RS") == []
    assert printed_lines(device, 2.0) == ["!"]


def test_a_name_without_quotation_marks_is_error_21_whatever_it_is():
    assert run(drive(), "DN=a", "DN=7", "DN=!", "DN=#", "DN=-", 'DN="!"', "PR DN") == ["?21"] * 6 + ['"!"']


def test_dn_alone_is_a_variable_that_cannot_be_executed():
    assert run(drive(), "DN") == ["?34"]


def test_a_paused_move_sends_the_name_where_it_ends_and_not_where_it_pauses():
    device = drive("PG 1", "LB G1", "MA 100000,1", "H", 'PR "x"', "E", "PG", "EX G1")
    device.advance(0.2)
    assert say(device, "PS", 1.0) == [] and printed(device) == ""
    assert say(device, "RS", 3.0, "PR P") == ["100000"]
    assert printed(device) == "!\r\nx\r\n"


@pytest.mark.parametrize("after", [0.1, 0.2, 0.4])
def test_a_paused_move_that_runs_on_sends_the_name_once_where_it_passes_its_target(after):
    device = drive("PG 1", "LB G1", "MA 51200,1,1", "H 9000", "E", "PG", "EX G1")
    device.advance(after)
    say(device, "PS", 2.0)
    passed = device.position(device.now) >= 51200
    assert (printed(device) == "!\r\n") == passed
    assert say(device, "RS", "PR MP") == [str(1 - passed)]
    assert say(device, 3.0, "PR MP", "PR V") == ["0", "768000"]
    assert printed(device) == ("" if passed else "!\r\n")
