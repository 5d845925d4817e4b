"""hMT: lead and lag, locked rotor, make-up, torque mode, calibration. MS=256, so a full step is 256 steps."""

import pytest

from tests.support.lexium import at, drive, rotor, say

AS1 = ("AS=1",)


def closed(*lines, **world):
    """A drive with hMT on, calibrated."""
    device = drive(*lines, **world)
    device.advance(0.1)
    return device


def test_open_loop_products_have_no_hmt():
    assert say(drive(personality="LMDOM"), "AS=1", "PR LL", "CF", "PR AF") == ["?37"] * 4
    assert say(drive(personality="LMM"), "AS=1", "TQ=5") == ["?37", "?37"]


def test_lag_is_counted_while_the_rotor_is_held_and_made_up_afterwards():
    device = closed(*AS1, locked=((0.6, 1.1),))
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
    device = closed(*AS1, f"MU={mode}", "LG=2000000", "LT=60000", locked=((0.5, 3.0),))
    say(device, "MA 768000")
    assert at(device, 2.9, "ER", "LR") == [code, "0"]
    assert at(device, 9, "LL", "P", "MV") == ["0", "768000", "0"] and rotor(device) == 768000


def test_make_up_at_twice_the_speed_meets_the_command_on_its_way():
    device = closed(*AS1, "MU=1", "LG=2000000", locked=((0.6, 0.8),))
    say(device, "SL 100000")
    assert at(device, 0.79, "LL") == ["19000"]
    # 200000 steps/s against 100000: 20000 steps are made up in 0.2 s and a little.
    assert int(at(device, 0.99, "LL")[0]) < 2300
    assert at(device, 1.1, "LL", "AV", "V", "AF") == ["0", "100000", "100000", str(128 + 64)]


def test_the_limits_of_lag_and_lead_are_errors_once_each():
    device = closed(*AS1, "LG=50000", "LD=1000", locked=((0.2, 5.0),))
    say(device, "SL 100000")
    device.advance(0.75)
    assert say(device, "PR ER", "PR AF", "PR ER") == ["107", str(128 + 16 + 2), "0"]
    device = closed(*AS1, "LD=1000")
    device.world.push(1200, 0.1)
    device.advance(0.1)
    assert say(device, "PR ER", "PR LL", "PR AF") == ["106", "-1200", str(128 + 16 + 1)]
    assert at(device, 1, "LL", "P", "ER") == ["0", "0", "0"] and rotor(device) == 0


def test_a_rotor_that_stands_too_long_is_locked_until_cf():
    device = closed("AS=2", "LT=300", "LG=2000000", stall_at=100000)
    say(device, "SL 100000")
    # At 100000 steps/s it takes 0.00333 s to be 1.3 full steps behind; then LT begins.
    hit = 0.1 + 0.099 + (100000 - 101000 * 0.099 / 2) / 100000
    assert at(device, hit + 0.302, "LR", "ER") == ["0", "0"]
    assert at(device, hit + 0.304, "LR", "ER", "MV", "AF") == ["1", "104", "0", str(128 + 32 + 8)]
    assert say(device, "MR -5", "CF", "PR LR", "PR LL", "MR -1000") == ["?94", "0", "0"]
    device.advance(5)
    assert rotor(device) == 99000


def test_a_rotor_that_moves_again_in_time_is_not_locked():
    device = closed("AS=1", "LT=300", "LG=2000000", locked=((0.5, 0.79), (0.9, 1.19)))
    say(device, "SL 100000")
    assert at(device, 9, "LR", "ER", "LL") == ["0", "0", "0"]


def test_a_trip_takes_the_place_of_the_error():
    device = closed(
        "AS=1", "LT=100", "TA=12,K1", "TE=32",
        program="PG 1\nLB K1\nPR \"trip \",LL\nRT\nE\nPG", locked=((0.2, 9.0),),
    )  # fmt: skip
    say(device, "SL 2000")
    assert at(device, 1, "ER", "LR", "TE") == ["0", "1", "0"]
    assert [text for _, text in device.prints()] == ["trip 0\r\n"]


def test_bounds_decide_when_the_rotor_is_held():
    ends = []
    for bounds in (0, 3):
        device = closed("AS=1", f"CB={bounds}", "LT=100", "VI=1000", locked=((0.05, 9.0),))
        say(device, "SL 1000")
        while say(device, "PR LR") == ["0"]:
            device.advance(device.deadline)
        ends.append(device.now)
    assert ends == [pytest.approx(0.2 + 1.1 * 0.256), pytest.approx(0.2 + 1.7 * 0.256)]


def test_disabling_forgets_lead_and_lag_and_the_way_to_make_it_up():
    device = closed(*AS1, "MU=1", "LG=2000000", locked=((0.2, 9.0),))
    say(device, "SL 100000")
    device.advance(0.5)
    assert say(device, "DE=0", "PR LL", "PR MU", "PR MV") == ["0", "0", "0"]
    device.world.push(5000, 0.5)
    assert at(device, 1, "LL") == ["0"]
    assert at(device, 10, "LL", "MV") == ["0", "0"] and say(device, "DE=1", "PR LL") == ["0"]


def test_make_up_with_a_one_behind_it_clears_lead_and_lag():
    device = closed(*AS1, "LG=2000000", locked=((0.2, 1.0),))
    say(device, "MA 50000")
    device.advance(0.9)
    assert int(say(device, "PR LL")[0]) > 1000
    assert say(device, "MU=1,1", "PR LL", "MU=3", "MU=0,2") == ["0", "?21", "?21"]
    here = rotor(device)
    device.advance(3)
    assert rotor(device) == here and say(device, "PR P") == ["50000"]


def test_torque_mode_turns_at_once_and_leaves_at_once():
    device = drive("TS=100000", "AS=3")
    assert at(device, 1, "AV", "V", "MV") == ["100000", "0", "1"]
    say(device, "TD=0")
    assert at(device, 2, "AV") == ["-100000"]
    say(device, "TS=50000")
    assert at(device, 3, "AV") == ["-50000"]
    say(device, "AS=0")
    assert at(device, 4, "AV", "MV", "AS") == ["0", "0", "0"]


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
        device = closed("AS=2", "MU=2", "DT=3", "LT=400", stall_at=300000, locked=((0.3, 0.5), (0.7, 0.75)))
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
