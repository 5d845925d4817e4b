"""Commands of section 5.1 from WT back to LM, and the wire: what a second reading of the manual has found."""

import pytest

from simulator.cell import DriveSpec, WorldSpec
from simulator.devices import MCodeDevice
from simulator.world import World

SUBROUTINE = ("PG 1", "LB K1", 'PR "trip"', "RT", "PG")


def drive(*lines, personality="LMDCM", **world):
    """A drive that has taken these lines."""
    device = MCodeDevice(DriveSpec(personality=personality), World(WorldSpec(**world)))
    device.prints()
    for line in lines:
        assert not device.execute(line, 0.0).refused, line
    return device


def say(device, *lines):
    """What lines printed, or the code of a refusal as `?code`; a number waits so many seconds."""
    said = []
    for line in lines:
        if isinstance(line, (int, float)):
            device.advance(device.now + line)
            continue
        answer = device.execute(line, device.now)
        if answer.refused:
            said.append("?" + device.execute("PR ER", device.now).lines[0])
        else:
            said += answer.lines
    return said


def printed(device):
    """What the drive has printed by itself."""
    return "".join(text for _, text in device.prints())


@pytest.mark.parametrize(
    ("lines", "line", "code"),
    [
        (["MS=4"], "VM=40001", "?77"),
        (["MS=4"], "VM=2560001", "?21"),
        ([], "VM=2560001", "?21"),
        (["MS=10"], "TS=100001", "?77"),
        (["MS=10"], "TS=46511", "?21"),
        ([], "TS=2560001", "?21"),
    ],
)
def test_a_velocity_that_the_microsteps_do_not_reach_is_error_77(lines, line, code):
    assert say(drive(*lines), line) == [code]


def test_velocities_up_to_ten_thousand_a_microstep_are_taken():
    assert say(drive("MS=10"), "VM=100000", "TS=100000", "PR VM", "PR TS") == ["100000", "100000"]


def test_vm_stays_above_vi_however_coarse_the_microsteps_become():
    assert say(drive("VI=1000", "VM=1001"), "MS=1", "PR VI", "PR VM") == ["4", "5"]


def test_the_ramps_stay_in_their_range_however_fine_the_microsteps_become():
    device = drive("MS=1", "A=1100000000", "D=66")
    assert say(device, "MS=256", "PR A", "PR D") == ["1100000000", "16896"]
    assert say(device, "MS=1", "PR D") == ["66"]
