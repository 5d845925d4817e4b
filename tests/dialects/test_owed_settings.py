"""What a certificate's questions leave in a drive: restored in this very drive only, and said."""

from __future__ import annotations

from dataclasses import replace

import pytest

from multidrop.base.errors import NoAnswer, Refused
from multidrop.dialects import DriveState
from multidrop.dialects.certifying import Occupied
from multidrop.dialects.owed_settings import owed, repaired
from multidrop.families.lexium.host.mcode.codec import MCode

LINES = ("EM=1", "CK=0")


def drive(serial: str = "12") -> DriveState:
    return DriveState(MCode(), name="a", product="LMDCM", version="6", part="p", serial=serial)


def repair(state, left, fails=None):
    """Repair a drive; return the lines that were sent."""
    sent = []

    def perform(line):
        sent.append(line)
        if line == "CK=0" and fails is not None:
            raise fails
        yield from ()
        return ()

    for _ in repaired(state, left, perform):
        raise AssertionError
    return sent


@pytest.mark.parametrize("serial", ["12", ""])
def test_the_settings_are_restored_in_their_order_and_nothing_is_owed_any_more(serial):
    state = drive()
    assert repair(state, [owed(drive(serial), LINES)]) == [*LINES] and state.restore is None
    assert state.notes == ["an interrupted certificate left other settings; restored: EM=1, CK=0"]


@pytest.mark.parametrize(
    "other",
    [owed(drive("13"), LINES), replace(owed(drive(), LINES), name="b"), replace(owed(drive(), ()), em=1)],
)
def test_another_drive_and_an_echo_mode_of_a_download_are_left_alone(other):
    assert repair(drive(), [other]) == []


def test_a_refusal_is_noted_and_a_drive_without_a_reply_is_owed_on():
    state = drive()
    assert repair(state, [owed(drive(), LINES)], Refused("error 33")) == [*LINES] and state.restore is None
    assert "'CK=0', the setting before a certificate's question, was refused: error 33" in state.notes
    repair(state := drive(), [mine := owed(drive(), LINES)], NoAnswer("silent"))
    assert state.restore == mine
    assert state.notes == ["EM=1, CK=0: not restored after an interrupted certificate: silent"]


def test_a_reason_against_errors_is_none_against_what_only_changes_a_setting():
    stored, moves = Occupied(errors="a program is stored"), Occupied("it moves")
    assert [stored.reason(each) for each in ("nothing", "mode")] == ["", ""]
    assert stored.reason("error") == stored.reason("moves") == "a program is stored"
    assert [moves.reason(each) for each in ("nothing", "mode", "error")] == ["", "it moves", "it moves"]
