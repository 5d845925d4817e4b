"""The simulated drive's words from A to EE, as the manual's 5.1.1 to 5.1.36 have them."""

import pytest

from tests.support.moving import at, drive, say


def printed(device, seconds):
    """What it prints by itself in so many seconds."""
    device.advance(device.now + seconds)
    return "".join(text for _, text in device.prints()).split("\r\n")[:-1]


# A, D and the unit they are in.


def test_what_an_lmm_moves_by_in_steps_follows_ms_while_it_counts():
    device = drive("EE=1", "MS=128", "EE=0", personality="LMM")
    assert say(device, 'PR A," ",D," ",VI," ",VM') == ["500000 500000 500 384000"]
    device = drive("EE=1", "A=500", "MS=128", "PR A", personality="LMM")
    assert say(device, 'PR A," ",VM') == ["500 60000"]


# AT, AJ, DT, DJ.

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


@pytest.mark.parametrize("line", ["SL 0", "PS", "AS=0"])
def test_stops_have_straight_ramps_where_the_s_curve_would_be_too_steep(line):
    begins = ("AS=3", "TS=100000") if line == "AS=0" else ("EX G1",)
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


# AL.


def test_al_is_for_immediate_use_only():
    device = drive()
    assert [device.execute(line, 0.0).refused for line in ("PG 1", "PR AL", 'PR "AL"', "PG")] == [0, 1, 0, 0]
    assert say(device, "PR ER", "L") == ["24", '1  PR "AL"']


# AS, CB.


def test_a_change_between_the_modes_of_hmt_does_not_cut_its_calibration_short():
    device = drive("AS=1", "AS=2")
    assert say(device, "PR AF", "MR 5") == ["0", "?88"]
    device.advance(0.1)
    assert say(device, "PR AF", "MR 5", "PR EF") == ["128", "0"]


def test_a_calibration_that_failed_is_forgotten_once_as_is_taken():
    device = drive("AS=1", "DE=0")
    assert say(device, "AS=1", "PR AF", "DE=1", "AS=1", "PR EF") == ["?109", "256", "0"]
    assert at(device, 1.0, "AF") == ["128"]


def test_control_bounds_are_the_tightest_in_torque_mode_and_cannot_be_changed_there():
    device = drive("CB=2", "AS=3")
    assert say(device, "PR CB", "CB=3", "CB=0", "PR EF", "AS=0", "PR CB") == ["0", "?21", "0", "2"]


def test_a_rotor_that_stands_at_tighter_bounds_that_are_set_is_locked_from_then_on():
    device = drive("AS=1", "CB=3", "LT=100")
    device.advance(0.1)
    device.world.hold(True)
    say(device, "MR 400")
    assert at(device, 1.0, "LR") == ["0"]
    say(device, "CB=2", "CB=0")
    assert at(device, 1.09, "LR") == ["0"]
    assert at(device, 1.11, "LR", "ER") == ["1", "104"]


# CF.


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


# BE, BL, BM.


@pytest.mark.parametrize(("mode", "goes_on"), [(1, True), (3, False), (4, True)])
def test_a_backlash_move_does_not_turn_back_towards_an_active_limit(mode, goes_on):
    program = 'PG 1\nLB G1\nMR -5000,1\nH\nPR "on ",P\nE\nPG'
    device = drive("IS=3,2,0", f"LM={mode}", "BE=1", "BM=1", "BL=1000", program=program, inputs=[[0.0, 3, 0]])
    say(device, "EX G1")
    assert printed(device, 1.0) == (["on -6000"] if goes_on else [])
    assert say(device, "PR P", "PR MV", "PR ER") == ["-6000", "0", "83"]


def test_a_backlash_move_that_runs_on_tells_its_target_and_does_not_turn_back():
    device = drive("BE=1", "BM=1", "BL=1000", "VI=9999", "VM=10000", "A=1100000000", "MR -10000,1,1")
    assert printed(device, 0.99) == []
    assert printed(device, 0.02) == ["!"]
    say(device, "SL 0")
    assert at(device, 2.0, "MV", "MP") == ["0", "0"]


# C1, C2.


@pytest.mark.parametrize("way", [1, -1])
def test_a_trip_on_position_beyond_the_turnover_of_a_counter_happens_there(way):
    lines = (f"P={way * 2147483640}", f"TP={-way * 2147483640},K1", "TE=2", f"MR {way * 100}")
    device = drive(*lines, program="PG 1\nLB K1\nPR P\nRT\nPG")
    assert printed(device, 1.0) == [str(-way * 2147483640)]


# DB, and SF that goes with it.


def test_a_rotor_that_a_smaller_deadband_leaves_out_of_place_is_brought_back():
    device = drive("EE=1", "PM=1", "DB=10")
    device.world.push(8 * 12.8, 0.0)
    assert at(device, 1.0, "C2", "MV") == ["8", "0"]
    say(device, "DB=8")
    assert at(device, 2.0, "C2") == ["8"]
    say(device, "DB=7")
    assert at(device, 3.0, "C2", "EF") == ["0", "0"]


