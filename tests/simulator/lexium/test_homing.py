"""Homing to a switch, to the index and beside it; limits of both kinds and what LM makes of them."""

import pytest

from multidrop.simulator.lexium.device import MCodeDevice
from tests.support.lexium import at, drive, run, say

SWITCHES = ("IS=1,1,0", "IS=2,2,0", "IS=3,3,0")
AROUND = {"home": 10000, "limit_plus": 200000, "limit_minus": -200000}


def test_homing_slows_down_in_the_switch_and_creeps_off_it():
    device = drive(*SWITCHES, "P=50000", **{**AROUND, "home": -40000})
    say(device, "HM 1")
    assert at(device, 0.1, "MV", "MD", "MP") == ["1", "MA", "0"]
    # It gains 282841 steps/s in 0.2818 s on the 40000 steps to the switch, and loses it on as many behind it.
    assert at(device, 0.2818, "I1") == ["0"] and at(device, 0.2819, "I1") == ["1"]
    assert at(device, 0.564, "V", "P") == ["1000", "-30000"]
    assert at(device, 40.56, "MV") == ["1"]
    assert at(device, 40.57, "P", "MV", "ER", "I1") == ["10001", "0", "0", "0"]


@pytest.mark.parametrize("kind", [1, 4])
def test_a_switch_that_is_closed_to_begin_with_is_crept_off(kind):
    device = drive("IS=1,1,0", home=500)
    say(device, f"HM {kind}")
    assert at(device, 0.4, "V") == ["1000"]
    assert at(device, 0.6, "P", "MV") == ["501", "0"]


def test_the_first_limit_turns_a_homing_round_and_the_other_one_ends_it():
    device = drive(*SWITCHES, "P=0", limit_plus=100000, limit_minus=-100000, home=-300000)
    say(device, "HM 3")
    device.advance(60)
    assert say(device, "PR ER", "PR MV") == ["82", "0"]
    assert device.position(60) < -100000, "LM=1 has a ramp"


def test_a_homing_that_was_turned_round_finds_the_switch_on_its_way_back():
    device = drive(*SWITCHES, "LM=4", "VM=100000", limit_plus=100000, limit_minus=-100000, home=-50000)
    say(device, "HM 3")
    furthest = 0
    while device.now < 5:
        device.advance(min(device.deadline or 5.0, 5.0))
        furthest = max(furthest, device.position(device.now))
    assert furthest == 100000, "LM=4 has no ramp"
    assert device.motor.homing.phase == "approach" and say(device, "PR I1", "PR ER") == ["1", "0"]


@pytest.mark.parametrize(("mode", "runs"), [(2, True), (5, True), (3, False), (6, False)])
def test_other_modes_end_a_homing_at_the_first_limit(mode, runs):
    device = drive(*SWITCHES, f"LM={mode}", program="PG 1\nLB G1\nH 10\nBR G1\nE\nPG", limit_plus=100000)
    say(device, "EX G1", "HM 3")
    assert at(device, 5, "ER", "MV", "BY") == ["83", "0", str(int(runs))]
    assert (device.position(5) > 101000) is (mode < 4)


def test_what_homing_refuses():
    assert say(drive(), "HM 1") == ["?80"]
    device = drive("IS=1,1,0", home=-1000000)
    assert say(device, "HM 5", "HM", "HI 0") == ["?81"] * 3
    assert say(device, "HM 1", "MA 5", "MR 5", "SL 5", "HM 1", "PR MV") == ["?85"] * 4 + ["1"]
    device.advance(0.1)
    assert say(device, "SL 0", "PR MV") == ["1"], "it can be stopped"
    assert at(device, 5, "MV", "ER") == ["0", "0"] and device.motor.homing.phase == ""
    say(device, "SL 1000")
    assert say(device, "HM 1") == ["?85"]
    assert say(drive("IS=1,1,0", "DE=0"), "HM 1") == ["?94"]
    assert say(drive(personality="LMDOM"), "HI 1", "HF 1") == ["?37", "?37"]


def test_a_program_holds_until_homing_is_over():
    device = drive("IS=1,1,0", home=500, program="PG 1\nLB G1\nHM 1\nH\nPR P\nE\nPG")
    say(device, "EX G1")
    device.advance(5)
    assert [text for _, text in device.prints()] == ["501\r\n"]


@pytest.mark.parametrize(("kind", "place"), [(1, 51200), (2, 0), (3, 102400), (4, 153600)])
def test_homing_to_the_index_ends_on_it(kind, place):
    device = drive("MR 70000")
    device.advance(5)
    say(device, f"HI {kind}")
    assert at(device, 200, "C1", "I6", "MV") == [str(place), "1", "0"]


def test_homing_to_the_offset_ends_beside_the_index():
    device = drive("MR 70000", "FS=12800")
    device.advance(5)
    say(device, "HF 1")
    assert at(device, 200, "C1", "I6", "C2") == ["64000", "0", "5000"]


