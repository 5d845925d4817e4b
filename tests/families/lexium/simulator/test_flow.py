"""The flow of a program: subroutines, returns, places that are not there, the startup program."""

from __future__ import annotations

import pytest

from tests.support.lexium import at, drive, printed, printed_lines, prints_until, say


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


# Pauses and stops: PS, RS and Esc, in every kind of motion.


@pytest.mark.parametrize("move", ["SL 100000", "MR 500000"])
@pytest.mark.parametrize(
    ("meanwhile", "code"), [(["LS=1,5,1"], 83), (["DE=0"], 94), (["IS=1,1,0", "VM=5000", "HM 3"], 85)]
)
def test_a_pause_does_not_end_in_a_motion_that_may_not_begin(move, meanwhile, code):
    device = drive(program=f"PG 1\nLB G1\n{move}\nH 5000\nE\nPG")
    say(device, "EX G1")
    device.advance(0.3)
    say(device, "PS")
    device.advance(1.0)
    assert say(device, *meanwhile, "RS", "PR BY") == [f"?{code}", "1"]
    assert device.motor.axis.kind != move[:2] or not device.moving(1.0)


def test_a_pause_may_end_before_the_motor_stands():
    device = drive(program="PG 1\nLB G1\nMR 500000\nH\nE\nPG")
    say(device, "EX G1")
    device.advance(0.3)
    say(device, "PS")
    device.advance(0.4)
    assert say(device, "RS") == []
    device.advance(4.0)
    assert say(device, "PR P", "PR BY", "PR EF") == ["500000", "0", "0"]


def test_a_pause_stops_torque_mode_and_resuming_goes_on_with_it():
    device = drive("EX G1", program="PG 1\nLB G1\nTS=51200\nTQ=50\nAS=3\nH 5000\nSL 0\nH\nAS=0\nE\nPG")
    device.advance(1)
    say(device, "PS")
    assert at(device, 3, "AV", "MV", "BY") == ["0", "0", "1"]
    say(device, "RS")
    assert at(device, 4, "AV", "V") == ["51200", "0"]
    assert at(device, 9, "AV", "AS", "ER", "BY") == ["0", "0", "0", "0"]


def test_a_paused_configuration_test_ends_where_it_should():
    device = drive("EX G1", program="PG 1\nLB G1\nSC 1\nH\nPR P\nE\nPG")
    device.advance(0.1)
    say(device, "PS")
    assert at(device, 1, "MV") == ["0"]
    say(device, "RS")
    assert prints_until(device, 4) == ["25600"] and say(device, "PR MV", "PR ER") == ["0", "0"]


def test_a_paused_slew_that_was_slowing_down_stands():
    device = drive("EX G1", program="PG 1\nLB G1\nSL 500000\nH 1000\nSL 0\nH\nPR V\nE\nPG")
    device.advance(1.2)
    say(device, "PS")
    assert at(device, 3, "MV") == ["0"]
    say(device, "RS")
    assert prints_until(device, 4) == ["0"] and say(device, "PR MV") == ["0"]


def test_a_paused_correction_goes_back_to_where_the_move_should_have_ended():
    program = "PG 1\nLB G1\nMR 1000\nH\nE\nPG"
    device = drive("EE=1", "SM=1", "SF=1000", "VI=50", "MT=50", "EX G1", program=program, locked=((0.1, 0.15),))
    device.advance(0.5)
    say(device, "PS")
    assert at(device, 1, "MV", "BY") == ["0", "1"]
    say(device, "RS")
    assert at(device, 30, "P", "MV", "BY", "ER") == ["1000", "0", "0", "0"]


PAUSED = 'PG 1\nLB G1\nMR 512000\nH\nPR "done"\nE\nPG'


def test_resuming_what_is_not_paused_tells_whether_a_program_runs():
    device = drive(program=PAUSED)
    assert say(device, "RS", "EX G1", "RS", "RS=1", "RS 1") == ["?40", "?41", "?33", "?24"]
    device.advance(0.2)
    assert say(device, "PS", "RS") == []


def test_a_resumed_move_goes_on_with_the_ramp_that_is_set_by_then():
    device = drive("EX G1", program=PAUSED)
    device.advance(0.2)
    say(device, "PS")
    assert at(device, 1.5, "MV", "BY") == ["0", "1"]
    say(device, "A=100000", "RS")
    assert at(device, 1.8, "V") == ["31000"]  # VI and 0.3 s of A
    assert prints_until(device, 20) == ["done"] and at(device, 20, "P") == ["512000"]


HOMES = ("IS=1,1,0", "VI=20000", "PG 1", "LB G1", "HM 1", "H", 'PR "home"', "E", "PG", "EX G1")


@pytest.mark.parametrize("after", [0.2, 0.95, 1.2, 1.5, 2.0])
def test_a_paused_homing_is_a_homing_again(after):
    unpaused = drive(*HOMES, home=-300000)
    unpaused.advance(100.0)
    device = drive(*HOMES, home=-300000)
    device.advance(after)
    assert say(device, "PS", 2.0, "PR MV", "PR BY") == ["0", "1"]
    assert say(device, "RS", "MR 5", 100.0) == ["?85"]
    assert device.position(device.now) == unpaused.position(100.0)
    assert printed(device) == "home\r\n"


def test_a_pause_that_ends_on_the_home_switch_goes_on_by_creeping_off_it():
    device = drive(*HOMES, home=-100000)
    device.advance(0.4)
    assert say(device, "PS", 2.0, "PR I1", "RS", 0.5, "PR V", 200.0, "PR MV") == ["1", "20000", "0"]


def test_a_pause_of_a_homing_that_a_limit_has_turned_round_keeps_its_way():
    device = drive("IS=2,3,0", *HOMES, limit_minus=-100000, home=250000)
    device.advance(1.4)
    assert device.velocity(1.4) > 0
    assert say(device, "PS", 2.0, "RS", 0.5) == []
    assert device.velocity(device.now) > 0


def test_esc_stops_without_a_ramp_and_ends_the_program():
    device = drive(program='PG 1\nLB G1\nMR 100000\nH\nPR "there"\nE\nPG')
    say(device, "EX G1")
    device.escape(0.2)
    assert at(device, 0.2, "MV", "V", "BY") == ["0", "0", "0"]
    device.advance(2.0)
    assert not device.prints()
