"""hMT: lead and lag, locked rotor, make-up, torque mode, calibration. MS=256, so a full step is 256 steps."""

from __future__ import annotations

import pytest

from tests.support.lexium import at, closed_loop, drive, rotor, say

AS1 = ("AS=1",)


def test_open_loop_products_have_no_hmt():
    assert say(drive(personality="LMDOM"), "AS=1", "PR LL", "CF", "PR AF") == ["?37"] * 4
    assert say(drive(personality="LMM"), "AS=1", "TQ=5") == ["?37", "?37"]


def test_lag_is_counted_while_the_rotor_is_held_and_made_up_afterwards():
    device = closed_loop(locked=((0.6, 1.1),))
    say(device, "MA 768000")
    # 0.5 s on it has gone 1000 * 0.5 + 500000 * 0.25 steps; 0.25 s later the command is at 282000.
    assert at(device, 0.85, "P", "LL", "LR", "MV") == ["282000", "156500", "0", "1"]
    assert rotor(device) == 125500
    # Make-up at VM: 642500 steps in 0.8823 s (up and down at 16763806 steps/s2 between 916 and 768000).
    assert at(device, 1.98, "MV") == ["1"]
    assert at(device, 1.983, "MV", "LL", "P") == ["0", "0", "768000"]
    assert rotor(device) == 768000


@pytest.mark.parametrize(("mode", "code"), [(0, "0"), (1, "108"), (2, "108")])
def test_a_move_that_was_to_end_on_time_and_did_not_is_an_error(mode, code):
    device = closed_loop(f"MU={mode}", "LG=2000000", "LT=60000", locked=((0.5, 3.0),))
    say(device, "MA 768000")
    assert at(device, 2.9, "ER", "LR") == [code, "0"]
    assert at(device, 9, "LL", "P", "MV") == ["0", "768000", "0"] and rotor(device) == 768000


def test_make_up_at_twice_the_speed_meets_the_command_on_its_way():
    device = closed_loop("MU=1", "LG=2000000", locked=((0.6, 0.8),))
    say(device, "SL 100000")
    assert at(device, 0.79, "LL") == ["19000"]
    # 200000 steps/s against 100000: 20000 steps are made up in 0.2 s and a little.
    assert int(at(device, 0.99, "LL")[0]) < 2300
    assert at(device, 1.1, "LL", "AV", "V", "AF") == ["0", "100000", "100000", str(128 + 64)]


def test_the_limits_of_lag_and_lead_are_errors_once_each():
    device = closed_loop("LG=50000", "LD=1000", locked=((0.2, 5.0),))
    say(device, "SL 100000")
    device.advance(0.75)
    assert say(device, "PR ER", "PR AF", "PR ER") == ["107", str(128 + 16 + 2), "0"]
    device = closed_loop("LD=1000")
    device.world.push(1200, 0.1)
    device.advance(0.1)
    assert say(device, "PR ER", "PR LL", "PR AF") == ["106", "-1200", str(128 + 16 + 1)]
    assert at(device, 1, "LL", "P", "ER") == ["0", "0", "0"] and rotor(device) == 0


def test_a_rotor_that_stands_too_long_is_locked_until_cf():
    device = closed_loop("LT=300", "LG=2000000", mode=2, stall_at=100000)
    say(device, "SL 100000")
    # At 100000 steps/s it takes 0.00333 s to be 1.3 full steps behind; then LT begins.
    hit = 0.1 + 0.099 + (100000 - 101000 * 0.099 / 2) / 100000
    assert at(device, hit + 0.302, "LR", "ER") == ["0", "0"]
    assert at(device, hit + 0.304, "LR", "ER", "MV", "AF") == ["1", "104", "0", str(128 + 32 + 8)]
    assert say(device, "MR -5", "CF", "PR LR", "PR LL", "MR -1000") == ["?94", "0", "0"]
    device.advance(5)
    assert rotor(device) == 99000


def test_a_rotor_that_moves_again_in_time_is_not_locked():
    device = closed_loop("LT=300", "LG=2000000", locked=((0.5, 0.79), (0.9, 1.19)))
    say(device, "SL 100000")
    assert at(device, 9, "LR", "ER", "LL") == ["0", "0", "0"]


def test_a_trip_takes_the_place_of_the_error():
    device = closed_loop(
        "LT=100", "TA=12,K1", "TE=32",
        program="PG 1\nLB K1\nPR \"trip \",LL\nRT\nE\nPG", locked=((0.2, 9.0),),
    )  # fmt: skip
    say(device, "SL 2000")
    assert at(device, 1, "ER", "LR", "TE") == ["0", "1", "0"]
    assert [text for _, text in device.prints()] == ["trip 0\r\n"]