def test_the_index_is_where_it_was_whatever_the_resolution():
    device = drive("MS=128", "MR 1000")
    device.advance(5)
    say(device, "HI 3")
    assert at(device, 300, "C1", "C2", "I6") == ["25600", "4000", "1"]


@pytest.mark.parametrize(("mode", "end"), [(1, 145000), (4, 100000)])
def test_a_software_limit_ends_the_motion_as_lm_says(mode, end):
    device = drive("LS=1,100000,1", f"LM={mode}", "SL 300000")
    assert at(device, 5, "P", "ER", "MV") == [str(end), "83", "0"]
    assert say(device, "MR 10", "SL 5") == ["?83", "?83"]
    say(device, "MR -100000")
    assert at(device, 10, "P", "ER") == [str(end - 100000), "0"]


def test_a_software_limit_is_a_position_that_p_may_redefine():
    device = drive("LS=0,-100000,1", "LM=4", "P=50000", "SL -100000")
    assert at(device, 5, "P", "ER") == ["-100000", "84"]
    say(device, "P=0")
    assert say(device, "MR -50000") == []
    assert at(device, 9, "P") == ["-50000"]


def test_software_limits_count_what_p_counts():
    device = drive("EE=1", "LS=1,1000,1", "LM=4", "SL 4000")
    assert at(device, 5, "P", "C1") == ["1000", "12800"]


def test_a_limit_that_is_turned_off_limits_nothing():
    device = drive("LS=1,1000,0", "MA 5000")
    assert at(device, 5, "P", "ER") == ["5000", "0"]


def test_software_limits_leave_room_between_them():
    device = drive("LS=0,-100,1")
    assert say(device, "LS=1,-100,1", "LS=1,-200,1", "LS=1,-200,0", "LS=1,-99,1") == ["?21", "?21"]


def test_a_software_limit_set_on_the_way_is_heeded():
    device = drive("LM=4", "SL 100000")
    device.advance(0.1)
    say(device, "LS=1,50000,1")
    assert at(device, 2, "P", "ER") == ["50000", "83"]


def codes(device: MCodeDevice, *lines: str) -> list[int]:
    """The error of each line, 0 for one that is taken; works in program mode too."""
    found = []
    for line in lines:
        refused = device.execute(line, device.now).refused
        found.append(int(device.memory.values["ER"]) if refused else 0)
        device.errors.clear()
    return found


SWITCHED = ("IS=1,1,0", "IS=2,2,0", "IS=3,3,0", "VI=20000", "VM=200000")


@pytest.mark.parametrize("mode", ["LM=1", "LM=4"])
def test_a_limit_that_is_met_while_a_pause_slows_homing_down_turns_it_round(mode: str) -> None:
    program = "PG 1\nLB G1\nHM 4\nH\nPR P\nPG"
    device = drive(*SWITCHED, mode, program=program, home=-7924, limit_plus=100000, limit_minus=-300000)
    say(device, "EX G1")
    device.advance(0.58)
    say(device, "PS")
    assert at(device, 1, "MV", "I2", "BY") == ["0", "1", "1"]
    assert codes(device, "RS") == [0]
    device.advance(20)
    assert [text for _, text in device.prints()] == ["-7923\r\n"]


def test_homing_that_was_turned_round_and_is_paused_on_the_other_limit_has_failed() -> None:
    program = "PG 1\nLB G1\nHM 3\nH\nPG"
    device = drive(*SWITCHED, program=program, home=-900000, limit_plus=50000, limit_minus=-50000)
    say(device, "EX G1")
    device.advance(0.5)
    while device.position(device.now) > -45000:
        device.advance(device.now + 0.01)
    say(device, "PS")
    device.advance(device.now + 1)
    assert say(device, "PR MV", "PR I3", "PR BY") == ["0", "1", "1"]
    assert codes(device, "RS") == [82]


@pytest.mark.parametrize("mode", [1, 4])
def test_homing_that_begins_on_a_limit_turns_round(mode):
    device = drive(f"LM={mode}", "IS=1,1,0", "IS=3,3,0", "VM=100000", "VI=50000", home=-50000, inputs=[[0.0, 3, 0]])
    assert say(device, "MR -10", "HM 1") == ["?84"]
    device.advance(1.0)
    assert say(device, "PR V", "PR EF") == ["100000", "0"]


@pytest.mark.parametrize("mode", [2, 3, 5, 6])
def test_homing_that_begins_on_a_limit_is_refused_where_limits_end_homing(mode):
    device = drive(f"LM={mode}", "IS=1,1,0", "IS=3,3,0", home=-50000, inputs=[[0.0, 3, 0]])
    assert say(device, "HM 1", "PR MV", "DE=0", "HM 3", "PR MV") == ["?84", "0", "?94", "0"]


def test_the_type_of_homing_may_stand_behind_an_equals_sign():
    device = drive()
    assert run(device, "IS=1,1,0", "HM=3", "PR MV") == ["1"]
    assert run(drive(), "HI=1", "PR MV") == run(drive(), "HF=1", "PR MV") == ["1"]
    assert run(drive(), "HM=5", "HI=0", "HF=") == ["?81"] * 3
