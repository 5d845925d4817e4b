"""The commands EF to LK of the manual's section 5 on a simulated drive."""

import pytest

from simulator.cells import read
from simulator.floor import Floor
from simulator.lexium.device import MCodeDevice
from tests.support.moving import at, drive, say


def codes(device: MCodeDevice, *lines: str) -> list[int]:
    """The error of each line, 0 for one that is taken; works in program mode too."""
    found = []
    for line in lines:
        refused = device.execute(line, device.now).refused
        found.append(int(device.memory.values["ER"]) if refused else 0)
        device.clear_error()
    return found


# IP and FD (5.1.45, 5.1.63).


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


# Jog, and inputs that are set up while they are active (5.1.64, 5.1.69).


def test_a_jog_ends_when_its_input_is_no_jog_input_any_more() -> None:
    device = drive("IS=1,7,0", "JE=1", inputs=[[1.0, 1, 0]])
    assert at(device, 2.5, "V") == ["768000"]
    say(device, "IS=1,0,0")
    assert at(device, 4, "V", "MV") == ["0", "0"]


def test_a_jog_ends_when_its_input_becomes_a_clock_by_the_other_one() -> None:
    device = drive("IS=3,8,0", "JE=1", inputs=[[1.0, 3, 0]])
    assert at(device, 2.5, "V") == ["-768000"]
    say(device, "IS=4,13,0")
    assert at(device, 4, "V", "MV") == ["0", "0"]


def test_a_jog_of_an_mdriveplus_ends_with_its_point() -> None:
    device = drive("S1=7,0", "JE=1", personality="MDI", inputs=[[1.0, 1, 0]])
    assert at(device, 2.5, "MV") == ["1"]
    say(device, "S1=16,0")
    assert at(device, 4, "MV") == ["0"]


def test_an_active_input_turns_as_soon_as_it_is_a_jog_input() -> None:
    device = drive("JE=1", inputs=[[0.5, 2, 0]])
    device.advance(1)
    say(device, "IS=2,8,0")
    assert at(device, 2.5, "V") == ["-768000"]


def test_setting_up_another_input_does_not_begin_a_jog_that_was_passed_over() -> None:
    device = drive("IS=1,7,0", "JE=1", "MR 100000", inputs=[[0.1, 1, 0]])
    device.advance(5)
    say(device, "IS=2,1,0")
    assert at(device, 6, "P", "MV") == ["100000", "0"]


def test_jog_is_enabled_though_the_drive_is_disabled() -> None:
    device = drive("IS=1,7,0", "DE=0", inputs=[[0.5, 1, 0]])
    device.advance(1)
    assert not device.execute("JE=1", 1.0).refused
    assert say(device, "PR JE", "PR ER", "PR MV") == ["1", "94", "0"]


@pytest.mark.parametrize("before", ["IS=1,0,1", "IS=1,0,0"])
def test_a_reset_input_that_is_active_when_it_is_set_up_resets_the_drive(before: str) -> None:
    device = drive(before, "VM=5000", inputs=[[0.1, 1, 1]])
    device.advance(1)
    say(device, "IS=1,11,1")
    assert at(device, 1.1, "VM") == ["768000"]


def test_a_stop_input_that_is_active_when_it_is_set_up_stops_the_motor() -> None:
    device = drive("SL 50000", inputs=[[0.5, 1, 0]])
    device.advance(1)
    say(device, "IS=1,5,0")
    assert at(device, 2, "MV", "ER") == ["0", "91"]


# LD and LG (5.1.72, 5.1.73).


def test_without_lead_and_lag_no_limit_of_them_is_reached() -> None:
    device = drive("LD=0", "LG=0", "AS=1")
    assert at(device, 1, "AF", "LL", "ER") == ["128", "0", "0"]


# FL (5.1.46).

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


@pytest.mark.parametrize("release", ["input", "JE=0"])
def test_a_jog_that_ends_in_a_pause_is_not_taken_up(release: str) -> None:
    ends = [[3.0, 1, 1]] if release == "input" else []
    device = drive("IS=1,7,0", "JE=1", program="PG 1\nLB G1\nH 60000\nPG", inputs=[[0.5, 1, 0], *ends])
    say(device, "EX G1")
    device.advance(2)
    say(device, "PS")
    device.advance(3.5)
    if release != "input":
        say(device, release)
    say(device, "RS")
    assert at(device, 5, "V", "BY", "ER") == ["0", "1", "0"]


def test_a_jog_that_lasts_through_a_pause_is_taken_up() -> None:
    device = drive("IS=1,7,0", "JE=1", program="PG 1\nLB G1\nH 60000\nPG", inputs=[[0.5, 1, 0], [6.0, 1, 1]])
    say(device, "EX G1")
    device.advance(2)
    say(device, "PS")
    device.advance(3.5)
    say(device, "RS")
    assert at(device, 5, "V") == ["768000"]
    assert at(device, 8, "V") == ["0"]


