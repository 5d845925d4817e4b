"""The flow of a program: subroutines, returns, places that are not there, the startup program."""

import pytest

from tests.support.lexium import drive, printed, printed_lines, prints_until, say


@pytest.mark.parametrize("lines", [("TP=50000,K1", "TE=2"), ("LS=1,50000,1", "OE K1")])
def test_a_program_that_ends_after_its_motion_runs_subroutines_until_then(lines):
    program = 'PG 1\nLB G1\nMR 100000\nH\nPR "on"\nE\nPG\nPG 300\nLB K1\nPR "k",P\nRT\nPG'
    device = drive(*lines, "EX G1", program=program)
    device.advance(0.05)
    say(device, "E")
    assert printed_lines(device, 0.3) == ["k50000"]
    assert say(device, "PR BY", "PR MV") == ["1", "1"]
    assert printed_lines(device, 1.0) == []
    assert say(device, "PR BY") == ["0"]


@pytest.mark.parametrize("word", ["BR", "CL"])
def test_a_subroutine_that_runs_while_lines_are_stored_cannot_go_to_them(word):
    device = drive("TT=100,K1", "TE=8", program=f'PG 1\nLB K1\nPR "k"\nH 500\n{word} Z1\nE\nPG')
    say(device, "PG 300")
    assert printed_lines(device, 0.2) == ["k"]
    for line in ("LB Z1", 'PR "z"', "RT", "PG"):
        device.execute(line, device.now)
    assert printed_lines(device, 1.0) == []
    assert say(device, "PR ER", "PR BY", "EX Z1") == ["42", "0"]
    assert printed_lines(device, 0.1) == ["z"]


def test_a_return_is_for_programs_and_needs_a_call():
    device = drive(program="PG 1\nLB G1\nRT\nPR 1\nE\nPG")
    assert say(device, "RT", "EX G1") == ["?46"]
    assert prints_until(device, 1) == [] and say(device, "PR ER") == ["43"]


def test_the_startup_program_runs_at_power_up_and_reset_and_by_name():
    device = drive("S", program='PG 100\nLB SU\nPR "up"\nE\nPG')
    device.advance(1)
    device.prints()
    device.power(False, 2)
    device.power(True, 3)
    assert prints_until(device, 4)[-1] == "up"
    device.reset(5)
    assert prints_until(device, 6)[-1] == "up"
    say(device, "EX SU")
    assert prints_until(device, 7) == ["up"]
    assert say(device, "PR UV", "PR SU", "VA SU=1", "FD", "EX SU") == ["SU = 100", "", "?35", "?29", "?30"]


@pytest.mark.parametrize(
    "line", ["OE Q9", "OE=99", "TP=5,Q9", "TI=1,99", "TC=Q9", "TR=5,Q9", "TT=5,Q9", "TM=99", "TA=4,Q9"]
)
def test_a_place_that_is_only_named_and_is_not_there_does_not_end_the_program(line):
    device = drive("PG 1", "LB G1", line, 'PR "on ",ER', "E", "PG", "EX G1")
    device.advance(1.0)
    assert printed(device) == f"on {42 if '99' in line else 30}\r\n"


@pytest.mark.parametrize(("line", "code"), [("BR Q9", 30), ("CL 99", 42)])
def test_a_place_that_is_gone_to_and_is_not_there_ends_it(line, code):
    device = drive("PG 1", "LB G1", line, 'PR "on"', "E", "PG", "EX G1")
    device.advance(1.0)
    assert printed(device) == "" and say(device, "PR ER") == [str(code)]
