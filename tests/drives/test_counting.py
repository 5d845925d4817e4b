"""Whether a scale still holds, by what is sent to a drive, what is read of it, and what became of its connection."""

from __future__ import annotations

from dataclasses import replace

import pytest

from multidrop.dialects import DriveState, Kind
from multidrop.drives.counting import Counting
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.host.mcode.units import MCodeUnits
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState

ACCEPTED = (("MS", "256"), ("EE", "0"))
UNITS = MCodeUnits(MCodeState(MCode()))


def scaled() -> tuple[Counting, MCodeState]:
    """A drive with a scale that was accepted."""
    counting, state = Counting(), MCodeState(MCode(em=1), "")
    counting.accept("", ACCEPTED, state.recounts)
    assert counting.holds("", state.recounts)
    return counting, state


@pytest.mark.parametrize("line", ["MS=128", "ms 256", "EE=1", "IC MS", "DC EE", "RD=1", "AS=2", "IP", "FD"])
def test_a_scale_does_not_hold_behind_a_line_that_may_change_a_count_until_the_settings_are_read(line: str) -> None:
    counting, state = scaled()
    counting.sent(state.codec.request("", line), UNITS, state)
    assert not counting.holds("", state.recounts) and not counting.read_since(state.recounts)
    counting.saw("", (("MS", "128"), ("EE", "0")), state.recounts)
    assert not counting.holds("", state.recounts) and counting.changes("") == ["MS was 256 and is 128 now"]
    counting.saw("", ACCEPTED, state.recounts)
    assert counting.holds("", state.recounts)


@pytest.mark.parametrize("line", ["MR 5", "PR MS", "PR EE", "VM=5", "R1=5", "EX G1", "P=0"])
def test_a_scale_holds_behind_any_other_line_and_behind_one_that_is_stored(line: str) -> None:
    counting, state = scaled()
    counting.sent(state.codec.request("", line), UNITS, state)
    counting.sent(replace(state.codec.request("", "MS=128"), kind=Kind.PROGRAM), UNITS, state)
    state.programming = True
    counting.sent(state.codec.request("", "EE=1"), UNITS, state)
    assert counting.holds("", state.recounts)


def test_a_reading_that_began_before_such_a_line_does_not_count() -> None:
    counting, state = scaled()
    before = state.recounts
    counting.sent(state.codec.request("", "MS=128"), UNITS, state)
    counting.saw("", ACCEPTED, before)
    assert not counting.holds("", state.recounts)


@pytest.mark.parametrize("after", [MCodeState(MCode(), ""), ModbusState(Modbus(), "")])
def test_a_scale_does_not_hold_behind_a_lost_connection_until_the_settings_are_read(after: DriveState) -> None:
    counting, before = scaled()
    after.follows(before)
    assert not counting.holds("", after.recounts)
    counting.saw("", ACCEPTED, after.recounts)
    assert counting.holds("", after.recounts)
