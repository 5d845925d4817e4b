"""The simulated drive's words from LM to PY, as the manual's 5.1.76 to 5.1.105 have them."""

import pytest

from tests.support.moving import drive, say

PROGRAM = "PG 1\nLB G1\nMR 5\nE\nPG"


def printed(device, seconds):
    """What it prints by itself in so many seconds."""
    device.advance(device.now + seconds)
    return "".join(text for _, text in device.prints()).split("\r\n")[:-1]


# LM, LS.


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


# MA, MR.


@pytest.mark.parametrize(
    ("before", "line", "told"),
    [
        ("A=1000000", "PR P", ["!"]),
        ("A=1000000", "SL 0", []),
        ("A=1000000", "SL 5", []),
        ("A=1000000", "MR 5", []),
        ("A=1000000", "DE=0", []),
        ("LS=1,200000,1", "PR P", []),
        ("LM=4", "LS=1,1,1", []),
    ],
)
def test_the_name_is_sent_when_a_move_is_complete_and_not_when_it_was_stopped(before, line, told):
    device = drive(before, "MA 300000,1")
    device.advance(0.3)
    device.execute(line, 0.3)
    assert printed(device, 3.0) == told


def test_a_pause_keeps_the_name_for_the_end_of_the_move():
    device = drive(program="PG 1\nLB G1\nMA 300000,1\nH\nE\nPG")
    say(device, "EX G1")
    device.advance(0.3)
    assert say(device, "PS") == []
    assert printed(device, 2.0) == []
    assert say(device, "RS") == []
    assert printed(device, 2.0) == ["!"]


@pytest.mark.parametrize("word", ["MR", "MA"])
def test_a_move_of_nothing_that_runs_on_goes_nowhere(word):
    device = drive()
    assert say(device, f"{word} 0,1,1") == []
    assert printed(device, 1.0) == ["!"]
    assert say(device, "PR MV", "PR P") == ["0", "0"]


