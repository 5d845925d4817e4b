"""Jog inputs: when a jog begins, ends and is taken up."""

import pytest

from tests.support.lexium import at, drive, say


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
