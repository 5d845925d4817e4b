"""Make-up of hMT: when, how fast, and where it ends."""

import pytest

from tests.support.lexium import at, drive, rotor, say


def closed(*lines, **world):
    """A drive with hMT on, calibrated."""
    device = drive("AS=1", *lines, **world)
    device.advance(0.1)
    return device


QUICK = ("VM=300000", "LG=2000000", "LT=60000")


def test_steps_lost_at_velocity_are_made_up_at_vm():
    device = closed(*QUICK, locked=((0.5, 0.7),))
    say(device, "MA 200000")
    assert at(device, 0.9, "AV", "V") == ["300000", "165670"]


def test_steps_lost_while_slowing_down_are_made_up_at_vi():
    device = closed(*QUICK, locked=((0.9, 0.95),))
    say(device, "MA 200000")
    assert at(device, 1.0, "AV", "MV") == ["1000", "1"]
    assert at(device, 1.2, "AV", "P", "MV") == ["1000", "200000", "1"]
    assert at(device, 10.0, "LL") == ["4673"]
    assert at(device, 15.0, "LL", "MV", "ER") == ["0", "0", "0"] and rotor(device) == 200000


def test_the_next_motion_is_not_as_slow_as_the_make_up_that_it_takes_over():
    device = closed(*QUICK, locked=((0.9, 0.95),))
    say(device, "MA 200000")
    device.advance(1.2)
    say(device, "MA 400000")
    assert at(device, 1.7, "AV") == ["300000"]


def test_a_slew_that_is_faster_than_vm_is_not_slowed_by_what_it_has_lost():
    device = closed(*QUICK, locked=((0.9, 1.0),))
    say(device, "SL 500000")
    assert at(device, 2.0, "AV", "LL") == ["500000", "57429"]
    say(device, "SL 0")
    assert at(device, 6.0, "LL", "MV") == ["0", "0"]


@pytest.mark.parametrize("world", [{}, {"stall_at": 100}])
def test_lag_behind_a_command_that_has_yet_to_turn_round_is_made_up_on_its_way(world):
    device = closed("D=5000", "LG=2000000", "LT=60000", locked=((0.2, 0.5),), **world)
    say(device, "SL -20000")
    device.advance(0.4)
    say(device, "MA 400")
    assert int(at(device, 0.49, "LL")[0]) > 5000
    assert int(at(device, 0.503, "AV")[0]) < -19000
    assert at(device, 0.6, "LL", "AV") == ["0", "-19000"]
    device.advance(60.0)
    assert rotor(device) == world.get("stall_at", 400)


def test_a_rotor_that_was_pushed_ahead_waits_where_the_move_ends():
    device = closed("LD=2000000", "VM=20000", "VI=19000")
    say(device, "MA 40000", "VM=768000")
    device.advance(1.5)
    device.world.push(5000, 1.5)
    device.advance(1.5)
    assert at(device, 1.6, "AV") == ["0"] and rotor(device) == 40000
    assert at(device, 2.0, "P", "LL") == ["38000", "-2000"] and rotor(device) == 40000
    assert at(device, 3.0, "P", "LL", "MV") == ["40000", "0", "0"]


@pytest.mark.parametrize(("lines", "speed"), [(("MU=2",), "2560000"), (("MS=16", "MU=2"), "160000")])
def test_system_speed_is_3000_turns_a_minute_whatever_a_step_is(lines, speed):
    device = closed(*lines, "LG=2000000000", "LT=60000", locked=((0.2, 4.0),))
    say(device, "VM=100000", "SL 90000")
    assert at(device, 4.16, "AV") == [speed]


def test_twice_the_speed_is_not_faster_than_a_motor_can_turn():
    device = closed("MU=1", "VM=2000000", "LG=2000000000", "LT=60000", locked=((0.2, 2.2),))
    say(device, "MA 4000000")
    assert at(device, 2.4, "AV") == ["2560000"]
