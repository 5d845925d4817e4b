"""What frees a drive that does not reply: whatever it is set to, and whatever holds it, nothing is erased."""

import pytest

from multidrop.dialects.scanning import Reach
from multidrop.families.lexium.host.mcode import scan
from tests.support.mcode_drives import MODES

PRINTS = ("PG 1", "LB G1", 'PR "tick ",R3', "IC R3", "BR G1", "E", "PG", "EX G1")
STEPS = ("PG 1", "LB G1", "IC R3", "BR G1", "E", "PG", "EX G1,2")
OE = ("PG 100", "LB Q1", "R4=7", "RT", "E", "PG", "OE Q1", "R1=4711")
TROUBLES = {
    "program mode": ((*OE, "PG 1"), b""),
    "single step": ((*OE, *STEPS), b""),
    "half a line": (OE, b"MR 51"),
    "locked": ((*OE, "LK=1"), b"PG"),
}


def freed(bench, table, before, half):
    """The drive, and how it was found: by a search alone, or after the line was cleared."""
    desk = bench([{"personality": "LMDCM", **table}], baud=9600)
    [device] = [placed.device for placed in desk.floor.drives]
    for text in before:
        assert not device.execute(text, 0.0).refused, text
    desk.wait(0.3)
    start = b"\n\n" + table["name"].encode() if table["party"] else b""
    desk.wire.receive(start + half if half else b"", desk.now)
    desk.wait(0.1)
    found = []
    desk.run(scan.SCAN.search(Reach(hasty=True), found.append, lambda: None))
    if not found:
        desk.run(scan.SCAN.clear())
        desk.run(scan.SCAN.search(Reach(), found.append, lambda: None))
    return desk, device, [(each.address, each.codec.em, each.codec.party, each.codec.checksum) for each in found]


@pytest.mark.wide
@pytest.mark.parametrize("trouble", TROUBLES)
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_stuck_drive_replies_again_and_keeps_what_it_holds(bench, em, party, check, trouble):
    table = {"name": "P", "party": party, "set": {"EM": em, "CK": check}}
    desk, device, found = freed(bench, table, *TROUBLES[trouble])
    assert found == [("P" if party else "", em, party, check)]
    assert device.programming is None and device.position(desk.now) == 0
    assert device.memory.values["R1"] == 4711


def test_a_program_that_prints_without_a_pause_is_ended(bench):
    table = {"name": "k", "party": True, "set": {"EM": 1, "CK": 1}}
    _, device, found = freed(bench, table, [*PRINTS[:4], "H 30", *PRINTS[4:]], b"")
    assert found == [("k", 1, True, 1)] and not device.running


@pytest.mark.nightly
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_a_program_that_floods_the_line_hides_no_drive(bench, em, party, check):
    table = {"name": "k", "party": party, "set": {"EM": em, "CK": check}}
    _, device, found = freed(bench, table, PRINTS, b"")
    assert found == [("k" if party else "", em, party, check)]
    assert not device.running or not party


@pytest.mark.wide
@pytest.mark.parametrize(("em", "party", "check"), MODES)
def test_factory_defaults_reach_a_drive_in_every_mode(bench, em, party, check):
    desk = bench([{"name": "k", "party": party, "set": {"EM": em, "CK": check}}], baud=9600)
    desk.run(scan.SCAN.erase())
    [device] = [placed.device for placed in desk.floor.drives]
    assert (device.memory.echo_mode, device.memory.party, device.memory.checksum, device.memory.name) == (
        0,
        False,
        0,
        "!",
    )