def test_bounds_decide_when_the_rotor_is_held():
    ends = []
    for bounds in (0, 3):
        device = closed_loop(f"CB={bounds}", "LT=100", "VI=1000", locked=((0.05, 9.0),))
        say(device, "SL 1000")
        while say(device, "PR LR") == ["0"]:
            device.advance(device.deadline)
        ends.append(device.now)
    assert ends == [pytest.approx(0.2 + 1.1 * 0.256), pytest.approx(0.2 + 1.7 * 0.256)]


def test_disabling_forgets_lead_and_lag_and_the_way_to_make_it_up():
    device = closed_loop("MU=1", "LG=2000000", locked=((0.2, 9.0),))
    say(device, "SL 100000")
    device.advance(0.5)
    assert say(device, "DE=0", "PR LL", "PR MU", "PR MV") == ["0", "0", "0"]
    device.world.push(5000, 0.5)
    assert at(device, 1, "LL") == ["0"]
    assert at(device, 10, "LL", "MV") == ["0", "0"] and say(device, "DE=1", "PR LL") == ["0"]


def test_make_up_with_a_one_behind_it_clears_lead_and_lag():
    device = closed_loop("LG=2000000", locked=((0.2, 1.0),))
    say(device, "MA 50000")
    device.advance(0.9)
    assert int(say(device, "PR LL")[0]) > 1000
    assert say(device, "MU=1,1", "PR LL", "MU=3", "MU=0,2") == ["0", "?21", "?21"]
    here = rotor(device)
    device.advance(3)
    assert rotor(device) == here and say(device, "PR P") == ["50000"]


def test_torque_mode_turns_at_once_and_is_left_at_rest_only():
    device = drive("TS=100000", "AS=3")
    assert at(device, 1, "AV", "V", "MV") == ["100000", "0", "1"]
    say(device, "TD=0")
    assert at(device, 2, "AV") == ["-100000"]
    say(device, "TS=50000")
    assert at(device, 3, "AV") == ["-50000"]
    assert say(device, "AS=0", "AS=1", "AS=3", "PR AS") == ["?87", "?87", "?87", "3"]
    assert at(device, 4, "AV", "MV") == ["-50000", "1"]
    assert say(device, "SL 0", 1.0, "AS=0") == []
    assert at(device, 6, "AV", "MV", "AS") == ["0", "0", "0"]


def test_torque_mode_refuses_moves_and_make_up():
    device = drive("TS=100000", "AS=3")
    assert say(device, "MA 5", "SL 5", "HI 1", "MU=1") == ["?85", "?85", "?85", "?110"]


def test_torque_below_the_load_turns_nothing():
    device = drive("TS=100000", "TQ=30", "AS=3", "LT=500", load=0.3)
    assert at(device, 0.4, "MV", "LR") == ["0", "0"]
    assert at(device, 0.6, "MV", "LR", "ER", "DE") == ["0", "1", "104", "1"]
    say(device, "TQ=31")
    assert at(device, 2, "AV", "MV") == ["100000", "1"]


def test_a_rotor_held_in_torque_mode_turns_again_when_it_is_free():
    device = drive("TS=100000", "AS=3", locked=((1.0, 2.0),))
    assert at(device, 1.5, "AV", "MV") == ["0", "0"]
    assert at(device, 3, "AV", "MV") == ["100000", "1"]


def test_calibration_takes_its_time_and_moves_wait_for_it():
    device = drive("AS=1", "TA=1,K1", "TE=32", program='PG 1\nLB K1\nPR "done"\nRT\nE\nPG')
    assert say(device, "PR AF", "MA 5") == ["0", "?88"]
    assert at(device, 0.03, "AF") == ["128"] and say(device, "MA 5") == []
    assert [text for _, text in device.prints()] == ["done\r\n"]


def test_modes_do_not_change_on_the_way():
    device = drive("SL 5000")
    assert say(device, "AS=1", "SC 1") == ["?87", "?89"]
    assert say(drive("DE=0"), "AS=1", "PR AF", "SC 1") == ["?109", "256", "?103"]


def test_the_configuration_test_turns_half_a_turn():
    device = drive("SC 1")
    assert at(device, 5, "C1", "C2", "ER") == ["25600", "2000", "0"]
    device = drive("SC 1", stall_at=10000)
    assert at(device, 5, "ER") == ["100"]


def test_losing_the_main_supply_stops_and_is_told():
    device = drive("TM=K1", "TE=64", "SL 5000", program='PG 1\nLB K1\nPR "lost"\nRT\nE\nPG')
    device.supply(False, 1.0)
    device.advance(1.1)
    assert [text for _, text in device.prints()] == ["lost\r\n"]
    assert say(device, "PR ER", "PR MV", "PR TE", "SL 5") == ["79", "0", "0", "?96"]
    device.supply(True, 2.0)
    assert say(device, "SL 5") == []


