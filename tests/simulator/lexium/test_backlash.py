"""Backlash compensation: the part of a move that makes up for it."""

import pytest

from tests.support.lexium import at, drive, printed_lines, run, say


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