@pytest.mark.parametrize("velocity", [100000, -100000])
def test_a_move_of_nothing_that_runs_on_while_moving_keeps_its_direction(velocity):
    device = drive("VM=50000", f"SL {velocity}")
    device.advance(1.0)
    assert say(device, "MR 0,0,1") == []
    device.advance(2.0)
    assert say(device, "PR V") == [str(velocity // 2)]


# MD, NE.


def test_the_motion_mode_is_a_state_that_ip_does_not_bring_back():
    device = drive("SL 5", "S", "SL 0")
    assert say(device, "MR 0", "IP", "PR MD") == ["MR"]


@pytest.mark.parametrize("line", ["5+5", "-R1", "100-5"])
def test_numeric_enable_takes_a_number_and_nothing_that_is_computed(line):
    device = drive("NE=1", "MR 0")
    assert say(device, line, "PR MV") == ["?60", "0"]


def test_numeric_enable_takes_signs():
    device = drive("NE=1", "MA 0")
    for line, position in (("500", 500), ("-20", -20), ("+7", 7)):
        assert say(device, line) == []
        device.advance(device.now + 1)
        assert device.position(device.now) == position


# MS.


def test_encoder_mode_puts_an_lmds_microsteps_to_256_and_back():
    device = drive("MS=16")
    assert say(device, "EE=1", "PR MS", "MS=16", "MS=256", "PR MS") == ["256", "?21", "256"]
    assert say(device, "MR 4000") == []
    device.advance(3.0)
    assert say(device, "PR P", "PR C1", "EE=0", "PR MS", "PR VM", "PR A") == [
        "4000", "51200", "16", "48000", "62500",
    ]  # fmt: skip


def test_microsteps_of_encoder_mode_are_kept_with_it():
    device = drive("MS=16", "EE=1", "S")
    assert say(device, "EE=0", "PR MS", "IP", "PR EE", "PR MS") == ["16", "1", "256"]
    device.power(False, 1.0)
    device.power(True, 2.0)
    assert say(device, "PR MS", "EE=0", "PR MS", "FD", "PR MS") == ["256", "16", "256"]


def test_microsteps_too_coarse_for_hmt_hinder_it_in_encoder_mode_too():
    device = drive("MS=8", "EE=1")
    assert say(device, "AS=1", "PR AS", "PR MS", "EE=0", "PR MS", "MS=10", "EE=1", "AS=1", "PR MS") == [
        "?21", "0", "256", "8", "10",
    ]  # fmt: skip


def test_with_hmt_motion_is_in_steps_even_with_ee():
    device = drive("EE=1", "VM=50000", "P=7")
    assert say(device, "AS=1", "PR EE", "PR VM", "PR A", "PR P", "VM=600000") == ["1", "768000", "1000000", "0"]
    device.advance(0.1)
    assert say(device, "MA 51200") == []
    device.advance(2.0)
    assert say(device, "PR P", "PR C2", "AS=0", "PR P", "PR VM", "AS=1", "PR VM") == [
        "51200", "4007", "4007", "50000", "600000",
    ]  # fmt: skip
    device.advance(3.0)
    assert say(device, "SL 200001", "SL 0") == []


def test_what_encoder_mode_and_hmt_make_of_the_units_is_kept_by_s():
    device = drive("EE=1", "AS=1", "S", "AS=0")
    assert say(device, "PR VM", "IP", "PR AS", "PR VM") == ["60000", "1", "768000"]
    device.power(False, 1.0)
    device.power(True, 2.0)
    assert say(device, "PR EE", "PR AS", "PR VM", "AS=0", "PR VM") == ["1", "1", "768000", "60000"]


def test_an_lmms_microsteps_are_free_in_encoder_mode():
    assert say(drive("MS=64", personality="LMM"), "EE=1", "PR MS", "MS=128", "EE=0", "PR MS") == ["64", "128"]


# PM.


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


# O1 to O3, OS.


@pytest.mark.parametrize("line", ["OS=1,22,0", "OS=1,5,0", "OS=1,-1", "IS=1,16,0", "IS=1,9,0", "IS=5,0,0", "IS=6,1,0"])
def test_a_type_that_an_input_or_output_cannot_have_is_error_8(line):
    device = drive()
    before = say(device, "PR OS", "PR IS")
    assert say(device, line) == ["?8"]
    assert say(device, "PR OS", "PR IS") == before


def test_ip_takes_setups_back_and_leaves_outputs_alone():
    device = drive("OS=3,17,1", "S")
    assert say(device, "O2=1", "OS=3,16", "IP", "PR OS")[2:] == ["OS = 3, 17, 1"]
    assert device.outputs(0.0) == {1: False, 2: True, 3: False}
    device.reset(1.0)
    assert device.outputs(1.0)[2] is False


def test_the_moving_output_waits_for_the_delays_after_any_motion():
    device = drive("OS=1,17", "HT=200", "MT=100")
    assert device.outputs(0.0)[1] is False
    say(device, "SL 1000")
    device.advance(0.5)
    say(device, "SL 0")
    assert [device.moving(0.51), device.outputs(0.51)[1], device.outputs(0.79)[1]] == [False, True, True]
    assert device.outputs(0.81)[1] is False


# PS.


@pytest.mark.parametrize("move", ["SL 100000", "MR 500000"])
@pytest.mark.parametrize(
    ("meanwhile", "code"), [(["LS=1,5,1"], 83), (["DE=0"], 94), (["IS=1,1,0", "VM=5000", "HM 3"], 85)]
)
def test_a_pause_does_not_end_in_a_motion_that_may_not_begin(move, meanwhile, code):
    device = drive(program=f"PG 1\nLB G1\n{move}\nH 5000\nE\nPG")
    say(device, "EX G1")
    device.advance(0.3)
    say(device, "PS")
    device.advance(1.0)
    assert say(device, *meanwhile, "RS", "PR BY") == [f"?{code}", "1"]
    assert device.axis.kind != move[:2] or not device.moving(1.0)


def test_a_pause_may_end_before_the_motor_stands():
    device = drive(program="PG 1\nLB G1\nMR 500000\nH\nE\nPG")
    say(device, "EX G1")
    device.advance(0.3)
    say(device, "PS")
    device.advance(0.4)
    assert say(device, "RS") == []
    device.advance(4.0)
    assert say(device, "PR P", "PR BY", "PR EF") == ["500000", "0", "0"]


# PG, PR, LK.


@pytest.mark.parametrize("address", ["1.5", "10.0", "1e2", "0", "-1", "6385"])
def test_program_mode_begins_at_a_whole_address_only(address):
    device = drive()
    assert say(device, f"PG {address}", "PR P") == ["?42", "0"]


@pytest.mark.parametrize("what", ["5.50", "1e3", "-0.5"])
def test_print_takes_no_number_with_a_fraction(what):
    assert say(drive(), f"PR {what}") == ["?35"]


@pytest.mark.parametrize("line", ["PR ,P", "PR P,", "PR P,,V", "PR ,", "PR P,;", "PRP,", "PR=,P", "PR P, 'remark"])
def test_a_comma_of_a_print_stands_between_two_things(line):
    assert say(drive(), line) == ["?24"]


def test_a_print_may_go_without_commas_or_have_them_in_a_text():
    device = drive(program='PG 1\nLB G1\nPR "a,",P," ,"\nE\nPG')
    assert say(device, 'PR P V", ",P', "PRP,V", 'PR "x",P;', "PR", "PR=P,V 'no, really", "EX G1") == [
        "00, 0", "00", "", "00",
    ]  # fmt: skip
    assert printed(device, 1.0) == ["a,0 ,"]
    assert say(device, "PG 1") == []
    assert device.execute("PR P,", device.now).refused
    assert device.programming == 1


@pytest.mark.parametrize("line", ["EX G1,1", "EX G1,2", "BP G1,1", "BP"])
def test_a_locked_program_is_not_shown_line_by_line(line):
    device = drive("LK=1", program=PROGRAM)
    assert say(device, line, "BP=0") == ["?44"]
    assert say(device, "EX G1") == []
    assert printed(device, 1.0) == []
    assert say(device, "PR P") == ["5"]


def test_a_trace_ends_where_the_program_locks_itself():
    device = drive(program="PG 1\nLB G1\nLK=1\nMR 5\nE\nPG")
    assert say(device, "EX G1,1") == []
    assert printed(device, 1.0) == ["6  LK=1"]
    assert say(device, "PR P") == ["5"]
