"""Enabled or disabled, supply, temperature, and the configuration test."""

from __future__ import annotations

import pytest

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from tests.support.lexium import at, codes, drive, printed_lines, run, say


@pytest.mark.parametrize("word", ["HM 1", "HI 1", "HF 1", "MA 1", "MR 1", "SL 1"])
def test_a_disabled_drive_refuses_every_motion_with_94(word):
    assert say(drive("DE=0"), word, "PR MV") == ["?94", "0"]


def test_without_its_supply_homing_is_refused_before_the_switch_is_looked_for():
    device = drive()
    device.supply(False, 0.0)
    assert say(device, "HM 1") == ["?96"]
    device.supply(True, 0.0)
    assert say(device, "HM 1", "HM 7") == ["?80", "?81"]


def test_the_configuration_test_turns_half_a_turn_and_is_no_variable():
    device = drive()
    assert say(device, "SC", "SC=", "SC 0", "SC 2", "SC 1,1", "PR SC", "PR MV") == [
        "?24", "?24", "?21", "?21", "?24", "?35", "0",
    ]  # fmt: skip
    assert say(device, "SC 1", "SC 1", "MR 5") == ["?89", "?88"]
    assert at(device, 2, "P", "C2", "ER") == ["25600", "2000", "0"]
    device = drive("SC 1", stall_at=5000.0)
    assert at(device, 2, "ER") == ["100"]
    assert say(drive("DE=0"), "SC 1") == ["?103"]


def test_every_product_prints_its_version_as_the_manuals_do():
    assert say(drive(personality="LMM"), "PR VR", "PR PN") == ["LMMCM 6.002, Hw: 3.2", "LMMCM15"]
    assert say(drive(), "PR VR", "PR PN") == ["LMDCM 6.002, Hw: 3.2", "LMDCM571"]


def test_voltages_are_printed_behind_their_status():
    assert say(drive(), "PR VT", "PR VT,1", "PR VT 2", "PR VT,3") == ["0, 12, 24", "0, 12", "0, 24", "?21"]
    assert say(drive(personality="LMM"), "PR VT", "PR VT,2", "PR VT,1") == ["1, 24", "1, 24", "?37"]


def test_a_temperature_above_the_warning_is_told():
    device = drive("WT=20")
    assert at(device, 1, "ER", "WT") == ["71", "20"]


@pytest.mark.parametrize(("personality", "found"), [("LMDCM", "0, 12"), ("LMM", "?37")])
def test_the_auxiliary_supply_is_read_where_there_is_one(personality, found):
    device = drive(personality=personality)
    assert say(device, "PR VT,1", "PR VT,3") == [found, "?21"]


def test_no_move_begins_during_the_configuration_test():
    device = drive("SC 1")
    assert say(device, 0.1, "MR 5", "SL 5", "MA 0", "HM 1", 5.0, "PR P", "MR 5") == [
        "?88",
        "?88",
        "?88",
        "?80",
        "25600",
    ]


# S, IP and FD: what is kept, taken back and forgotten.


def test_after_factory_defaults_parameters_are_initialized_to_those() -> None:
    device = drive("VM=500000", "S", "FD", "VM=400000", "PF=5,2,0,0", "HC=50", "LK=1", "F1=2", "IP")
    assert say(device, "PR VM", "PR PF", "PR HC", "PR LK", "PR F1") == ["768000", "10,6,0,0", "5", "0", "0.000000"]


@pytest.mark.parametrize("word, personality", [("FS", "LMDCM"), ("FS", "LMM"), ("PW", "LMM")])
def test_factory_defaults_keep_what_was_saved_of_settings_of_the_motor(word: str, personality: str) -> None:
    value = "77" if word == "FS" else "1,2,3,4"
    device = drive(f"{word}={value}", "S", "FD", personality=personality)
    assert say(device, f"PR {word}") == [value]
    assert say(device, "IP", f"PR {word}") == [value]


def test_initializing_parameters_turns_the_encoder_on_without_an_error_of_position() -> None:
    device = drive("EE=1", "PM=1", "S", "EE=0", "MR 20000", stall_at=5000)
    device.advance(2)
    say(device, "IP")
    device.world.push(-100, 2)
    assert at(device, 10, "EE", "P", "ER") == ["1", "391", "0"]


