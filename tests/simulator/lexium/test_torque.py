"""Torque mode of hMT: how it begins, stops and stands."""

import pytest

from tests.support.lexium import at, drive, say


def test_control_bounds_are_the_tightest_in_torque_mode_and_cannot_be_changed_there():
    device = drive("CB=2", "AS=3")
    assert say(device, "PR CB", "CB=3", "CB=0", "PR EF", "AS=0", "PR CB") == ["0", "?21", "0", "2"]


TORQUE = ("TS=51200", "TQ=50", "AS=3")


def soft_stop(device):
    device.world.set_input(1, 0, device.now)
    device.advance(device.now)


@pytest.mark.parametrize(
    ("stop", "code", "slowed"),
    [
        (lambda device: device.escape(device.now), "0", 0.0),
        (lambda device: say(device, "SL 0"), "0", 0.2),
        (lambda device: say(device, "NE=1", "SL 0", "0"), "0", 0.2),
        (soft_stop, "91", 0.2),
    ],
    ids=["escape", "slew 0", "a bare 0", "soft stop"],
)
def test_torque_mode_stops_and_stands_until_it_is_set_again(stop, code, slowed):
    device = drive("IS=1,5,0", *TORQUE)
    assert at(device, 1, "AV", "V") == ["51200", "0"]
    stop(device)
    assert at(device, 1 + slowed, "AV", "MV", "AS") == ["0", "0", "3"]
    assert at(device, 3, "AV", "V", "ER") == ["0", "0", code]
    assert say(device, "TS=60000", "TD=0", "PR AV") == ["0"]
    say(device, "AS=3")
    assert at(device, 4, "AV") == ["-60000"]
