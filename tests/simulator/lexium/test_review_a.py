"""The simulated drive's words from A to LK, and operators, where a reading of the manual's section 5 found it wrong."""

import pytest

from simulator.cell.spec import DriveSpec, WorldSpec
from simulator.lexium.device import MCodeDevice
from simulator.world import World


def drive(personality="LMDCM", **spec):
    spec.setdefault("world", WorldSpec())
    device = MCodeDevice(DriveSpec(personality=personality, **spec), World(spec["world"]))
    device.prints()
    return device


def say(device, *lines):
    """Carry lines out, or let so many seconds pass; what was printed, and the code of each refusal as `?code`."""
    out = []
    for line in lines:
        if not isinstance(line, str):
            device.advance(device.now + line)
            out += "".join(text for _, text in device.prints()).split()
            continue
        answer = device.execute(line, device.now)
        out += answer.lines
        if answer.refused:
            out.append(f"?{device.memory.values['ER']}")
            device.clear_error()
    return out


@pytest.mark.parametrize(
    ("condition", "holds"),
    [("AF&128", True), ("AF&2", False), ("Q1", True), ("Q1&2", False), ("Q1-25", False), ("I1", False), ("F1", True)],
)
@pytest.mark.parametrize("word", ["BR", "CL"])
def test_a_condition_may_be_a_value_that_holds_while_it_is_not_0(word, condition, holds):
    device = drive()
    program = [f"{word} X1,{condition}", 'PR "n"', "E", "LB X1", 'PR "y"', "E"]
    assert say(device, "VA Q1=25", "F1=0.5", "PG 1", *program, "PG", "EX 1", 1.0) == ["y" if holds else "n"]


def test_a_text_is_no_condition():
    assert say(drive(), "PG 1", 'BR X1,"a"', 'CL X1,"a"=1', "PG") == ["?24", "?24"]


def test_the_type_of_homing_may_stand_behind_an_equals_sign():
    device = drive()
    assert say(device, "IS=1,1,0", "HM=3", "PR MV") == ["1"]
    assert say(drive(), "HI=1", "PR MV") == say(drive(), "HF=1", "PR MV") == ["1"]
    assert say(drive(), "HM=5", "HI=0", "HF=") == ["?81"] * 3


def test_microsteps_are_at_least_two_for_each_count_of_the_encoder():
    device = drive("LMM")
    assert say(device, "EL=512", "EE=1", "MS=16", "MS=25", "PR MS") == ["?36", "25"]
    assert say(device, "EL=1000", "PR EL", "EL=500", "PR EL") == ["?36", "512", "500"]
    assert say(device, "EL=2001", "EL=0") == ["?21", "?21"]


def test_the_encoder_is_not_enabled_while_microsteps_are_too_coarse_for_it():
    device = drive("LMM")
    assert say(device, "MS=32", "EE=1", "PR EE") == ["?36", "0"]
    assert say(device, "SA=0.9", "EE=1", "PR EE", "SA=1.8", "PR SA") == ["1", "?36", "0.900000"]


def test_a_program_space_that_is_open_already_may_be_opened():
    device = drive()
    assert say(device, "LK=1", "S", "LK=0", "CP", "LK=0", "PR LK") == ["?44", "0"]


def test_a_name_without_quotation_marks_is_error_21_whatever_it_is():
    assert say(drive(), "DN=a", "DN=7", "DN=!", "DN=#", "DN=-", 'DN="!"', "PR DN") == ["?21"] * 6 + ['"!"']


def test_dn_alone_is_a_variable_that_cannot_be_executed():
    assert say(drive(), "DN") == ["?34"]


@pytest.mark.parametrize("word", ["FT", "PK", "I7", "I13"])
def test_a_reserved_word_is_illegal_as_a_variable_and_as_a_label(word):
    device = drive()
    lines = [f"{word}=5", f"VA {word}", f"R1={word}", f"IC {word}", f"EX {word}"]
    assert say(device, *lines, "PG 1", f"LB {word}", "PG") == ["?24"] * 6


def test_the_names_of_functions_are_free_where_there_are_none():
    device = drive("MDI")
    assert say(device, "VA PI=7", "VA SI=3", "R1=PI", "PR R1", "R1=SI+1", "PR R1", "R1=SI -1", "PR R1") == [
        "7",
        "4",
        "2",
    ]
    assert say(device, "R1=SQ 4", "R1=2+AB R1") == ["?24", "?24"]


def test_a_condition_divides_whole_numbers_where_there_is_no_floating_point():
    program = ["BR AA,F1/2=3", 'PR "n"', "E", "LB AA", 'PR "y"', "E"]
    assert say(drive("MDI"), "VA F1=7", "PG 1", *program, "PG", "EX 1", 1.0) == ["y"]


def test_the_attention_output_tells_the_holding_current_from_the_running_one():
    device = drive()
    say(device, "HT=200", "MT=100", "AO=512", "OS=1,29,0", "MR 51200", 0.1)
    assert not device.outputs(device.now)[1]
    device.advance(device.axis.profile.end + 0.29)
    assert not device.outputs(device.now)[1]
    device.advance(device.now + 0.02)
    assert device.outputs(device.now)[1]
    say(device, "SL 1000", 1.0, "SL 0", 0.1)
    assert not device.outputs(device.now)[1]
    say(device, 1.0)
    assert device.outputs(device.now)[1]
    say(device, "DE=0")
    assert not device.outputs(device.now)[1]


def test_without_any_delay_the_current_stays_what_it_was_in_motion():
    device = drive()
    say(device, "HT=0", "MT=0", "AO=512", "OS=1,29,0", "MR 100", 5.0)
    assert not device.outputs(device.now)[1]


@pytest.mark.parametrize("at", ["1", "3"])
def test_a_label_goes_with_the_line_that_is_stored_over_it(at):
    device = drive()
    say(device, "PG 1", "LB G1", "E", "PG", f"PG {at}", "E", "PG")
    assert say(device, "EX G1", "PR UV", "OE G1") == ["?30", "", "?30"]
    assert say(device, "PG 20", "LB G1", 'PR "g"', "E", "PG", "EX G1", 1.0) == ["g"]


def test_a_program_cannot_have_a_label_and_a_variable_of_one_name():
    assert say(drive(), "PG 1", "VA L1=3", "LB L1", "E", "PG") == ["?28"]
    assert say(drive(), "PG 1", "LB L1", "VA L1=3", "E", "PG") == ["?28"]


def test_backlash_is_made_up_for_in_a_move_against_the_slew_before_it():
    device = drive()
    lines = ["BE=1", "BL=1000", "SL -10000", 1.0, "SL 0", 1.0, "P=0"]
    assert say(device, *lines, "MR 5000", 2.0, "PR P", "MR 5000", 2.0, "PR P") == ["6000", "11000"]


def test_a_move_that_is_refused_takes_up_no_backlash():
    device = drive()
    say(device, "BE=1", "BL=1000", "MR 5000", 2.0, "A=1100000000", "AT=2")
    assert say(device, "MR -5000", "AT=1", "A=1000000", "MR -5000", 2.0, "PR P") == ["?98", "-1000"]


def test_all_parameters_include_the_trips():
    device = drive()
    say(device, "PG 1", "LB T1", "RT", "PG", "TI=2,T1", "TC=T1")
    rows = say(device, "PR AL")
    assert {"TI = 2, T1", "TC = T1", "TP = 0", "TE = 0"} <= set(rows)
    assert sorted(rows) == rows[-1:] + rows[:-1] and rows[-1] == ""