def test_initializing_parameters_ends_a_calibration_with_the_mode_that_asked_for_it() -> None:
    device = drive("AS=1", "IP", "MR 100")
    assert at(device, 1, "AS", "P") == ["0", "100"]


def test_initializing_parameters_to_hmt_calibrates() -> None:
    device = drive("AS=1", "S", "AS=0", "IP")
    assert codes(device, "MR 100") == [88]
    device.advance(1)
    assert codes(device, "MR 100") == [0]
    assert at(device, 2, "P") == ["100"]


@pytest.mark.parametrize("move", ["MA 100000", "MR -100000"])
def test_nothing_is_saved_during_a_move(move):
    device = drive("RC=50", "S", "RC=60", move)
    assert say(device, "S") == ["?73"]
    device.advance(2)
    assert say(device, "IP", "PR RC", "RC=60", "S", "IP", "PR RC") == ["50", "60"]


def test_a_drive_that_is_saved_disabled_comes_up_disabled():
    device = drive("DE=0", "S")
    device.power(False, 1)
    device.power(True, 2)
    assert say(device, "PR DE", "MR 100", "DE=1", "MR 100") == ["0", "?94"]
    device.reset(3)
    assert say(device, "PR DE", "FD", "PR DE") == ["0", "1"]


def test_initializing_restores_the_saved_enable():
    device = drive("DE=0")
    assert say(device, "IP", "PR DE", "MR 100") == ["1"]


def test_cleared_programs_and_new_values_are_back_after_a_reset_unless_they_are_saved():
    device = drive("VA Q1=5", program='PG 1\nLB G1\nPR "here"\nE\nPG')
    say(device, "S", "CP", "Q1=9", "VA Q2=1")
    device.reset(1.0)
    assert say(device, "L G1", "PR UV") == ["1  LB G1", '6  PR "here"', "14  E", "G1 = 1", "Q1 = G 5", ""]
    say(device, "CP", "S")
    device.reset(2.0)
    assert say(device, "L", "PR Q1") == ["5"]
    assert say(device, "FD", "PR UV") == [""]


# Program memory: addresses, labels, locks, trace.


@pytest.mark.parametrize("address", ["1.5", "10.0", "1e2", "0", "-1", "6385"])
def test_program_mode_begins_at_a_whole_address_only(address):
    device = drive()
    assert say(device, f"PG {address}", "PR P") == ["?42", "0"]


PROGRAM = "PG 1\nLB G1\nMR 5\nE\nPG"


@pytest.mark.parametrize("line", ["EX G1,1", "EX G1,2", "BP G1,1", "BP"])
def test_a_locked_program_is_not_shown_line_by_line(line):
    device = drive("LK=1", program=PROGRAM)
    assert say(device, line, "BP=0") == ["?44"]
    assert say(device, "EX G1") == []
    assert printed_lines(device, 1.0) == []
    assert say(device, "PR P") == ["5"]


def test_a_trace_ends_where_the_program_locks_itself():
    device = drive(program="PG 1\nLB G1\nLK=1\nMR 5\nE\nPG")
    assert say(device, "EX G1,1") == []
    assert printed_lines(device, 1.0) == ["6  LK=1"]
    assert say(device, "PR P") == ["5"]


def test_a_program_space_that_is_open_already_may_be_opened():
    device = drive()
    assert run(device, "LK=1", "S", "LK=0", "CP", "LK=0", "PR LK") == ["?44", "0"]


@pytest.mark.parametrize("at", ["1", "3"])
def test_a_label_goes_with_the_line_that_is_stored_over_it(at):
    device = drive()
    run(device, "PG 1", "LB G1", "E", "PG", f"PG {at}", "E", "PG")
    assert run(device, "EX G1", "PR UV", "OE G1") == ["?30", "", "?30"]
    assert run(device, "PG 20", "LB G1", 'PR "g"', "E", "PG", "EX G1", 1.0) == ["g"]


def test_a_program_cannot_have_a_label_and_a_variable_of_one_name():
    assert run(drive(), "PG 1", "VA L1=3", "LB L1", "E", "PG") == ["?28"]
    assert run(drive(), "PG 1", "LB L1", "VA L1=3", "E", "PG") == ["?28"]


# Settings: printed defaults, ranges, products that lack them, values from a cell.


