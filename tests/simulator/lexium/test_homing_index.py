"""Homing to the mark of the encoder."""

import pytest

from tests.support.lexium import at, drive, say


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
