"""Variables and names: declared, local, stepped, computed with."""

from __future__ import annotations

import pytest

from tests.support.lexium import at, codes, drive, printed, printed_lines, rotor, run, say


def test_a_variable_that_its_program_has_not_made_yet_cannot_be_stepped():
    device = drive(program="PG 1\nLB G1\nVA Q7=3\nDC Q7\nE\nPG")
    assert say(device, "DC Q7", "IC Q7", "DC Q8", "PR UV")[:3] == ["?25", "?25", "?25"]
    say(device, "EX G1")
    device.advance(1.0)
    assert say(device, "DC Q7", "PR Q7") == ["1"]


def test_a_variable_is_not_executed() -> None:
    device = drive("VA Q1=1", program="PG 1\nLB G1\nPG")
    assert codes(device, "EX Q1", "EX VM", "EX Q2", "EX 5", "EX G1") == [34, 34, 30, 42, 0]


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


def test_a_variable_of_0_with_another_products_word_harms_nothing():
    assert say(drive("VA SA", "VA AS", personality="MDIE"), "MS=128", "EE=1", "EE=0", "PR SA,AS,MS") == ["00128"]


def test_user_variables_tell_their_scope():
    device = drive("R1=8", "VA Q1=25", "EX G1", program="PG 1\nLB G1\nVA Q2=R1\nIC Q2\nE\nPG")
    device.advance(1)
    assert say(device, "PR UV") == ["G1 = 1", "Q1 = G 25", "Q2 = L 9", ""]
    refused = say(device, "VA Q1", "VA Q1=3", "VA G1", "VA VM=3", "VA 1Q", "VA QQQ", "VA I7", "VA", "VA Q5=ZZ", "PR Q5")
    assert refused == ["?28", "?28", "?28", "?29", "?24", "?24", "?24", "?24", "?30", "?35"]
    assert say(device, "PR Q1", "S", "Q1=3", "IP", "PR Q1", "UG 2956102") == ["25", "25", "?24"]


@pytest.mark.parametrize("word", ["FT", "PK", "I7", "I13"])
def test_a_reserved_word_is_illegal_as_a_variable_and_as_a_label(word):
    device = drive()
    lines = [f"{word}=5", f"VA {word}", f"R1={word}", f"IC {word}", f"EX {word}"]
    assert run(device, *lines, "PG 1", f"LB {word}", "PG") == ["?24"] * 6


def test_the_names_of_functions_are_free_where_there_are_none():
    device = drive(personality="MDI")
    assert run(device, "VA PI=7", "VA SI=3", "R1=PI", "PR R1", "R1=SI+1", "PR R1", "R1=SI -1", "PR R1") == [
        "7",
        "4",
        "2",
    ]
    assert run(device, "R1=SQ 4", "R1=2+AB R1") == ["?24", "?24"]


def test_set_ups_of_several_lines_are_no_numbers():
    device = drive("R1=7")
    assert say(device, "R1=LS", "R1=OS", "PR R1") == ["?35", "?35", "7"]


@pytest.mark.parametrize(("lines", "line"), [([], "VA 1Q"), ([], "VA Q1 5"), (["PG 1"], "LB 2A")])
def test_what_is_no_name_is_illegal_data(lines, line):
    device = drive(*lines)
    assert device.execute(line, 0.0).refused
    assert device.memory.values["ER"] == 24


def test_a_local_variable_begins_anew_with_each_program_and_leaves_a_global_one_alone():
    device = drive(program="PG 1\nLB G1\nVA Q1\nIC Q1\nPR Q1\nE\nPG")
    for t in (1.0, 2.0):
        say(device, "EX G1", f"R1={t:.0f}")
        device.advance(t)
    assert "".join(text for _, text in device.prints()).split() == ["1", "1"]
    device = drive(program="VA Q1=3\nPG 1\nLB G1\nIC Q1\nPR Q1\nE\nPG")
    for t in (1.0, 2.0):
        say(device, "EX G1")
        device.advance(t)
    assert "".join(text for _, text in device.prints()).split() == ["4", "5"]


# What a step is: microsteps, step angle, motor steps and counts of the encoder, and the figures of moves in them.


def test_what_an_lmm_moves_by_in_steps_follows_ms_while_it_counts():
    device = drive("EE=1", "MS=128", "EE=0", personality="LMM")
    assert say(device, 'PR A," ",D," ",VI," ",VM') == ["500000 500000 500 384000"]
    device = drive("EE=1", "A=500", "MS=128", "PR A", personality="LMM")
    assert say(device, 'PR A," ",VM') == ["500 60000"]


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


def test_the_step_angle_takes_the_angles_of_the_table_only():
    device = drive(personality="LMM")
    for angle in ("0.45", "0.72", "0.9", "1.8", "1.875", "2", "2.5", "3.6", "5"):
        assert say(device, f"SA={angle}", "PR SA") == [f"{float(angle):.6f}"]
    assert say(device, "SA=1", "SA=0.91", "PR SA", "FD", "PR SA") == ["?21", "?21", "5.000000", "1.800000"]


def test_a_finer_motor_turns_once_in_twice_the_steps():
    device = drive("SA=0.9", "MR 102400", personality="LMM")
    device.advance(2)
    assert device.motor.rotor.physical(2) == 51200


