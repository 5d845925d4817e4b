"""The search for MCode drives at one baud rate: it finds every drive, moves none and is an error to none."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.codec import copy_with
from multidrop.dialects.scanning import Reach, SearchOutcome
from multidrop.families.lexium.host.mcode import scan
from multidrop.families.lexium.host.mcode.codec import MCode
from tests.support.examples import examples
from tests.support.mcode_drives import MODES, Witness

pytestmark = pytest.mark.slow

OE = ("PG 1", "LB Q1", "MR 5000", "RT", "E", "PG", "OE Q1")
NAMED = [(em, check) for em in range(4) for check in range(3)]


class Searched:
    """Drives on a line, and a search of it."""

    def __init__(self, bench, *tables, baud=9600, before=(), half=b"", cut="", **faults):
        self.desk = bench(list(tables), baud=baud, **faults)
        self.devices = [placed.device for placed in self.desk.floor.drives]
        for text in before:
            assert not any(device.execute(text, 0.0).refused for device in self.devices), text
        self.witnesses = [Witness(device) for device in self.devices]
        self.desk.wire.receive(half, 0.0)
        self.desk.wait(0.2)
        self.begun, self.found, self.steps = self.desk.now, [], 0
        self.outcome = self.desk.run(scan.SCAN.search(Reach(cut=cut), self.found.append, self._step))

    def _step(self):
        self.steps += 1

    @property
    def modes(self):
        return [(each.address, each.codec.em, each.codec.party, each.codec.checksum) for each in self.found]

    @property
    def harmed(self):
        """Lines that a drive refused or stored, errors, and drives away from their place."""
        lines = [line for witness in self.witnesses for line in witness.lines if line[1] or line[2]]
        errors = [device.memory.name for device in self.devices if device.memory.error_flag]
        moved = [device.memory.name for device in self.devices if device.position(self.desk.now)]
        return lines + errors + moved


@pytest.mark.wide
@pytest.mark.parametrize(("em", "party", "check"), MODES)
@pytest.mark.parametrize("name", ["!", "P", "R", "V", "9", "a", "p"])
def test_every_drive_is_found_and_none_is_harmed(bench, em, party, check, name):
    seen = Searched(bench, {"name": name, "party": party, "set": {"EM": em, "CK": check}}, before=OE)
    assert seen.modes == [(name if party else "", em, party, check)]
    assert (seen.found[0].product, seen.found[0].name) == ("LMDCM", name)
    assert seen.harmed == [] and seen.outcome.remarks == ()


def test_a_party_line_of_drives_that_are_set_in_every_way_is_found_whole(bench):
    names = "PRpr!2VMxyZ0"
    tables = [
        {"name": name, "party": True, "set": {"EM": em, "CK": check}}
        for name, (em, check) in zip(names, NAMED, strict=True)
    ]
    seen = Searched(bench, *tables, before=OE)
    assert sorted(each.address for each in seen.found) == sorted(names)
    assert seen.harmed == []


@pytest.mark.parametrize("baud", [4800, 9600, 115200])
def test_a_search_takes_no_longer_than_the_silence_of_the_absent_names(bench, baud):
    seen = Searched(bench, baud=baud)
    bound = len(scan.NAMES) * 2 * (8 * 10 / baud + 0.02)
    assert seen.found == [] and seen.desk.now - seen.begun < 1.15 * bound
    assert seen.steps == scan.SCAN.places(Reach())


@pytest.mark.wide
@pytest.mark.parametrize("late", [0.005, 0.016, 0.03, 0.06])
@pytest.mark.parametrize("check", [0, 1])
@pytest.mark.parametrize("em", range(4))
def test_replies_that_come_while_the_next_names_are_tried_are_not_lost(bench, em, check, late):
    tables = [{"name": name, "party": True, "set": {"EM": em, "CK": check}} for name in "aPRZ"]
    seen = Searched(bench, *tables, before=OE, delay=(late, late))
    assert sorted(each.address for each in seen.found) == ["P", "R", "Z", "a"]
    assert seen.harmed == [] and seen.outcome.remarks == ()


@pytest.mark.parametrize("party", [False, True])
def test_half_a_line_in_a_drive_is_not_executed(bench, party):
    half = (b"\n\n" if party else b"") + b"P" * party + b"MR 512"
    seen = Searched(bench, {"name": "P", "party": party}, half=half)
    assert [each.name for each in seen.found] == ["P"]
    assert not any(line[0].startswith("MR") and not line[1] for line in seen.witnesses[0].lines)
    assert seen.devices[0].position(seen.desk.now) == 0


@pytest.mark.wide
@pytest.mark.parametrize("check", [0, 1])
@pytest.mark.parametrize("em", range(4))
def test_a_new_drive_outside_of_party_mode_is_found_on_a_party_line_and_harms_none(bench, em, check):
    tables = [{"name": name, "party": True, "set": {"EM": em, "CK": check}} for name in "aPRV"]
    desk = bench(tables, baud=9600)
    *old, new = (placed.device for placed in desk.floor.drives)
    for device in (*old, new):
        for text in OE:
            device.execute(text, 0.0)
    new.execute("PY=0", 0.0)
    desk.wait(0.2)
    found = []
    desk.run(scan.SCAN.search(Reach(), found.append, lambda: None))
    desk.wire.receive(b"\n", desk.now)
    desk.wait(0.5)
    assert [(each.address, each.name, each.codec) for each in found] == [("", "V", MCode(em, False, check, 1))]
    assert not any(device.memory.error_flag or device.position(desk.now) for device in (*old, new))


def test_half_a_line_of_an_interrupted_session_overflows_first(bench):
    seen = Searched(bench, {"name": "a", "party": True}, half=b"\n\naMR ", cut="aMR 512")
    assert [each.address for each in seen.found] == ["a"] and seen.devices[0].position(seen.desk.now) == 0
    assert seen.desk.written[0][:1] == b"\x1b"


@pytest.mark.parametrize(("em", "party"), [(0, False), (0, True), (1, True), (3, True)])
def test_a_drive_in_program_mode_is_taken_out_and_said_so(bench, em, party):
    seen = Searched(bench, {"name": "a", "party": party, "set": {"EM": em}}, before=("PG 1",))
    assert len(seen.found) == 1 and seen.devices[0].programming is None
    assert "was in program mode" in seen.found[0].notes[0]


@pytest.mark.wide
@pytest.mark.parametrize(("em", "check"), [(1, 1), (0, 0), (2, 0)])
def test_a_program_that_prints_all_the_time_hides_no_drive(bench, em, check):
    program = ("PG 1", "LB G1", 'PR "tick ",R3', "IC R3", "H 100", "BR G1", "E", "PG", "EX G1")
    tables = [{"name": name, "party": True, "set": {"EM": em, "CK": check}} for name in "Pk"]
    seen = Searched(bench, *tables, before=program)
    assert sorted(each.address for each in seen.found) == ["P", "k"]


def test_two_drives_with_one_name_are_a_remark(bench):
    tables = [{"name": name, "party": True, "personality": each} for name, each in (("a", "LMDCM"), ("b", "MDI"))]
    seen = Searched(bench, *tables, before=['DN="z"'])
    assert seen.found == [] and "several drives may have this address" in seen.outcome.remarks[0]


def test_a_controller_of_another_family_is_a_remark(bench):
    desk = bench([{"personality": "PMX", "name": "00"}], baud=9600)
    outcome = desk.run(scan.SCAN.search(Reach(), lambda state: None, lambda: None))
    assert outcome.remarks == ("something replies as a PMX does; --dialect pmx searches for one",)


@pytest.mark.parametrize("personality", ["LMDOM", "LMM", "MDI", "MDIE", "MDIX"])
def test_every_product_is_found(bench, personality):
    seen = Searched(bench, {"name": "a", "party": True, "personality": personality})
    assert [each.address for each in seen.found] == ["a"] and seen.harmed == []


PIECES = (
    b"\r\n",
    b"\x15",
    b"\x06",
    b">",
    b"12  ",
    b'"a"\r\n',
    b"LMDCM 6.002, Hw: 3.2",
    b"~1",
    b" VR\r",
    b"\x00\xff",
    b"a\r\n>",
)


@examples(8, nightly=100)
@given(st.randoms(use_true_random=False), st.booleans())
def test_a_search_ends_whatever_is_received(random, hasty):
    conversation = scan.SCAN.search(Reach(hasty=hasty), lambda state: None, lambda: None)
    request = next(conversation)
    for _ in range(5000):
        request.codec.encode(request)
        data = b"".join(random.choices(PIECES, k=random.choice((0, 0, 0, 1, 3))))
        codec = request.codec
        found = codec.decode(request, data) or codec.on_quiet(request, data) or codec.on_timeout(request, data)
        try:
            request = conversation.send(copy_with(found.reply, raw=data[: found.used]))
        except StopIteration as end:
            assert isinstance(end.value, SearchOutcome)
            return
    raise AssertionError("it does not end")