def test_advancing_in_one_go_is_advancing_step_by_step():
    def run(stops):
        device = closed_loop("MU=2", "DT=3", "LT=400", mode=2, stall_at=300000, locked=((0.3, 0.5), (0.7, 0.75)))
        say(device, "MA 350000")
        for t in stops:
            device.advance(t)
        say(device, "CF", "MA -50000")
        for t in stops:
            device.advance(5 + t)
        return at(device, 12, "P", "LL", "LR", "AF", "ER"), device.motor.axis.rotor.position(12)

    assert run([5]) == run([k * 0.03125 for k in range(4, 161)])


def test_a_change_between_the_modes_of_hmt_does_not_cut_its_calibration_short():
    device = drive("AS=1", "AS=2")
    assert say(device, "PR AF", "MR 5") == ["0", "?88"]
    device.advance(0.1)
    assert say(device, "PR AF", "MR 5", "PR EF") == ["128", "0"]


def test_a_calibration_that_failed_is_forgotten_once_as_is_taken():
    device = drive("AS=1", "DE=0")
    assert say(device, "AS=1", "PR AF", "DE=1", "AS=1", "PR EF") == ["?109", "256", "0"]
    assert at(device, 1.0, "AF") == ["128"]


def test_without_lead_and_lag_no_limit_of_them_is_reached() -> None:
    device = drive("LD=0", "LG=0", "AS=1")
    assert at(device, 1, "AF", "LL", "ER") == ["128", "0", "0"]


# A rotor that is held with hMT: the bridges, the flag, and CF.


def test_a_rotor_that_stands_at_tighter_bounds_that_are_set_is_locked_from_then_on():
    device = drive("AS=1", "CB=3", "LT=100")
    device.advance(0.1)
    device.world.hold(True)
    say(device, "MR 400")
    assert at(device, 1.0, "LR") == ["0"]
    say(device, "CB=2", "CB=0")
    assert at(device, 1.09, "LR") == ["0"]
    assert at(device, 1.11, "LR", "ER") == ["1", "104"]


def test_torque_mode_turns_nothing_while_the_bridges_of_a_locked_rotor_are_off():
    device = drive("AS=1", "LT=100", "TS=100000")
    device.advance(0.1)
    device.world.hold(True)
    say(device, "MR 10000")
    assert at(device, 0.5, "LR", "ER") == ["1", "104"]
    device.world.hold(False)
    say(device, "AS=3")
    assert at(device, 1.0, "MV", "AV", "LR") == ["0", "0", "1"]
    say(device, "CF")
    assert at(device, 2.0, "AV", "LR", "EF") == ["100000", "0", "0"]


def test_a_locked_rotor_has_no_holding_current_and_is_not_brought_back_until_cf():
    device = drive("AS=1", "LT=100", "EE=1", "PM=1", "HT=100", "OS=1,29,0", "AO=512")
    device.advance(0.1)
    device.world.hold(True)
    say(device, "MR 10000")
    device.advance(1.0)
    assert say(device, "PR LR", "AS=0") == ["1"] and not device.outputs(1.0)[1]
    device.world.hold(False)
    was = device.position(1.0)
    device.world.push(8 * 12.8, 1.0)
    device.advance(1.0)
    device.advance(2.0)
    assert device.position(2.0) == was + 8
    say(device, "CF")
    device.advance(2.2)
    assert device.outputs(2.2)[1]
    device.world.push(10 * 12.8, 2.2)
    device.advance(2.2)
    device.advance(3.0)
    assert device.position(3.0) == was + 8 and say(device, "PR ST") == ["0"]


def test_a_rotor_that_was_locked_in_torque_mode_can_be_moved_afterwards():
    device = drive("LT=100", "TS=51200", "AS=3", locked=((0.3, 1.0),))
    device.advance(2.0)
    assert say(device, "PR LR", "PR ER", "SL 0", 1.0, "AS=0") == ["1", "104"]
    assert say(device, 1.0, "MR 500", 1.0, "PR MV", "PR LR") == ["0", "1"]
    assert say(device, "CF", "PR LR") == ["0"]


def test_a_rotor_that_was_locked_otherwise_keeps_the_bridges_off_until_it_is_cleared():
    device = drive("LT=100", "AS=1", locked=((0.3, 1.0),))
    assert say(device, 0.1, "MR 200000", 1.0, "PR LR", "PR ER", "MR 5", "AS=0", "MR 5") == ["1", "104", "?94", "?94"]
    assert say(device, "CF", "MR 5") == []


