"""The encoder with EE=1: counts, stalls, the check after a move, position maintenance. A count is 12.8 steps."""

from __future__ import annotations

import pytest

from tests.support.lexium import at, closed_loop, drive, rotor, say


def test_steps_that_a_blocked_rotor_does_not_follow_are_lost_in_open_loop():
    device = drive("MA 100000", stall_at=51200)
    assert at(device, 2, "C1", "C2", "ER", "MV") == ["100000", "4000", "0", "0"]
    say(device, "MA 48800")
    assert at(device, 4, "C1", "C2") == ["48800", "0"], "it has come away from the wall at once"


def test_a_stall_is_found_sf_counts_after_the_rotor_has_stopped():
    device = drive("EE=1", "SF=30", "MR 2048", stall_at=25600)
    assert at(device, 3, "C2", "C1", "ST", "MV") == ["2000", "25984", "1", "0"]
    assert say(device, "PR ER", "PR EF", "PR ST", "ST=0", "PR ST") == ["86", "0", "1", "0"]


def test_a_stalled_motor_may_go_on_if_sm_says_so():
    device = drive("EE=1", "SM=1", "SL 4000", stall_at=25600)
    assert at(device, 3, "ST", "MV", "C2", "V", "ER") == ["1", "1", "2000", "4000", "86"]
    assert at(device, 4, "ER", "MV") == ["0", "1"], "it is told once"


def test_after_a_stall_moves_count_from_where_the_rotor_is():
    device = drive("EE=1", "MR 3000", stall_at=25600)
    device.advance(3)
    say(device, "ST=0", "MA 500")
    assert at(device, 6, "P", "ST", "ER") == ["500", "0", "86"]


def test_a_held_rotor_is_no_stall_within_sf():
    device = drive("EE=1", "SF=65000", "MR 3000", locked=((0.0, 0.2),))
    assert at(device, 0.19, "C2", "ST") == ["0", "0"]
    assert at(device, 60, "C2", "ST", "ER") == ["3000", "0", "0"], "what was missing has been made good"


def test_what_is_missing_after_a_move_is_made_good_at_vi_after_mt():
    device = drive("EE=1", "MT=50", "VI=100", "MR 1000")
    device.advance(0.05)
    device.world.push(-128, 0.05)
    end = device.motor.axis.profile.end
    assert at(device, end + 0.04, "P", "MV") == ["990", "0"]
    assert at(device, end + 0.06, "MV", "V", "MP") == ["1", "100", "1"]
    assert say(device, "MA 5", "MR 5") == ["?93", "?93"]
    assert at(device, end + 0.2, "P", "MV", "ST") == ["1000", "0", "0"]


def test_within_the_deadband_nothing_is_made_good():
    device = drive("EE=1", "DB=10", "MR 1000")
    device.advance(0.05)
    device.world.push(-128, 0.05)
    assert at(device, 5, "P", "MV", "ER") == ["990", "0", "0"]


def test_what_cannot_be_made_good_is_a_position_error():
    device = drive("EE=1", "SF=100", "MT=50", "MR 2050", stall_at=25600)
    assert at(device, 10, "P", "ER", "ST", "MV") == ["2000", "92", "0", "0"]


