"""S-curves (AT, DT, AJ, DJ), backlash, RD, following, current and temperature of a simulated drive."""

from math import inf, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.simulator.kinematics import SINUSOIDAL, TRIANGLE, MotionPace, Shape, meeting, move, slew
from tests.support.lexium import at, drive, rotor, say

PACE = {"vi": 1000.0, "vm": 768_000.0, "a": 1e6, "d": 1e6}


@pytest.mark.parametrize("kind", [1, 2, 3])
@pytest.mark.parametrize("jerk", [0, 64, 127])
def test_a_move_lasts_as_long_whatever_the_shape_of_its_ramps(kind, jerk):
    shape = Shape(kind, jerk)
    profile = move(0, 0, 0, 3_840_000, MotionPace(**PACE, up=shape, down=shape))
    assert profile.end == pytest.approx(5.7660013, abs=1e-6)
    assert profile.position(0.767) == pytest.approx(294_911.5, abs=1e-3)
    assert profile.velocity(0.3835) == pytest.approx(384_500)


@pytest.mark.parametrize(
    ("shape", "quarter", "peak"),
    [
        (Shape(TRIANGLE), 1000 + 767_000 * 0.125, 2e6),
        (Shape(SINUSOIDAL), 1000 + 767_000 * (0.25 - 1 / (2 * pi)), 2e6),
        (Shape(TRIANGLE, 64), 1000 + 767_000 / 6, 4e6 / 3),
        (Shape(SINUSOIDAL, 64), 1000 + 767_000 / 6, 4e6 / 3),
    ],
)
def test_the_shapes_have_their_velocity_a_quarter_on_and_their_peak_in_the_middle(shape, quarter, peak):
    profile = slew(0, 0, 0, 768_000, MotionPace(vi=1000, vm=inf, a=1e6, d=1e6, up=shape))
    assert profile.velocity(0.767 / 4) == pytest.approx(quarter, rel=1e-9)
    assert profile.acceleration(0.767 / 2) == pytest.approx(peak)
    assert profile.acceleration(1e-9) == pytest.approx(0, abs=1) and profile.changing(0)


def test_a_sinusoidal_ramp_is_gentler_at_its_ends_than_a_triangle():
    early = [
        slew(0, 0, 0, 1e6, MotionPace(vi=1, vm=inf, a=1e6, d=1, up=Shape(kind))).acceleration(0.05) for kind in (2, 3)
    ]
    assert early[0] == pytest.approx(2e5, rel=1e-5)
    assert early[1] == pytest.approx(2e6 * sin(pi * 0.05) ** 2, rel=1e-4) and early[1] < early[0]


@given(st.integers(2, 3), st.integers(0, 127), st.floats(-4e6, 4e6), st.floats(0, 1))
def test_a_crossing_of_an_s_curve_is_where_the_position_says(kind, jerk, target, part):
    profile = move(0, 0, 0, target, MotionPace(**PACE, up=Shape(kind, jerk), down=Shape(kind, jerk)))
    mark = profile.position(part * profile.end)
    found = profile.crossing(mark, 0)
    if 0 < part < 1 and abs(target) > 1:
        assert found <= part * profile.end + 1e-6
        assert profile.position(found) == pytest.approx(mark, abs=1e-3)


def test_two_motions_meet_where_both_are_at_one_place():
    ahead = slew(0, 1000, 0, 500, MotionPace(vi=500, vm=inf, a=1, d=1))
    behind = slew(0, 0, 0, 700, MotionPace(vi=700, vm=inf, a=1, d=1))
    assert meeting(behind, ahead, 0, 0) == pytest.approx(5)
    assert meeting(behind, ahead, -300, 0) == pytest.approx(3.5)
    assert meeting(ahead, behind, 2000, 0) == inf
    assert meeting(slew(0, 0, 0, -1, MotionPace(vi=1, vm=inf, a=1, d=1)), ahead, 0, 0) == inf


def test_a_drive_makes_s_curves_and_says_where_it_cannot():
    device = drive("AT=2", "DT=3", "MA 3840000")
    assert at(device, 0.767 / 4, "V", "VC") == ["96875", "1"]
    assert at(device, 5.766, "MV") == ["1"] and at(device, 5.7661, "MV", "P") == ["0", "3840000"]
    assert say(device, "A=1000000000", "MR 100", "AJ=127", "MR 100") == ["?98"]
    assert say(drive("DT=2", "D=600000000"), "SL 1000") == ["?99"]
    assert say(drive(personality="MDI"), "AT=2", "DT=2") == ["?24", "?20"]


def test_mathematical_backlash_is_added_where_the_direction_changes():
    device, seen = drive("BE=1", "BL=1000"), []
    for line in ("MR 100000", "MR -50000", "MR -50000", "MR 100000", "MA 50000", "MA 0", "MA 100000"):
        say(device, line)
        seen += at(device, device.now + 5, "P")
    assert seen == ["100000", "49000", "-1000", "100000", "49000", "-1000", "100000"]


def test_mechanical_backlash_goes_past_and_comes_back():
    device = drive("BE=1", "BM=1", "BL=15000", "MA 100000")
    assert at(device, 5, "P") == ["100000"]
    say(device, "MA 0")
    least = 0
    while device.deadline is not None and say(device, "PR MV") == ["1"]:
        device.advance(device.deadline)
        least = min(least, device.position(device.now))
    assert least == -15000 and at(device, 12, "P", "MP") == ["0", "0"]


