"""Stalls in encoder mode: when one is found, what it stops, and when it is none."""

import pytest

from tests.support.lexium import at, drive, say


def test_a_stall_factor_that_is_set_below_the_error_is_a_stall_at_once():
    device = drive("EE=1", "SF=1000", "SL 1000")
    device.advance(1.0)
    device.world.hold(True)
    device.advance(1.0)
    device.advance(1.5)
    assert say(device, "PR ST", "SF=501", "PR ST", "SF=500", "PR ST", "PR ER", "PR MV") == ["0", "0", "1", "86", "0"]


def test_ip_counts_what_the_rotor_has_lost_in_open_loop_for_no_stall():
    device = drive("EE=1", "S", "EE=0", "MR 100000", stall_at=5000)
    device.advance(3.0)
    say(device, "IP")
    device.world.push(-128, 3.0)
    device.advance(4.0)
    assert say(device, "PR EE", "PR C2", "PR ST", "PR EF") == ["1", "381", "0", "0"]


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


def test_without_encoder_mode_there_is_no_stall_whatever_is_set():
    device = drive("SF=5", "SM=0", "MR 51200", stall_at=10000.0)
    assert at(device, 2, "P", "ST", "ER", "MV") == ["51200", "0", "0", "0"]
    assert say(device, "ST=0", "ST=1", "PR ST") == ["?21", "0"]


def test_a_stall_stops_the_motor_where_the_factor_is_reached():
    device = drive("EE=1", "SF=30", "MR 2048", personality="LMM", stall_at=2000 * 12.8)
    assert at(device, 1, "P", "C1", "ST", "ER") == ["2000", str(2030 * 128 // 10), "1", "86"]
    assert say(device, "PR ST", "MR -400") == ["1"], "neither reading ER nor the flag forbids or clears anything"
    assert at(device, 2, "P", "ST", "ER") == ["1600", "1", "0"]
    assert say(device, "EE=0", "PR ST", "ST=0", "PR ST") == ["1", "0"]


def test_in_mode_1_a_stall_is_told_and_the_move_goes_on():
    device = drive("EE=1", "SM=1", "MR 4000", stall_at=10000.0)
    assert at(device, 0.5, "ST", "ER", "MV") == ["1", "86", "1"]
    assert int(at(device, 0.9, "C1")[0]) > 51200


def test_with_hmt_there_is_no_stall():
    device = drive("EE=1", "AS=1", stall_at=10000.0)
    device.advance(0.1)
    say(device, "MR 51200")
    assert at(device, 3, "ST", "LR", "ER") == ["0", "1", "104"]


def closed(*lines, **world):
    """A drive with hMT on, calibrated."""
    device = drive("AS=1", *lines, **world)
    device.advance(0.1)
    return device


def test_hmt_takes_stalls_and_position_maintenance_out_of_force():
    device = closed("EE=1", "SF=10", "PM=1", "LG=2000000", "LT=60000", stall_at=50000)
    say(device, "MA 100000")
    assert at(device, 3.0, "ST", "ER") == ["0", "0"]


@pytest.mark.parametrize(("mode", "made"), [(0, 2030), (1, 2048)])
def test_a_bind_is_a_stall_when_sf_more_counts_were_made(mode, made):
    device = drive("EE=1", "SF=30", f"SM={mode}", "MT=1000", "MR 2048", stall_at=2000 * 12.8)
    assert at(device, 1.0, "C1", "C2", "ST", "ER", "MV") == [str(int(made * 12.8)), "2000", "1", "86", "0"]
