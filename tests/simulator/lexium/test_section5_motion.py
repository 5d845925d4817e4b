"""Motion and section 5, QD to WT: stalls and trips anew, pauses and stops in every mode, variables."""

import pytest

from tests.simulator.lexium.test_section5_qd_wt import told
from tests.support.moving import at, drive, say


def test_every_motion_may_stall_anew():
    device = drive("EE=1", "MR 4000", stall_at=10000.0)
    assert at(device, 1, "ST", "ER") == ["1", "86"]
    say(device, "ST=0", "MR -400")
    assert at(device, 2, "ST", "ER", "P") == ["0", "0", "381"]
    say(device, "MR 4000")
    assert at(device, 3, "ST", "ER", "P") == ["1", "86", "781"]


def test_a_slew_that_is_held_up_stalls_once_until_it_has_turned_again():
    device = drive("EE=1", "SM=1", "SL 4000", stall_at=10000.0)
    assert at(device, 1, "ER") == ["86"]
    for t, speed, code in ((2, 5000, "0"), (3, -4000, "0"), (5, 4000, "86"), (6, 0, "0"), (7, 4000, "86")):
        say(device, f"SL {speed}")
        assert at(device, t, "ER") == [code], speed


def test_a_cleared_stall_of_a_pushed_rotor_is_told_again_at_the_next_push():
    device = drive("EE=1", "PM=1", "SF=50")
    for t, code, flag in ((1, "86", "1"), (2, "0", "1")):
        device.world.push(1280, t - 1)
        assert at(device, t, "ER", "ST") == [code, flag]
    say(device, "ST=0")
    device.world.push(1280, 2)
    assert at(device, 3, "ER", "ST", "P") == ["86", "1", "300"]


def test_both_parts_of_a_move_that_makes_up_for_backlash_have_the_top_speed_it_began_with():
    device = drive("BE=1", "BM=1", "BL=100000", "MA -200000")
    device.advance(0.3)
    say(device, "VM=20000")
    assert int(at(device, 1.2, "V")[0]) > 100000
    assert at(device, 5, "P", "MV") == ["-200000", "0"]


@pytest.mark.parametrize("before", [0, 5])
def test_a_relative_trip_that_is_set_up_anew_repeats_as_often_as_it_now_says(before):
    device = drive(f"TR=1000,K1,{before}", "TE=16", "MR 3500", program="PG 1\nLB K1\nPR P\nRT\nPG")
    assert told(device, 1) == ["1000", "2000", "3000"]
    say(device, "TR=1000,K1,3", "MR 5000")
    assert told(device, 2) == ["4000", "5000", "6000"] and say(device, "PR TE") == ["0"]


@pytest.mark.parametrize("name", ["SA", "AS", "TS", "MU", "CB", "F1"])
def test_a_variable_that_bears_a_word_of_other_products_is_only_a_variable(name):
    device = drive(f"VA {name}=3", personality="MDI")
    assert say(device, f"IC {name}", f"R1={name}", f"PR R1,{name}", "PR UV", "MS=128", "MR 100") == [
        "44",
        f"{name} = G 4",
        "",
    ]
    assert at(device, 2, "P", "V", "ER") == ["100", "0", "0"]
    say(device, "S", f"{name}=9", "IP")
    assert say(device, f"PR {name}", "FD", "PR UV") == ["4", ""]


TORQUE = ("TS=51200", "TQ=50", "AS=3")


def soft_stop(device):
    device.world.set_input(1, 0, device.now)
    device.advance(device.now)


@pytest.mark.parametrize(
    ("stop", "code", "slowed"),
    [
        (lambda device: device.escape(device.now), "0", 0.0),
        (lambda device: say(device, "SL 0"), "0", 0.2),
        (lambda device: say(device, "NE=1", "SL 0", "0"), "0", 0.2),
        (soft_stop, "91", 0.2),
    ],
    ids=["escape", "slew 0", "a bare 0", "soft stop"],
)
def test_torque_mode_stops_and_stands_until_it_is_set_again(stop, code, slowed):
    device = drive("IS=1,5,0", *TORQUE)
    assert at(device, 1, "AV", "V") == ["51200", "0"]
    stop(device)
    assert at(device, 1 + slowed, "AV", "MV", "AS") == ["0", "0", "3"]
    assert at(device, 3, "AV", "V", "ER") == ["0", "0", code]
    assert say(device, "TS=60000", "TD=0", "PR AV") == ["0"]
    say(device, "AS=3")
    assert at(device, 4, "AV") == ["-60000"]


def test_a_pause_stops_torque_mode_and_resuming_goes_on_with_it():
    device = drive("EX G1", program="PG 1\nLB G1\nTS=51200\nTQ=50\nAS=3\nH 5000\nAS=0\nE\nPG")
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
    assert told(device, 4) == ["25600"] and say(device, "PR MV", "PR ER") == ["0", "0"]


def test_a_paused_slew_that_was_slowing_down_stands():
    device = drive("EX G1", program="PG 1\nLB G1\nSL 500000\nH 1000\nSL 0\nH\nPR V\nE\nPG")
    device.advance(1.2)
    say(device, "PS")
    assert at(device, 3, "MV") == ["0"]
    say(device, "RS")
    assert told(device, 4) == ["0"] and say(device, "PR MV") == ["0"]


@pytest.mark.parametrize(("trip", "bit"), [("TP=1000,K1", 2), ("TR=1000,K1,1", 16)])
def test_a_place_that_the_encoder_is_pushed_past_trips(trip, bit):
    device = drive("EE=1", trip, f"TE={bit}", program="PG 1\nLB K1\nPR P\nRT\nPG")
    for t, pushed, out in ((1, 12000, []), (2, 1600, ["1063"]), (3, -1600, [])):
        device.world.push(pushed, t - 1)
        device.advance(t - 0.5)
        assert told(device, t) == out
    assert say(device, "PR TE") == ["0"]
    device = drive(trip, f"TE={bit}", program="PG 1\nLB K1\nPR P\nRT\nPG")
    device.world.push(60000, 0)
    device.advance(0.5)
    assert told(device, 1) == [], "without the encoder P has not moved"


def test_a_paused_correction_goes_back_to_where_the_move_should_have_ended():
    program = "PG 1\nLB G1\nMR 1000\nH\nE\nPG"
    device = drive("EE=1", "SM=1", "SF=1000", "VI=50", "MT=50", "EX G1", program=program, locked=((0.1, 0.15),))
    device.advance(0.5)
    say(device, "PS")
    assert at(device, 1, "MV", "BY") == ["0", "1"]
    say(device, "RS")
    assert at(device, 30, "P", "MV", "BY", "ER") == ["1000", "0", "0", "0"]


def test_a_variable_of_0_with_another_products_word_harms_nothing():
    assert say(drive("VA SA", "VA AS", personality="MDIE"), "MS=128", "EE=1", "EE=0", "PR SA,AS,MS") == ["00128"]