def test_a_hold_and_the_name_wait_for_both_parts_of_a_backlash_move():
    device = drive("BE=1", "BM=1", "BL=15000", program="PG 1\nLB G1\nMA -1000,1\nH\nPR P\nE\nPG")
    say(device, "EX G1")
    device.advance(5)
    assert [text for _, text in device.prints()] == ["!\r\n", "-1000\r\n"]


def test_the_direction_is_turned_round_for_the_world_and_not_while_moving():
    device = drive("RD=1", "MA 5000")
    assert say(device, "RD=0") == ["?95"]
    assert at(device, 2, "P", "C2") == ["5000", "391"]
    assert device.motor.rotor.physical(2) == -5000
    say(device, "RD=0", "MA 6000")
    assert at(device, 3, "P") == ["6000"] and device.motor.rotor.physical(3) == -4000


@pytest.mark.parametrize(
    ("kind", "levels", "end"),
    [
        (13, [(4, 1), (3, 1), (3, 0), (3, 1), (3, 0), (3, 1), (4, 0), (3, 0), (3, 1)], 2),
        (14, [(4, 1), (3, 1), (4, 0), (3, 0), (4, 1), (4, 0)], 4),
        (15, [(3, 1), (3, 0), (3, 1), (4, 1), (3, 0), (3, 1)], 2),
    ],
)
def test_following_counts_what_comes_in_on_the_clock_inputs(kind, levels, end):
    inputs = ((0.0, 3, 0), (0.0, 4, 0), *((0.1 * k, n, level) for k, (n, level) in enumerate(levels, 10)))
    device = drive(f"IS=3,{kind},1", f"IS=4,{kind},1", "FL=1", inputs=inputs)
    assert at(device, 9, "P") == [str(end)]


def test_without_fl_the_clock_inputs_move_nothing():
    device = drive("IS=3,13,1", inputs=((0.0, 3, 0), (1.0, 3, 1), (2.0, 3, 0)))
    assert at(device, 9, "P") == ["0"]


def test_the_current_falls_to_the_holding_one_after_ht_and_mt():
    device = drive("RC=60", "HC=10", "HT=300", "MT=100", "MR 1000")
    end = device.motor.axis.profile.end
    heat = device.motor.heat
    assert [heat.current(end + dt) for dt in (0.0, 0.39, 0.41)] == [60, 60, 10]
    say(device, "HT=0", "MT=0")
    assert heat.current(50.0) == 60, "with neither it does not fall"
    say(device, "DE=0")
    assert heat.current(50.0) == 0


def test_a_drive_gets_warm_and_warns():
    device = drive("RC=100", "SL 10000", load=0.99)
    assert at(device, 700, "ER") == ["0"]
    assert at(device, 705, "ER", "IT") == ["71", "80, 58"]
    assert at(device, 3600, "ER", "MV", "IT 1") == ["0", "1", "85"]


def test_a_drive_that_is_too_hot_switches_its_bridges_off():
    device = drive("RC=100", "SL 10000", load=1.5)
    assert at(device, 482, "DE") == ["1"]
    assert at(device, 483, "ER", "DE", "MV") == ["72", "0", "0"]
    assert rotor(device) == 0


STEEP = ("A=1100000000", "D=1100000000")


@pytest.mark.parametrize(
    ("line", "setting", "code"), [("MR 5", "AT=2", 98), ("SL 5", "DT=3", 99), ("HM 1", "AT=3", 98)]
)
def test_a_motion_with_too_steep_an_s_curve_does_not_begin(line, setting, code):
    device = drive(*STEEP, "IS=1,1,0", setting)
    assert say(device, line, "PR MV", setting[:3] + "1", line, "PR MV") == [f"?{code}", "0", "1"]


@pytest.mark.parametrize("setting", ["IS=3,2,0", "LS=1,50000,1"])
def test_a_limit_stops_what_moves_whatever_the_s_curve(setting):
    device = drive(*STEEP, setting, "SL 100000", "DT=2", limit_plus=50000)
    device.advance(2.0)
    assert say(device, "PR V", "PR ER") == ["0", "83"]
    assert 50000 <= device.position(2.0) < 50010


def test_homing_finds_its_switch_whatever_the_s_curve():
    device = drive(*STEEP, "IS=1,1,0", "HM 1", "AT=2", "DT=2", home=-50000)
    device.advance(3.0)
    assert say(device, "PR MV", "PR P", "PR EF") == ["0", "-49999", "0"]


@pytest.mark.parametrize(("line", "mode"), [("SL 0", 0), ("PS", 0), ("SL 0", 3)])
def test_stops_have_straight_ramps_where_the_s_curve_would_be_too_steep(line, mode):
    begins = ("AS=3", "TS=100000") if mode == 3 else ("EX G1",)
    device = drive(*STEEP, *begins, program="PG 1\nLB G1\nSL 100000\nH\nE\nPG")
    device.advance(0.5)
    assert say(device, "PR MV", "DT=2", line) == ["1"]
    device.advance(1.0)
    assert say(device, "PR MV", "PR EF") == ["0", "0"]


def test_torque_mode_and_the_way_back_of_a_backlash_move_are_not_refused():
    device = drive(*STEEP, "AT=2", "TS=100000", "AS=3")
    assert at(device, 1.0, "AV", "EF") == ["100000", "0"]
    device = drive(*STEEP, "BE=1", "BM=1", "BL=5000", "MR -100000", "AT=2")
    assert at(device, 3.0, "P", "MV", "EF") == ["-100000", "0", "0"]


def test_the_ramps_stay_in_their_range_however_fine_the_microsteps_become():
    device = drive("MS=1", "A=1100000000", "D=66")
    assert say(device, "MS=256", "PR A", "PR D") == ["1100000000", "16896"]
    assert say(device, "MS=1", "PR D") == ["66"]
