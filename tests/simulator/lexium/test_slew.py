"""Velocities: slews, their limits, and their changes on the way."""

import pytest

from tests.support.lexium import at, drive, prints_until, say


def test_the_direction_is_not_turned_on_the_way():
    device = drive("MR 51200")
    assert say(device, "RD=1", "PR RD") == ["?95", "0"]
    device.advance(2)
    say(device, "RD=1", "SL 1000")
    assert say(device, "RD=0", "PR RD") == ["?95", "1"]


def test_a_slew_goes_beyond_vm_up_to_what_the_microsteps_allow():
    device = drive("VM=2000", "SL 20000")
    assert at(device, 1, "V", "VC", "MP") == ["20000", "0", "0"]
    refused = say(device, "SL 5000001", "SL -5000001", "SL 2560001", "SL", "SL 1,1", "SL Q1", "PR V")
    assert refused == ["?21", "?21", "?77", "?24", "?24", "?30", "20000"]
    assert say(device, "SL -2560000", "PR VC") == ["1"]
    assert at(device, 4, "V") == ["-2560000"]
    device = drive("EE=1")
    assert say(device, "SL 200001", "SL -200001", "SL 200000") == ["?21", "?21"]


def test_after_a_move_is_slowed_down_the_next_motion_waits():
    device = drive("MA 512000")
    device.advance(0.3)
    assert say(device, "SL 0", "MR 100", "MA 0", "SL 5") == ["?85"] * 3
    device.advance(2)
    assert say(device, "MR 100") == []


def test_a_new_top_speed_is_for_the_next_move():
    device = drive("MA 1000000")
    device.advance(0.5)
    say(device, "VM=100000")
    assert at(device, 0.9, "V") == ["768000"]
    device.advance(3)
    say(device, "MA 0")
    assert at(device, 4, "V") == ["-100000"]


def test_the_two_velocities_keep_apart_and_within_the_microsteps():
    device = drive()
    assert say(device, "VM=1000", "VM=999", "VI=768000", "VI=768001", "VI=0") == ["?23", "?23", "?22", "?22", "?21"]
    assert say(device, "VM=2560001", "PR VM", "PR VI") == ["?21", "768000", "1000"]
    say(device, "MS=16")
    refused = say(device, "VM=160001", "VI=160001", "TS=160001", "SL 160001", "VI=160000", "PR VI")
    assert refused == ["?77", "?77", "?77", "?77", "?22", "63"]
    assert say(drive("EE=1"), "PR VI", "PR VM", "VM=200001", "VI=60000", "VM=78") == [
        "78",
        "60000",
        "?21",
        "?22",
        "?23",
    ]


def test_velocity_and_its_changing_are_only_read_and_programs_branch_on_them():
    program = "PG 1\nLB G1\nSL 5000\nH 10\nBR K9,V=5000\nE\nLB K9\nSL 100000\nH 20\nCL Q1,VC=1\nE\nLB Q1\nPR V\nRT\nPG"
    device = drive("EX G1", program=program)
    assert prints_until(device, 1) == ["25400"]
    assert say(device, "V=1", "VC=1", "VR=1", "SN=1", "UV=1", "VT=1") == ["?25"] * 6


@pytest.mark.parametrize(
    ("lines", "line", "code"),
    [
        (["MS=4"], "VM=40001", "?77"),
        (["MS=4"], "VM=2560001", "?21"),
        ([], "VM=2560001", "?21"),
        (["MS=10"], "TS=100001", "?77"),
        (["MS=10"], "TS=46511", "?21"),
        ([], "TS=2560001", "?21"),
    ],
)
def test_a_velocity_that_the_microsteps_do_not_reach_is_error_77(lines, line, code):
    assert say(drive(*lines), line) == [code]


def test_velocities_up_to_ten_thousand_a_microstep_are_taken():
    assert say(drive("MS=10"), "VM=100000", "TS=100000", "PR VM", "PR TS") == ["100000", "100000"]


def test_vm_stays_above_vi_however_coarse_the_microsteps_become():
    assert say(drive("VI=1000", "VM=1001"), "MS=1", "PR VI", "PR VM") == ["4", "5"]


def test_a_slew_goes_faster_than_vm_and_changes_on_the_fly():
    device = drive("VM=100000", "SL 200000")
    assert at(device, 1.0, "V") == ["200000"]
    say(device, "SL -1000")
    assert at(device, 2.0, "V", "MV") == ["-1000", "1"]