def test_initializing_parameters_ends_a_calibration_with_the_mode_that_asked_for_it() -> None:
    device = drive("AS=1", "IP", "MR 100")
    assert at(device, 1, "AS", "P") == ["0", "100"]


def test_initializing_parameters_to_hmt_calibrates() -> None:
    device = drive("AS=1", "S", "AS=0", "IP")
    assert codes(device, "MR 100") == [88]
    device.advance(1)
    assert codes(device, "MR 100") == [0]
    assert at(device, 2, "P") == ["100"]


@pytest.mark.parametrize("level", [0, 1])
def test_a_program_that_resets_its_drive_by_an_active_input_does_so_until_that_is_let_go(level: int) -> None:
    program = f"PG 1\nLB SU\nIS=1,11,{level}\nPR I1\nPG"
    device = drive(program=program, inputs=[[0.5, 1, level], [1.0, 1, 1 - level]])
    device.advance(0.75)
    assert device.boots > 10
    device.advance(2)
    before = device.boots
    device.advance(3)
    assert (device.boots, device.running) == (before, False)
    assert say(device, "PR IS")[0] == f"IS = 1, 11, {level}"


# HM (5.1.54).

SWITCHED = ("IS=1,1,0", "IS=2,2,0", "IS=3,3,0", "VI=20000", "VM=200000")


@pytest.mark.parametrize("mode", ["LM=1", "LM=4"])
def test_a_limit_that_is_met_while_a_pause_slows_homing_down_turns_it_round(mode: str) -> None:
    program = "PG 1\nLB G1\nHM 4\nH\nPR P\nPG"
    device = drive(*SWITCHED, mode, program=program, home=-7924, limit_plus=100000, limit_minus=-300000)
    say(device, "EX G1")
    device.advance(0.58)
    say(device, "PS")
    assert at(device, 1, "MV", "I2", "BY") == ["0", "1", "1"]
    assert codes(device, "RS") == [0]
    device.advance(20)
    assert [text for _, text in device.prints()] == ["-7923\r\n"]


def test_homing_that_was_turned_round_and_is_paused_on_the_other_limit_has_failed() -> None:
    program = "PG 1\nLB G1\nHM 3\nH\nPG"
    device = drive(*SWITCHED, program=program, home=-900000, limit_plus=50000, limit_minus=-50000)
    say(device, "EX G1")
    device.advance(0.5)
    while device.position(device.now) > -45000:
        device.advance(device.now + 0.01)
    say(device, "PS")
    device.advance(device.now + 1)
    assert say(device, "PR MV", "PR I3", "PR BY") == ["0", "1", "1"]
    assert codes(device, "RS") == [82]


# What a cell file sets while inputs are active already.


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


# EX (5.1.42).


def test_a_variable_is_not_executed() -> None:
    device = drive("VA Q1=1", program="PG 1\nLB G1\nPG")
    assert codes(device, "EX Q1", "EX VM", "EX Q2", "EX 5", "EX G1") == [34, 34, 30, 42, 0]


# HI and HF (5.1.52, 5.1.53).


@pytest.mark.parametrize("mode", ["AS=0", "AS=1"])
@pytest.mark.parametrize("kind, mark", [(1, -1), (3, 1), (4, 2)])
@pytest.mark.parametrize("held", [(1.1, 1.3), (1.62, 1.8), (11.0, 11.5)])
def test_homing_ends_at_a_mark_whatever_has_held_the_rotor(
    mode: str, kind: int, mark: int, held: tuple[float, float]
) -> None:
    device = drive("VM=100000", "VI=5000", mode, "LT=60000", "LG=2000000", locked=[list(held)])
    device.advance(1)
    say(device, f"HI {kind}")
    assert at(device, 60, "MV", "I6", "ER") == ["0", "1", "0"]
    if mode == "AS=1":
        assert say(device, "PR P") == [str(51200 * mark)]


def test_homing_that_is_pushed_over_its_mark_ends_at_another_one() -> None:
    device = drive("VM=20000", "VI=5000", "FS=100")
    say(device, "HF 4")
    device.advance(1)
    device.world.push(51200, 1)
    assert at(device, 60, "MV", "C2", "ER") == ["0", str(8 + 2 * 4000), "0"]


def test_homing_finds_its_mark_after_a_change_of_resolution() -> None:
    device = drive("VM=20000", "VI=5000", "HI 4")
    device.advance(3.5)
    say(device, "MS=64")
    assert at(device, 60, "MV", "I6", "ER") == ["0", "1", "0"]
