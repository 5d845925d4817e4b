"""Inputs with a function: set up, active at once, resets and stops."""

import pytest

from tests.support.lexium import at, drive, say


@pytest.mark.parametrize("before", ["IS=1,0,1", "IS=1,0,0"])
def test_a_reset_input_that_is_active_when_it_is_set_up_resets_the_drive(before: str) -> None:
    device = drive(before, "VM=5000", inputs=[[0.1, 1, 1]])
    device.advance(1)
    say(device, "IS=1,11,1")
    assert at(device, 1.1, "VM") == ["768000"]


def test_a_stop_input_that_is_active_when_it_is_set_up_stops_the_motor() -> None:
    device = drive("SL 50000", inputs=[[0.5, 1, 0]])
    device.advance(1)
    say(device, "IS=1,5,0")
    assert at(device, 2, "MV", "ER") == ["0", "91"]


@pytest.mark.parametrize("level", [0, 1])
def test_a_program_that_resets_its_drive_by_an_active_input_does_so_until_that_is_let_go(level: int) -> None:
    program = f"PG 1\nLB SU\nIS=1,11,{level}\nPR I1\nPG"
    device = drive(program=program, inputs=[[0.5, 1, level], [1.0, 1, 1 - level]])
    device.advance(0.75)
    assert device.boots > 10
    device.advance(2)
    before = device.boots
    device.advance(3)
    assert (device.boots, device.running) == (before, False)
    assert say(device, "PR IS")[0] == f"IS = 1, 11, {level}"


@pytest.mark.parametrize("line", ["OS=1,22,0", "OS=1,5,0", "OS=1,-1", "IS=1,16,0", "IS=1,9,0", "IS=5,0,0", "IS=6,1,0"])
def test_a_type_that_an_input_or_output_cannot_have_is_error_8(line):
    device = drive()
    before = say(device, "PR OS", "PR IS")
    assert say(device, line) == ["?8"]
    assert say(device, "PR OS", "PR IS") == before


def test_ip_takes_setups_back_and_leaves_outputs_alone():
    device = drive("OS=3,17,1", "S")
    assert say(device, "O2=1", "OS=3,16", "IP", "PR OS")[2:] == ["OS = 3, 17, 1"]
    assert device.outputs(0.0) == {1: False, 2: True, 3: False}
    device.reset(1.0)
    assert device.outputs(1.0)[2] is False


def test_a_switch_to_ground_runs_the_program_at_address_1_each_time():
    device = drive("IS=4,4,0", inputs=((1.0, 4, 0), (1.2, 4, 1), (3.0, 4, 0)))
    say(device, "PG1", "MR 20000", "H", "MR -20000", "H", "E", "PG")
    assert at(device, 0.9, "P", "BY") == ["0", "0"]
    assert int(at(device, 1.28, "P")[0]) > 19000
    assert at(device, 2.0, "P", "BY") == ["0", "0"]
    assert at(device, 3.1, "BY", "MV") == ["1", "1"]


def test_a_reset_input_that_is_high_already_resets_when_it_is_set_up_so():
    device = drive("R1=5", inputs=((0.0, 1, 1),))
    device.advance(0.1)
    assert say(device, "IS=1,11,1", "PR R1") == ["0"] and device.boots == 1
    device = drive("R1=5", inputs=((0.0, 1, 0),))
    device.advance(0.1)
    assert say(device, "IS=1,11,1", "PR R1") == ["5"] and device.boots == 0