def test_a_stall_factor_that_is_set_below_the_error_is_a_stall_at_once():
    device = drive("EE=1", "SF=1000", "SL 1000")
    device.advance(1.0)
    device.world.hold(True)
    device.advance(1.0)
    device.advance(1.5)
    assert say(device, "PR ST", "SF=501", "PR ST", "SF=500", "PR ST", "PR ER", "PR MV") == ["0", "0", "1", "86", "0"]


# DE.


def test_a_rotor_that_was_turned_while_the_drive_was_disabled_is_not_out_of_place():
    device = drive("EE=1", "PM=1", "DE=0")
    device.world.push(12800, 0.0)
    device.advance(1.0)
    say(device, "DE=1")
    device.world.push(128, 1.0)
    device.advance(2.0)
    assert say(device, "PR C2", "PR ST", "PR EF") == ["1000", "0", "0"]


def test_ip_counts_what_the_rotor_has_lost_in_open_loop_for_no_stall():
    device = drive("EE=1", "S", "EE=0", "MR 100000", stall_at=5000)
    device.advance(3.0)
    say(device, "IP")
    device.world.push(-128, 3.0)
    device.advance(4.0)
    assert say(device, "PR EE", "PR C2", "PR ST", "PR EF") == ["1", "381", "0", "0"]


# EE.


def test_the_unit_that_changes_on_the_move_may_put_it_beyond_a_software_limit():
    device = drive("EE=1", "LS=1,50000,1", "SL 20000")
    device.advance(2.0)
    assert say(device, "PR EF", "EE=0", "PR ER") == ["0", "83"]
    assert at(device, 4.0, "MV") == ["0"]


# E.


@pytest.mark.parametrize("lines", [("TP=50000,K1", "TE=2"), ("LS=1,50000,1", "OE K1")])
def test_a_program_that_ends_after_its_motion_runs_subroutines_until_then(lines):
    program = 'PG 1\nLB G1\nMR 100000\nH\nPR "on"\nE\nPG\nPG 300\nLB K1\nPR "k",P\nRT\nPG'
    device = drive(*lines, "EX G1", program=program)
    device.advance(0.05)
    say(device, "E")
    assert printed(device, 0.3) == ["k50000"]
    assert say(device, "PR BY", "PR MV") == ["1", "1"]
    assert printed(device, 1.0) == []
    assert say(device, "PR BY") == ["0"]


# BR, CL.


@pytest.mark.parametrize("word", ["BR", "CL"])
def test_a_subroutine_that_runs_while_lines_are_stored_cannot_go_to_them(word):
    device = drive("TT=100,K1", "TE=8", program=f'PG 1\nLB K1\nPR "k"\nH 500\n{word} Z1\nE\nPG')
    say(device, "PG 300")
    assert printed(device, 0.2) == ["k"]
    for line in ("LB Z1", 'PR "z"', "RT", "PG"):
        device.execute(line, device.now)
    assert printed(device, 1.0) == []
    assert say(device, "PR ER", "PR BY", "EX Z1") == ["42", "0"]
    assert printed(device, 0.1) == ["z"]


# BM and PS.


def test_a_backlash_move_that_was_paused_on_its_way_out_still_loads_the_axis():
    lines = ("BE=1", "BM=1", "BL=5000", "TP=-104000,K1", "TE=2")
    program = 'PG 1\nLB G1\nMR -100000\nH\nPR "at ",P\nE\nLB K1\nPR "beyond"\nRT\nPG'
    device = drive(*lines, "EX G1", program=program)
    device.advance(0.1)
    say(device, "PS")
    device.advance(1.0)
    assert say(device, "PR MV", "RS") == ["0"]
    assert printed(device, 2.0) == ["beyond", "at -100000"]


# DC.


def test_a_variable_that_its_program_has_not_made_yet_cannot_be_stepped():
    device = drive(program="PG 1\nLB G1\nVA Q7=3\nDC Q7\nE\nPG")
    assert say(device, "DC Q7", "IC Q7", "DC Q8", "PR UV")[:3] == ["?25", "?25", "?25"]
    say(device, "EX G1")
    device.advance(1.0)
    assert say(device, "DC Q7", "PR Q7") == ["1"]


# BM=0 and EE.


def test_what_backlash_has_added_is_in_counts_once_the_encoder_is_enabled():
    device = drive("BE=1", "BL=1280")
    for line in ("MA 128000", "MA 0", "EE=1", "MA -5000"):
        say(device, line)
        device.advance(device.now + 9.0)
    assert say(device, "PR P", "PR C1") == ["-5100", "-65280"]


def test_a_rotor_that_was_turned_without_main_supply_is_not_out_of_place():
    device = drive("EE=1", "PM=1")
    device.supply(False, 0.0)
    device.world.push(12800, 0.0)
    device.advance(1.0)
    device.supply(True, 1.0)
    device.world.push(128, 1.0)
    device.advance(2.0)
    assert say(device, "PR C2", "PR ST", "PR ER") == ["1000", "0", "79"]


# DN.


@pytest.mark.parametrize("line", ["DN=a", "DN='a'", "DN=5", 'DN="ab"', 'DN=""', 'DN="!"', "DN=*"])
def test_a_name_is_one_letter_or_digit_in_quotation_marks(line):
    assert say(drive('DN="Z"'), line, "PR DN") == ["?21", '"Z"']
