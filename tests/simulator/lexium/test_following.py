"""Following a clock: trips, stalls, walls and locks on the way."""

import pytest

from tests.support.lexium import at, drive, say

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
