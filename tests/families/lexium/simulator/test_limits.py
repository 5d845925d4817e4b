"""Limits: software limits, limit switches, and what they stop."""

from __future__ import annotations

import pytest

from tests.support.lexium import at, drive, printed_lines, run, say


def test_the_unit_that_changes_on_the_move_may_put_it_beyond_a_software_limit():
    device = drive("EE=1", "LS=1,50000,1", "SL 20000")
    device.advance(2.0)
    assert say(device, "PR EF", "EE=0", "PR ER") == ["0", "83"]
    assert at(device, 4.0, "MV") == ["0"]


@pytest.mark.parametrize(("mode", "stands_at"), [(1, None), (4, 30000)])
def test_a_software_limit_that_is_set_behind_a_moving_axis_stops_it(mode, stands_at):
    device = drive(f"LM={mode}", "VM=100000", "VI=99999", "SL 100000")
    device.advance(0.3)
    assert say(device, "LS=1,1000,1", "PR ER") == ["83"]
    device.advance(1.0)
    assert say(device, "PR MV", "MR 5", "MR -5") == ["0", "?83"]
    if stands_at is not None:
        assert device.position(0.3) == stands_at


@pytest.mark.parametrize(("way", "code"), [(1, 83), (-1, 84)])
def test_a_counter_that_is_set_beyond_a_software_limit_stops_what_moves_that_way(way, code):
    device = drive("LS=1,200000,1", "LS=0,-200000,1", f"SL {way * 100000}")
    device.advance(0.3)
    assert say(device, f"P={-way * 300000}", "PR EF") == ["0"]
    assert say(device, f"P={way * 300000}", "PR ER") == [str(code)]
    device.advance(1.0)
    assert say(device, "PR MV") == ["0"]


@pytest.mark.parametrize(("personality", "line"), [("LMDOM", "IS=2,2,0"), ("MDI", "S2=2,0,0")])
def test_an_active_input_that_becomes_a_limit_switch_stops_what_moves_that_way(personality, line):
    device = drive("SL 1000", personality=personality, inputs=[[0.1, 2, 0]])
    device.advance(0.5)
    assert say(device, line, "PR ER") == ["83"]
    device.advance(1.0)
    assert say(device, "PR MV", "MR 5") == ["0", "?83"]
    other = drive("SL -1000", personality=personality, inputs=[[0.1, 2, 0]])
    other.advance(0.5)
    assert say(other, line, "PR EF") == ["0"]
    other.advance(1.0)
    assert say(other, "PR V", line, "PR EF") == ["-1000", "0"]


def test_a_software_limit_within_which_an_axis_moves_is_no_error():
    device = drive("SL 100000")
    device.advance(0.3)
    assert say(device, "LS=1,1000000,1", "LS=1,5,0", "P=77", "PR EF", "PR V") == ["0", "100000"]


@pytest.mark.parametrize(("mode", "overshoot"), [(1, 1250), (4, 0)])
@pytest.mark.parametrize("limit", ["LS=1,20000,1", "IS=2,2,0"])
def test_a_limit_stops_torque_mode_too(mode, overshoot, limit):
    device = drive(f"LM={mode}", limit, "TS=50000", "TQ=50", "AS=3", limit_plus=20000)
    device.advance(2.0)
    assert say(device, "PR ER", "PR MV", "PR P") == ["83", "0", str(20000 + overshoot)]
    device.advance(4.0)
    assert say(device, "PR EF", "PR MV", "TD=0") == ["0", "0"]
    device.advance(4.5)
    assert say(device, "PR AV", "TD=1") == ["-50000"]
    device.advance(6.0)
    assert say(device, "PR ER", "PR MV", "PR P") == ["83", "0", str(20000 + overshoot)]