def equipped(settings: str, inputs: str) -> MCodeDevice:
    """A drive of a cell file with settings, and levels on inputs from the start."""
    head = '[[bus]]\nname = "b"\n[[bus.drive]]\npersonality = "LMDCM"\nname = "q"\n'
    text = f"{head}set = {{ {settings} }}\nworld = {{ inputs = {inputs} }}\n"
    device = Floor(read(text, "cell.toml")).drives[0].device
    assert isinstance(device, MCodeDevice)
    return device


@pytest.mark.parametrize("level", [0, 1])
def test_a_cell_may_set_up_an_active_input_as_a_reset(level: int) -> None:
    device = equipped(f'VM = 5000, IS = ["1,11,{level}"], VI = 77', f"[[0.0, 1, {level}]]")
    assert say(device, "PR VM", "PR VI", "PR DN") == ["5000", "77", '"q"']
    assert say(device, "PR IS")[0] == f"IS = 1, 11, {level}"


def test_a_cell_may_set_up_an_active_jog_and_what_is_not_changed_on_the_move() -> None:
    device = equipped('JE = 1, IS = ["1,7,0"], RD = 1, AS = 1', "[[0.0, 1, 0]]")
    assert say(device, "PR RD", "PR AS", "PR MV") == ["1", "1", "0"]


def test_a_cell_may_set_torque_mode_before_what_is_not_changed_on_the_move() -> None:
    device = equipped("AS = 3, TS = 60000, RD = 1", "[]")
    assert at(device, 1, "AS", "RD", "MV") == ["3", "1", "1"]


@pytest.mark.parametrize(
    ("word", "default", "good", "bad"),
    [
        ("QD", "0", ("1", "0"), ("2", "-1")),
        ("R4", "0", ("2147483647", "-2147483648", "12345"), ("2147483648", "-2147483649", "12345678901")),
        ("RA", "1", ("0", "1"), ("2", "-1")),
        ("RC", "25", ("1", "75", "100"), ("0", "101")),
        ("RD", "0", ("1", "0"), ("2", "-1")),
        ("SF", "15", ("0", "20", "65000"), ("-1", "65001")),
        ("SM", "0", ("1", "0"), ("2", "-1")),
        ("TD", "1", ("0", "1"), ("2", "-1")),
        ("TQ", "25", ("1", "50", "100"), ("0", "101")),
        ("TS", "0", ("46512", "51200", "2560000"), ("46511", "2560001", "0")),
        ("VF", "0", ("0", "500", "1000"), ("-1", "1001")),
        ("WT", "80", ("0", "75", "84"), ("-1", "85")),
    ],
)
def test_a_setting_has_the_printed_default_and_range_and_keeps_its_value_when_refused(word, default, good, bad):
    device = drive()
    assert say(device, f"PR {word}") == [default]
    for value in good:
        assert say(device, f"{word}={value}", f"PR {word}", f"{word} {value}", f"pr {word}") == [value, value]
    for value in bad:
        assert say(device, f"{word}={value}", f"PR {word}") == ["?21", good[-1]]
    nonsense = [word, f"{word}=", f"{word}=1,2", f"{word}=1 2", f'{word}="1"', f"{word}=Q9"]
    assert say(device, *nonsense, f"PR {word}") == ["?34", "?24", "?24", "?38", "?21", "?30", good[-1]]


@pytest.mark.parametrize("word", ["SF", "SM", "ST", "TA", "TD", "TQ", "TS", "VF"])
def test_an_open_loop_drive_lacks_encoder_and_hmt(word):
    assert say(drive(personality="LMDOM"), f"PR {word}", f"{word}=1", f"IC {word}") == ["?37"] * 3


def test_the_queue_is_for_serial_drives_and_the_step_angle_for_the_module():
    assert say(drive(personality="LMDOE"), "QD=1", "PR QD") == ["?37", "?37"]
    assert say(drive(), "SA=0.9", "PR SA") == ["?37", "?37"]
    assert say(drive(personality="LMM"), "SC 1", "TQ=5") == ["?37", "?37"]


@pytest.mark.parametrize("word", ["ER", "ST", "IF"])
def test_what_may_be_cleared_is_not_read_only_but_is_not_stepped(word):
    assert say(drive(), f"IC {word}", f"DC {word}", f"{word}=0") == ["?26", "?26"]
    assert say(drive(), "IC V", "IC VC", "IC VR") == ["?25"] * 3
