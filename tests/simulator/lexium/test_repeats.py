"""Motion begun again: moves of nothing, the motion mode, bare numbers."""

import pytest

from tests.support.lexium import drive, printed_lines, say


@pytest.mark.parametrize("word", ["MR", "MA"])
def test_a_move_of_nothing_that_runs_on_goes_nowhere(word):
    device = drive()
    assert say(device, f"{word} 0,1,1") == []
    assert printed_lines(device, 1.0) == ["!"]
    assert say(device, "PR MV", "PR P") == ["0", "0"]


@pytest.mark.parametrize("velocity", [100000, -100000])
def test_a_move_of_nothing_that_runs_on_while_moving_keeps_its_direction(velocity):
    device = drive("VM=50000", f"SL {velocity}")
    device.advance(1.0)
    assert say(device, "MR 0,0,1") == []
    device.advance(2.0)
    assert say(device, "PR V") == [str(velocity // 2)]


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


def test_every_motion_that_a_line_begins_is_counted():
    device = drive("NE=1", "MR 500")
    assert say(device, 1.0, "500", 1.0, "SC 1", 3.0, "HF 1", 100.0, "SL 500", "SL 0", 1.0, "0") == []
    assert device.language.motions.begun == 5