@pytest.mark.parametrize(("mode", "runs"), [(1, "1"), (3, "0")])
@pytest.mark.parametrize("limit", ["LS=1,4,1", "IS=2,2,0"])
def test_a_limit_bars_the_pulses_of_a_clock_once_it_is_met(limit, mode, runs):
    pulses = [each for n in range(10) for each in ([0.1 + n / 50, 3, 0], [0.11 + n / 50, 3, 1])]
    back = [[0.5, 4, 1], [0.6, 3, 0], [0.61, 3, 1]]
    program = "PG 1\nLB G1\nH 60000\nE\nPG"
    device = drive("IS=3,13,0", limit, f"LM={mode}", "FL=1", "EX G1", program=program,
                   limit_plus=4, inputs=[[0.0, 4, 0], *pulses, *back])  # fmt: skip
    device.advance(0.4)
    assert say(device, "PR P", "PR ER", "PR BY") == ["4", "83", runs]
    device.advance(1.0)
    assert say(device, "PR P", "PR EF") == ["3", "0"]


# Backlash compensation: the part of a move that makes up for it.


@pytest.mark.parametrize(("mode", "goes_on"), [(1, True), (3, False), (4, True)])
def test_a_backlash_move_does_not_turn_back_towards_an_active_limit(mode, goes_on):
    program = 'PG 1\nLB G1\nMR -5000,1\nH\nPR "on ",P\nE\nPG'
    device = drive("IS=3,2,0", f"LM={mode}", "BE=1", "BM=1", "BL=1000", program=program, inputs=[[0.0, 3, 0]])
    say(device, "EX G1")
    assert printed_lines(device, 1.0) == (["on -6000"] if goes_on else [])
    assert say(device, "PR P", "PR MV", "PR ER") == ["-6000", "0", "83"]


def test_a_backlash_move_that_runs_on_tells_its_target_and_does_not_turn_back():
    device = drive("BE=1", "BM=1", "BL=1000", "VI=9999", "VM=10000", "A=1100000000", "MR -10000,1,1")
    assert printed_lines(device, 0.99) == []
    assert printed_lines(device, 0.02) == ["!"]
    say(device, "SL 0")
    assert at(device, 2.0, "MV", "MP") == ["0", "0"]


def test_a_backlash_move_that_was_paused_on_its_way_out_still_loads_the_axis():
    lines = ("BE=1", "BM=1", "BL=5000", "TP=-104000,K1", "TE=2")
    program = 'PG 1\nLB G1\nMR -100000\nH\nPR "at ",P\nE\nLB K1\nPR "beyond"\nRT\nPG'
    device = drive(*lines, "EX G1", program=program)
    device.advance(0.1)
    say(device, "PS")
    device.advance(1.0)
    assert say(device, "PR MV", "RS") == ["0"]
    assert printed_lines(device, 2.0) == ["beyond", "at -100000"]


def test_what_backlash_has_added_is_in_counts_once_the_encoder_is_enabled():
    device = drive("BE=1", "BL=1280")
    for line in ("MA 128000", "MA 0", "EE=1", "MA -5000"):
        say(device, line)
        device.advance(device.now + 9.0)
    assert say(device, "PR P", "PR C1") == ["-5100", "-65280"]


def test_both_parts_of_a_move_that_makes_up_for_backlash_have_the_top_speed_it_began_with():
    device = drive("BE=1", "BM=1", "BL=100000", "MA -200000")
    device.advance(0.3)
    say(device, "VM=20000")
    assert int(at(device, 1.2, "V")[0]) > 100000
    assert at(device, 5, "P", "MV") == ["-200000", "0"]


def test_backlash_is_made_up_for_in_a_move_against_the_slew_before_it():
    device = drive()
    lines = ["BE=1", "BL=1000", "SL -10000", 1.0, "SL 0", 1.0, "P=0"]
    assert run(device, *lines, "MR 5000", 2.0, "PR P", "MR 5000", 2.0, "PR P") == ["6000", "11000"]


def test_a_move_that_is_refused_takes_up_no_backlash():
    device = drive()
    run(device, "BE=1", "BL=1000", "MR 5000", 2.0, "A=1100000000", "AT=2")
    assert run(device, "MR -5000", "AT=1", "A=1000000", "MR -5000", 2.0, "PR P") == ["?98", "-1000"]
