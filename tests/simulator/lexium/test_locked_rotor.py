"""A rotor that is held with hMT: the bridges, the flag, and CF."""

import pytest

from tests.support.lexium import at, drive, rotor, say


def test_a_rotor_that_stands_at_tighter_bounds_that_are_set_is_locked_from_then_on():
    device = drive("AS=1", "CB=3", "LT=100")
    device.advance(0.1)
    device.world.hold(True)
    say(device, "MR 400")
    assert at(device, 1.0, "LR") == ["0"]
    say(device, "CB=2", "CB=0")
    assert at(device, 1.09, "LR") == ["0"]
    assert at(device, 1.11, "LR", "ER") == ["1", "104"]


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


def test_a_rotor_that_was_locked_in_torque_mode_can_be_moved_afterwards():
    device = drive("LT=100", "TS=51200", "AS=3", locked=((0.3, 1.0),))
    device.advance(2.0)
    assert say(device, "PR LR", "PR ER", "AS=0", 1.0, "MR 500", 1.0, "PR MV", "PR LR") == ["1", "104", "0", "1"]
    assert say(device, "CF", "PR LR") == ["0"]


def test_a_rotor_that_was_locked_otherwise_keeps_the_bridges_off_until_it_is_cleared():
    device = drive("LT=100", "AS=1", locked=((0.3, 1.0),))
    assert say(device, 0.1, "MR 200000", 1.0, "PR LR", "PR ER", "MR 5", "AS=0", "MR 5") == ["1", "104", "?94", "?94"]
    assert say(device, "CF", "MR 5") == []


@pytest.mark.parametrize("mode", [1, 2])
def test_a_locked_rotor_switches_the_bridges_off_until_cf(mode):
    device = drive(f"AS={mode}", "LT=500", stall_at=50000)
    device.advance(0.1)
    say(device, "MA 100000")
    assert at(device, 3.0, "ER", "LR", "MV") == ["104", "1", "0"]
    assert say(device, "MR -100", "DE=0", "DE=1", "MR -100") == ["?94", "?94"]
    assert say(device, "CF", "PR LR", "MR -100") == ["0"]
    assert rotor(device) == 50000 and at(device, 4.0, "LR") and rotor(device) == 49900


def test_in_torque_mode_a_locked_rotor_is_a_flag_and_it_turns_again():
    device = drive("TQ=50", "TS=100000", "LT=500", "AS=3", locked=((1.0, 4.0),))
    assert at(device, 2.0, "LR", "ER", "AV") == ["1", "104", "0"]
    assert abs(int(at(device, 5.0, "AV")[0])) == 100000