@pytest.mark.parametrize(
    ("setting", "push", "ends", "stalled"),
    [
        (("PM=0",), 128, 10, 0),
        (("PM=1",), 128, 0, 0),
        (("PM=1", "DB=10"), 128, 10, 0),
        (("PM=1",), 256, 20, 1),
        (("PM=1", "SM=1"), 256, 0, 1),
        (("PM=1", "DE=0"), 128, 10, 0),
    ],
)
def test_position_maintenance_goes_back_when_pushed(setting, push, ends, stalled):
    device = drive("EE=1", *setting)
    device.advance(1)
    device.world.push(push, 1)
    assert at(device, 1, "P") == [str(push * 10 // 128)]
    assert at(device, 3, "P", "ST", "MV") == [str(ends), str(stalled), "0"]


def test_a_push_in_the_middle_of_a_program_is_seen_by_its_error_handler():
    device = drive(
        "EE=1", program="PG 1\nLB G1\nOE K1\nLB G2\nH 10\nBR G2\nE\nLB K1\nPR ST\nST=0\nRT\nPG", stall_at=1e9
    )
    say(device, "EX G1")
    device.advance(1)
    device.world.push(500, 1)
    device.advance(1)
    device.advance(2)
    assert [text for _, text in device.prints()] == ["1\r\n"]


def test_a_wall_stops_a_push_too():
    device = drive(stall_at=100)
    device.advance(1)
    device.world.push(500, 1)
    device.advance(1)
    assert rotor(device) == 100


def test_an_encoder_of_other_lines_on_the_motion_module():
    device = drive("EL=500", "EE=1", "MR 2000", personality="LMM")
    assert at(device, 5, "C1", "C2") == ["51200", "2000"]
    assert say(drive("SA=0.9", "EE=1", "MR 4000", personality="LMM"), "PR EE") == ["1"]


def test_a_motor_of_another_step_angle_has_other_steps_in_a_turn():
    device = drive("SA=0.9", "EE=1", "MR 4000", personality="LMM")
    assert at(device, 9, "C1", "C2", "I6") == ["102400", "4000", "1"]


def test_advancing_in_one_go_is_advancing_step_by_step():
    def run(stops):
        device = drive(
            "EE=1", "SM=1", "AT=2", "SF=200", "MT=50", "MR 3000", stall_at=25600, locked=((0.1, 0.2), (8.0, 9.0))
        )
        for t in stops:
            device.advance(t)
        say(device, "MA -2000")
        for t in stops:
            device.advance(10 + t)
        return at(device, 30, "P", "C1", "ST", "ER", "MV"), device.motor.axis.rotor.position(30)

    assert run([10]) == run([k * 0.0625 for k in range(1, 161)])


def test_a_rotor_that_a_smaller_deadband_leaves_out_of_place_is_brought_back():
    device = drive("EE=1", "PM=1", "DB=10")
    device.world.push(8 * 12.8, 0.0)
    assert at(device, 1.0, "C2", "MV") == ["8", "0"]
    say(device, "DB=8")
    assert at(device, 2.0, "C2") == ["8"]
    say(device, "DB=7")
    assert at(device, 3.0, "C2", "EF") == ["0", "0"]


def test_a_rotor_that_was_turned_while_the_drive_was_disabled_is_not_out_of_place():
    device = drive("EE=1", "PM=1", "DE=0")
    device.world.push(12800, 0.0)
    device.advance(1.0)
    say(device, "DE=1")
    device.world.push(128, 1.0)
    device.advance(2.0)
    assert say(device, "PR C2", "PR ST", "PR EF") == ["1000", "0", "0"]


def test_a_rotor_that_was_turned_without_main_supply_is_not_out_of_place():
    device = drive("EE=1", "PM=1")
    device.supply(False, 0.0)
    device.world.push(12800, 0.0)
    device.advance(1.0)
    device.supply(True, 1.0)
    device.world.push(128, 1.0)
    device.advance(2.0)
    assert say(device, "PR C2", "PR ST", "PR ER") == ["1000", "0", "79"]


def test_position_maintenance_brings_back_what_was_pushed_before_it_was_enabled():
    device = drive("EE=1", "DB=2", "SF=50", "MR 4000")
    device.advance(2.0)
    device.world.push(128, 2.0)
    device.advance(2.0)
    device.advance(3.0)
    assert say(device, "PR P", "PM=1") == ["4010"]
    device.advance(4.0)
    assert say(device, "PR P", "PR MV", "PR EF") == ["4000", "0", "0"]


def test_position_maintenance_does_not_go_into_an_active_limit():
    device = drive("EE=1", "PM=1", "DB=2", "SF=500", "IS=2,2,0", "MR 4000", inputs=[[1.5, 2, 0]])
    device.advance(2.0)
    device.world.push(-640, 2.0)
    device.advance(2.0)
    device.advance(4.0)
    assert say(device, "PR P", "PR MV", "PR ER") == ["3950", "0", "83"]


@pytest.mark.parametrize(("mode", "push", "end"), [(0, 10, "2048"), (0, 40, "2088"), (1, 10, "2048"), (1, 40, "2048")])
def test_position_maintenance_goes_back_unless_it_was_a_stall_that_stops(mode, push, end):
    device = drive("EE=1", "DB=2", "PM=1", f"SM={mode}", "SF=15", "MT=50", "MR 2048")
    device.advance(2.0)
    device.world.push(push * 12.8, 2.0)
    assert at(device, 2.01, "C2") == [str(2048 + push)]
    assert at(device, 9.0, "C2", "ST") == [end, str(int(push > 15))]


# Stalls in encoder mode: when one is found, what it stops, and when it is none.


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


def test_hmt_takes_stalls_and_position_maintenance_out_of_force():
    device = closed_loop("EE=1", "SF=10", "PM=1", "LG=2000000", "LT=60000", stall_at=50000)
    say(device, "MA 100000")
    assert at(device, 3.0, "ST", "ER") == ["0", "0"]


@pytest.mark.parametrize(("mode", "made"), [(0, 2030), (1, 2048)])
def test_a_bind_is_a_stall_when_sf_more_counts_were_made(mode, made):
    device = drive("EE=1", "SF=30", f"SM={mode}", "MT=1000", "MR 2048", stall_at=2000 * 12.8)
    assert at(device, 1.0, "C1", "C2", "ST", "ER", "MV") == [str(int(made * 12.8)), "2000", "1", "86", "0"]


# Following a clock: trips, stalls, walls and locks on the way.


FOLLOWING = ("IS=3,13,0", "IS=4,13,0", "FL=1")


def pulses(count: int, start: float = 0.0, level: int = 0) -> list[list[float]]:
    """Steps on input 3, two milliseconds each; plus with level 0 on input 4."""
    edges = [[start + 0.001 * k, 3, k % 2] for k in range(2 * count)]
    return [[start, 4, level], *edges]


def test_a_trip_on_position_happens_while_following() -> None:
    device = drive(*FOLLOWING, "TP=20,K1", "TE=2", program="PG 1\nLB K1\nPR P\nRT\nPG", inputs=pulses(30, 0.5))
    device.advance(5)
    assert [text for _, text in device.prints()] == ["20\r\n"]
    assert say(device, "PR P", "PR TE") == ["30", "0"]


def test_a_relative_trip_happens_again_and_again_while_following() -> None:
    lines = (*FOLLOWING, "TR=10,K1", "TE=16")
    device = drive(*lines, program="PG 1\nLB K1\nPR P\nRT\nPG", inputs=pulses(35, 0.5, level=1))
    device.advance(5)
    assert [text for _, text in device.prints()] == ["-10\r\n", "-20\r\n", "-30\r\n"]


@pytest.mark.parametrize("mode", ["EE=0", "EE=1"])
def test_a_rotor_that_follows_stands_at_a_wall_and_comes_back_from_it(mode: str) -> None:
    inputs = [*pulses(100, 0.5), *pulses(60, 1, level=1)]
    device = drive(*FOLLOWING, mode, "SF=60000", stall_at=51, inputs=inputs)
    device.advance(0.9)
    assert say(device, "PR C1", "PR C2") == ["100", "4"]
    assert at(device, 5, "C1", "C2") == ["40", "-1"]


def test_with_hmt_a_rotor_that_follows_makes_good_what_a_wall_has_kept_back() -> None:
    inputs = [*pulses(100, 0.5), *pulses(60, 1, level=1)]
    device = drive(*FOLLOWING, "AS=1", stall_at=51, inputs=inputs)
    assert at(device, 0.9, "C1", "C2", "LL") == ["100", "4", "49"]
    assert at(device, 5, "C1", "C2", "LL") == ["40", "3", "0"]


def test_a_stall_while_following_is_one() -> None:
    device = drive(*FOLLOWING, "EE=1", stall_at=51, inputs=pulses(1000, 0.5))
    assert at(device, 0.9, "ST", "ER") == ["0", "0"]
    assert at(device, 3, "ST", "ER") == ["1", "86"]


def test_a_locked_rotor_follows_no_clock() -> None:
    device = drive(*FOLLOWING, "AS=2", "LT=100", locked=[[0.1, 1.5]], inputs=pulses(100, 2))
    device.advance(0.05)
    say(device, "MR 5000")
    assert at(device, 5, "LR", "P", "C1") == ["1", "5000", "5000"]


def test_torque_mode_that_stands_follows_no_clock() -> None:
    device = drive(*FOLLOWING, "AS=3", "TS=60000", inputs=pulses(100, 2))
    device.escape(1.0)
    (before,) = say(device, "PR P")
    assert at(device, 5, "P") == [before]
