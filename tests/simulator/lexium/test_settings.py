"""Settings: printed defaults, ranges, products that lack them, values from a cell."""

import pytest

from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.lexium.device import MCodeDevice
from tests.support.lexium import at, drive, say


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