@pytest.mark.parametrize("mode", [1, 2])
def test_a_locked_rotor_switches_the_bridges_off_until_cf(mode):
    device = drive(f"AS={mode}", "LT=500", stall_at=50000)
    device.advance(0.1)
    say(device, "MA 100000")
    assert at(device, 3.0, "ER", "LR", "MV") == ["104", "1", "0"]
    assert say(device, "MR -100", "DE=0", "DE=1", "MR -100") == ["?94", "?94"]
    assert say(device, "CF", "PR LR", "MR -100") == ["0"]
    assert rotor(device) == 50000 and at(device, 4.0, "LR") and rotor(device) == 49900


def test_in_torque_mode_a_locked_rotor_is_a_flag_and_it_turns_again():
    device = drive("TQ=50", "TS=100000", "LT=500", "AS=3", locked=((1.0, 4.0),))
    assert at(device, 2.0, "LR", "ER", "AV") == ["1", "104", "0"]
    assert abs(int(at(device, 5.0, "AV")[0])) == 100000


# Torque mode of hMT: how it begins, stops and stands.


def test_control_bounds_are_the_tightest_in_torque_mode_and_cannot_be_changed_there():
    device = drive("CB=2", "AS=3")
    assert say(device, "PR CB", "CB=3", "CB=0", "PR EF", "AS=0", "PR CB") == ["0", "?21", "0", "2"]


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


# Make-up of hMT: when, how fast, and where it ends.


QUICK = ("VM=300000", "LG=2000000", "LT=60000")


def test_steps_lost_at_velocity_are_made_up_at_vm():
    device = closed_loop(*QUICK, locked=((0.5, 0.7),))
    say(device, "MA 200000")
    assert at(device, 0.9, "AV", "V") == ["300000", "165670"]


def test_steps_lost_while_slowing_down_are_made_up_at_vi():
    device = closed_loop(*QUICK, locked=((0.9, 0.95),))
    say(device, "MA 200000")
    assert at(device, 1.0, "AV", "MV") == ["1000", "1"]
    assert at(device, 1.2, "AV", "P", "MV") == ["1000", "200000", "1"]
    assert at(device, 10.0, "LL") == ["4673"]
    assert at(device, 15.0, "LL", "MV", "ER") == ["0", "0", "0"] and rotor(device) == 200000


def test_the_next_motion_is_not_as_slow_as_the_make_up_that_it_takes_over():
    device = closed_loop(*QUICK, locked=((0.9, 0.95),))
    say(device, "MA 200000")
    device.advance(1.2)
    say(device, "MA 400000")
    assert at(device, 1.7, "AV") == ["300000"]


def test_a_slew_that_is_faster_than_vm_is_not_slowed_by_what_it_has_lost():
    device = closed_loop(*QUICK, locked=((0.9, 1.0),))
    say(device, "SL 500000")
    assert at(device, 2.0, "AV", "LL") == ["500000", "57429"]
    say(device, "SL 0")
    assert at(device, 6.0, "LL", "MV") == ["0", "0"]


@pytest.mark.parametrize("world", [{}, {"stall_at": 100}])
def test_lag_behind_a_command_that_has_yet_to_turn_round_is_made_up_on_its_way(world):
    device = closed_loop("D=5000", "LG=2000000", "LT=60000", locked=((0.2, 0.5),), **world)
    say(device, "SL -20000")
    device.advance(0.4)
    say(device, "MA 400")
    assert int(at(device, 0.49, "LL")[0]) > 5000
    assert int(at(device, 0.503, "AV")[0]) < -19000
    assert at(device, 0.6, "LL", "AV") == ["0", "-19000"]
    device.advance(60.0)
    assert rotor(device) == world.get("stall_at", 400)


def test_a_rotor_that_was_pushed_ahead_waits_where_the_move_ends():
    device = closed_loop("LD=2000000", "VM=20000", "VI=19000")
    say(device, "MA 40000", "VM=768000")
    device.advance(1.5)
    device.world.push(5000, 1.5)
    device.advance(1.5)
    assert at(device, 1.6, "AV") == ["0"] and rotor(device) == 40000
    assert at(device, 2.0, "P", "LL") == ["38000", "-2000"] and rotor(device) == 40000
    assert at(device, 3.0, "P", "LL", "MV") == ["40000", "0", "0"]


@pytest.mark.parametrize(("lines", "speed"), [(("MU=2",), "2560000"), (("MS=16", "MU=2"), "160000")])
def test_system_speed_is_3000_turns_a_minute_whatever_a_step_is(lines, speed):
    device = closed_loop(*lines, "LG=2000000000", "LT=60000", locked=((0.2, 4.0),))
    say(device, "VM=100000", "SL 90000")
    assert at(device, 4.16, "AV") == [speed]


def test_twice_the_speed_is_not_faster_than_a_motor_can_turn():
    device = closed_loop("MU=1", "VM=2000000", "LG=2000000000", "LT=60000", locked=((0.2, 2.2),))
    say(device, "MA 4000000")
    assert at(device, 2.4, "AV") == ["2560000"]