def test_microsteps_are_at_least_two_for_each_count_of_the_encoder():
    device = drive(personality="LMM")
    assert run(device, "EL=512", "EE=1", "MS=16", "MS=25", "PR MS") == ["?36", "25"]
    assert run(device, "EL=1000", "PR EL", "EL=500", "PR EL") == ["?36", "512", "500"]
    assert run(device, "EL=2001", "EL=0") == ["?21", "?21"]


def test_the_encoder_is_not_enabled_while_microsteps_are_too_coarse_for_it():
    device = drive(personality="LMM")
    assert run(device, "MS=32", "EE=1", "PR EE") == ["?36", "0"]
    assert run(device, "SA=0.9", "EE=1", "PR EE", "SA=1.8", "PR SA") == ["1", "?36", "0.900000"]


def test_the_step_angle_prints_as_the_manual_shows_it():
    device = drive(personality="LMM")
    assert say(device, "PR SA", "SA=0.9", "PR SA", "SA=2", "PR SA") == ["1.800000", "0.900000", "2.000000"]
    assert "SA = 2.000000" in device.execute("PR AL", 0.0).lines


def test_seven_and_a_half_inches_take_5_766_s():
    device = drive("MR 3840000")
    # Up to 768000 steps/s in 0.767 s and (768000 + 1000) / 2 * 0.767 = 294911.5 steps.
    assert at(device, 0.7669, "VC") == ["1"] and at(device, 0.7671, "VC", "V") == ["0", "768000"]
    assert at(device, 0.767, "P") == ["294988"]  # which is 0.1 ms later
    assert device.motor.axis.profile.end == pytest.approx(0.767 + (3840000 - 2 * 294911.5) / 768000 + 0.767)
    assert device.motor.axis.profile.end == pytest.approx(5.766, abs=1e-4)


def test_half_the_microsteps_make_the_same_number_of_steps_twice_as_far():
    device = drive("MS=128", "MR 51200")
    device.advance(5.0)
    assert device.motor.rotor.physical(5.0) == 2 * 51200


@pytest.mark.parametrize(("steps", "turns"), [(96000, 1.875), (41713, 0.8147)])
def test_rotary_moves_turn_as_far_as_is_worked_out(steps, turns):
    device = drive("VM=6827", f"MR {steps}")
    assert at(device, 2.0, "V") == ["6827"]  # 8 rpm
    device.advance(60.0)
    assert rotor(device) / 51200 == pytest.approx(turns, abs=1e-4)


def test_with_the_encoder_on_all_is_in_counts_of_4000_to_a_turn():
    device = drive("EE=1")
    assert say(device, "PR VM", "PR VI", "PR A", "PR D", "PR MS") == ["60000", "78", "78125", "78125", "256"]
    assert say(device, "MS=128", "MR 14000") == ["?21"]
    device.advance(5.0)
    assert rotor(device) == 3.5 * 51200
    device = drive("EE=1", "SL 14000")
    device.advance(3.0)
    here = rotor(device)
    device.advance(4.0)
    assert (rotor(device) - here) / 51200 * 60 == pytest.approx(210, abs=0.01)


# The name of a drive: what it may be, and a move that sends it at its end.


@pytest.mark.parametrize("line", ["DN=a", "DN='a'", "DN=5", 'DN="ab"', 'DN=""', 'DN="!"', "DN=*"])
def test_a_name_is_one_letter_or_digit_in_quotation_marks(line):
    assert say(drive('DN="Z"'), line, "PR DN") == ["?21", '"Z"']


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
    assert printed_lines(device, 3.0) == told


def test_a_pause_keeps_the_name_for_the_end_of_the_move():
    device = drive(program="PG 1\nLB G1\nMA 300000,1\nH\nE\nPG")
    say(device, "EX G1")
    device.advance(0.3)
    assert say(device, "PS") == []
    assert printed_lines(device, 2.0) == []
    assert say(device, "RS") == []
    assert printed_lines(device, 2.0) == ["!"]


def test_a_name_without_quotation_marks_is_error_21_whatever_it_is():
    assert run(drive(), "DN=a", "DN=7", "DN=!", "DN=#", "DN=-", 'DN="!"', "PR DN") == ["?21"] * 6 + ['"!"']


def test_dn_alone_is_a_variable_that_cannot_be_executed():
    assert run(drive(), "DN") == ["?34"]


def test_a_paused_move_sends_the_name_where_it_ends_and_not_where_it_pauses():
    device = drive("PG 1", "LB G1", "MA 100000,1", "H", 'PR "x"', "E", "PG", "EX G1")
    device.advance(0.2)
    assert say(device, "PS", 1.0) == [] and printed(device) == ""
    assert say(device, "RS", 3.0, "PR P") == ["100000"]
    assert printed(device) == "!\r\nx\r\n"


@pytest.mark.parametrize("after", [0.1, 0.2, 0.4])
def test_a_paused_move_that_runs_on_sends_the_name_once_where_it_passes_its_target(after):
    device = drive("PG 1", "LB G1", "MA 51200,1,1", "H 9000", "E", "PG", "EX G1")
    device.advance(after)
    say(device, "PS", 2.0)
    passed = device.position(device.now) >= 51200
    assert (printed(device) == "!\r\n") == passed
    assert say(device, "RS", "PR MP") == [str(1 - passed)]
    assert say(device, 3.0, "PR MP", "PR V") == ["0", "768000"]
    assert printed(device) == ("" if passed else "!\r\n")
