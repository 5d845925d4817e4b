"""Cell files that are written are read again as what was written, whatever a drive holds."""

from hypothesis import given
from hypothesis import strategies as st

from multidrop.simulator import cells
from multidrop.simulator.cell.writer import BusText, DriveText, Entry, plain, write

texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\r\n\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"))


@given(st.lists(texts, min_size=1), texts)
def test_any_program_and_any_identity_are_read_as_they_were_written(lines, part):
    drive = DriveText("LMDCM", "a", program=lines, identity=[Entry("part", plain(part)), Entry("position", -5)])
    (bus,) = cells.read(write([BusText("b", [drive], missing=["c does not reply"])])).buses
    (spec,) = bus.drives
    assert spec.program.removesuffix("\n").split("\n") == lines
    assert spec.identity.part == plain(part)
    assert spec.identity.counters == {"position": (-5,)}


@given(st.lists(st.tuples(st.sampled_from(["OE", "IS5", "TS"]), st.text(max_size=9)), max_size=5), st.lists(st.text()))
def test_any_remark_is_a_remark(unread, remarks):
    text = write([BusText("b", [DriveText("LMDCM", "a", remarks=remarks, unread=unread)])])
    assert cells.read(text).buses[0].drives[0].name == "a"
