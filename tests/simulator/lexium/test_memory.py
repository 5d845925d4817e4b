"""Program memory: addresses, labels, locks, trace."""

import pytest

from tests.support.lexium import drive, printed_lines, run, say


@pytest.mark.parametrize("address", ["1.5", "10.0", "1e2", "0", "-1", "6385"])
def test_program_mode_begins_at_a_whole_address_only(address):
    device = drive()
    assert say(device, f"PG {address}", "PR P") == ["?42", "0"]


PROGRAM = "PG 1\nLB G1\nMR 5\nE\nPG"


@pytest.mark.parametrize("line", ["EX G1,1", "EX G1,2", "BP G1,1", "BP"])
def test_a_locked_program_is_not_shown_line_by_line(line):
    device = drive("LK=1", program=PROGRAM)
    assert say(device, line, "BP=0") == ["?44"]
    assert say(device, "EX G1") == []
    assert printed_lines(device, 1.0) == []
    assert say(device, "PR P") == ["5"]


def test_a_trace_ends_where_the_program_locks_itself():
    device = drive(program="PG 1\nLB G1\nLK=1\nMR 5\nE\nPG")
    assert say(device, "EX G1,1") == []
    assert printed_lines(device, 1.0) == ["6  LK=1"]
    assert say(device, "PR P") == ["5"]


def test_a_program_space_that_is_open_already_may_be_opened():
    device = drive()
    assert run(device, "LK=1", "S", "LK=0", "CP", "LK=0", "PR LK") == ["?44", "0"]


@pytest.mark.parametrize("at", ["1", "3"])
def test_a_label_goes_with_the_line_that_is_stored_over_it(at):
    device = drive()
    run(device, "PG 1", "LB G1", "E", "PG", f"PG {at}", "E", "PG")
    assert run(device, "EX G1", "PR UV", "OE G1") == ["?30", "", "?30"]
    assert run(device, "PG 20", "LB G1", 'PR "g"', "E", "PG", "EX G1", 1.0) == ["g"]


def test_a_program_cannot_have_a_label_and_a_variable_of_one_name():
    assert run(drive(), "PG 1", "VA L1=3", "LB L1", "E", "PG") == ["?28"]
    assert run(drive(), "PG 1", "LB L1", "VA L1=3", "E", "PG") == ["?28"]
