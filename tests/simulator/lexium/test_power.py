"""Enabled or disabled, supply, temperature, and the configuration test."""

import pytest

from tests.support.lexium import at, drive, say


@pytest.mark.parametrize("word", ["HM 1", "HI 1", "HF 1", "MA 1", "MR 1", "SL 1"])
def test_a_disabled_drive_refuses_every_motion_with_94(word):
    assert say(drive("DE=0"), word, "PR MV") == ["?94", "0"]


def test_without_its_supply_homing_is_refused_before_the_switch_is_looked_for():
    device = drive()
    device.supply(False, 0.0)
    assert say(device, "HM 1") == ["?96"]
    device.supply(True, 0.0)
    assert say(device, "HM 1", "HM 7") == ["?80", "?81"]


def test_the_configuration_test_turns_half_a_turn_and_is_no_variable():
    device = drive()
    assert say(device, "SC", "SC=", "SC 0", "SC 2", "SC 1,1", "PR SC", "PR MV") == [
        "?24", "?24", "?21", "?21", "?24", "?35", "0",
    ]  # fmt: skip
    assert say(device, "SC 1", "SC 1", "MR 5") == ["?89", "?88"]
    assert at(device, 2, "P", "C2", "ER") == ["25600", "2000", "0"]
    device = drive("SC 1", stall_at=5000.0)
    assert at(device, 2, "ER") == ["100"]
    assert say(drive("DE=0"), "SC 1") == ["?103"]


def test_voltages_are_printed_behind_their_status():
    assert say(drive(), "PR VT", "PR VT,1", "PR VT 2", "PR VT,3") == ["0, 12, 24", "0, 12", "0, 24", "?21"]
    assert say(drive(personality="LMM"), "PR VT", "PR VT,2", "PR VT,1") == ["1, 24", "1, 24", "?37"]


def test_a_temperature_above_the_warning_is_told():
    device = drive("WT=20")
    assert at(device, 1, "ER", "WT") == ["71", "20"]


@pytest.mark.parametrize(("personality", "found"), [("LMDCM", "0, 12"), ("LMM", "?37")])
def test_the_auxiliary_supply_is_read_where_there_is_one(personality, found):
    device = drive(personality=personality)
    assert say(device, "PR VT,1", "PR VT,3") == [found, "?21"]


def test_no_move_begins_during_the_configuration_test():
    device = drive("SC 1")
    assert say(device, 0.1, "MR 5", "SL 5", "MA 0", "HM 1", 5.0, "PR P", "MR 5") == [
        "?88",
        "?88",
        "?88",
        "?80",
        "25600",
    ]
