"""S, IP and FD: what is kept, taken back and forgotten."""

import pytest

from multidrop.simulator.lexium.device import MCodeDevice
from tests.support.lexium import at, drive, say


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


def codes(device: MCodeDevice, *lines: str) -> list[int]:
    """The error of each line, 0 for one that is taken; works in program mode too."""
    found = []
    for line in lines:
        refused = device.execute(line, device.now).refused
        found.append(int(device.memory.values["ER"]) if refused else 0)
        device.errors.clear()
    return found


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
