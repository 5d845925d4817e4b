"""What is uploaded downloads again to the same listing, on every product; and what was downloaded compares equal."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import NoAnswer
from multidrop.dialects.program_files import Difference, Held, Stored
from multidrop.families.lexium.host.mcode import program_readout as listings
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import program_file
from tests.conftest import Bench
from tests.support.cases import for_each
from tests.support.examples import examples
from tests.support.mcode_drives import one_drive

pytestmark = pytest.mark.slow

SERIAL = ("LMDCM", "LMDOM", "LMM", "MDI", "MDIE", "MDIX")
LINES = (
    "MR 51200",
    "MA -5",
    "H",
    "H 250",
    "P=30000",
    "R1=R1+1",
    'PR "a  b ",P;',
    "BR 1,R1<9",
    "VM=400000",
    "r2 = r1*4",
)
ENDS = ("E", "RT", "BR 1", "H")
GAPS = (0, 1, 2, 7, 63, 64, 65, 300)


def drive(personality="LMDCM", bench=Bench):
    return one_drive(bench, product=personality, personality=personality)


def stores(desk, *lines):
    device = desk.devices["!"]
    for line in lines:
        assert not device.execute(line, desk.now).refused, line
    return device


def upload(desk, state):
    return desk.run(MCodeFamily(state).programs.upload(False), state)


def download(desk, state, lines):
    file = program_file.read("\n".join(lines), "x")
    before = desk.run(MCodeFamily(state).programs.read((), lambda done, total: None), state)
    sent = desk.run(MCodeFamily(state).programs.download(file, before, lambda done, total: None), state)
    held = desk.run(MCodeFamily(state).programs.read((), lambda done, total: None), state)
    return MCodeFamily(state).programs.differences(sent, held, before)


def listing(desk):
    return desk.devices["!"].program.listing()


def stored(found, labels, blocks):
    """Store programs with these gaps between them; labels are numbered through."""
    at = 1
    for gap, lines, end in blocks:
        stores(found, f"PG {at + gap}", f"LB A{labels}", *lines, end)
        at = found.devices["!"].programming
        stores(found, "PG")
        labels += 1


programs = st.lists(
    st.tuples(st.sampled_from(GAPS), st.lists(st.sampled_from(LINES), max_size=4), st.sampled_from(ENDS)),
    min_size=1,
    max_size=4,
)


@examples(15, nightly=300)
@given(st.sampled_from(SERIAL), programs)
def test_an_upload_downloads_to_the_same_listing(personality, blocks):
    first, state = drive(personality)
    stores(first, "VA Q1=25", "VA Q2=-3")
    stored(first, 1, blocks)
    made = upload(first, state)
    second, other = drive(personality)
    assert download(second, other, made) == ()
    assert listing(second) == listing(first) and len(listing(second)) == sum(len(each[1]) + 2 for each in blocks)
    assert upload(second, other) == made
    assert download(second, other, made) == ()
    assert listing(second) == listing(first)


@examples(15, nightly=300)
@given(programs, programs)
def test_any_program_replaces_any_other(old, new):
    """Programs of the new file are there as written; of the old ones only whole ones with other labels are left."""
    desk, state = drive()
    stored(desk, 1, old)
    before = listing(desk)
    source, reference = drive()
    stored(source, 5, new)
    wanted = upload(source, reference)
    assert download(desk, state, wanted) == ()
    now = listing(desk)
    assert [line for line in now if line in listing(source)] == listing(source)
    assert set(now) <= {*before, *listing(source)}


@pytest.mark.parametrize("spelled", ["mr 51200", "MR=51200", "MR51200", "MR  51200"])
def test_spelling_is_no_difference(spelled):
    desk, state = drive()
    assert download(desk, state, ["PG 1", "LB g1", spelled, "E", "PG"]) == ()
    assert MCodeFamily(drive()).programs.size(program_file.read(f"PG 1\nLB G1\n{spelled}\nE\nPG", "x")) == 3


FILE = program_file.read("PG 1\nLB G1\nMR 100\nH\nE\nPG\n", "x")
EXACT = ("LB G1", "MR 100", "H", "E")


@pytest.mark.parametrize(
    ("there", "found"),
    [
        (EXACT, ()),
        (("LB G1", "MR 101", "H", "E"), (Difference(3, "MR 100", 6, "MR 101"),)),
        (("LB G1", "H", "E"), (Difference(3, "MR 100", None, ""),)),
        (("LB G1", "MR 100", "P=5", "H", "E"), (Difference(0, "", 10, "P=5"),)),
        ((*EXACT, "P=5"), (Difference(0, "", 14, "P=5"),)),
        ((), tuple(Difference(n, text, None, "") for n, text in enumerate(EXACT, 2))),
    ],
)
def test_each_line_that_differs_is_found(there, found):
    state, at, held = MCodeState(MCode(), "", "!", "LMDCM"), 1, []
    for text in there:
        held.append(Stored(at, text))
        at += {"LB G1": 5, "MR 100": 4, "MR 101": 4, "P=5": 4}.get(text, 2)
    assert MCodeFamily(state).programs.differences(FILE, Held(tuple(held)), None) == found


def test_a_program_elsewhere_is_no_difference():
    state = MCodeState(MCode(), "", "!", "LMDCM")
    held = [Stored(1, "LB G1"), Stored(6, "MR 100"), Stored(10, "H"), Stored(12, "E"), Stored(15, "LB X9")]
    assert MCodeFamily(state).programs.differences(FILE, Held(tuple(held)), None) == ()


@given(st.lists(st.text(alphabet="AG1L =.-\t²\x00", max_size=12)))
def test_whatever_a_drive_lists_is_read(rows):
    listings.stored(rows)
    found = listings.names_of(Held(names=tuple(rows)))
    assert all(float(called.value) is not None for called in found.values())


@given(st.text(alphabet="PG1 LBE\n'VA=7x\"", max_size=60), st.sampled_from([(), ("Q1 = G 5", "A = 1")]))
def test_a_file_keeps_its_lines_and_gets_the_variables_that_it_lacks(text, names):
    made = MCodeFamily(drive()).programs.refreshed(text, Held(names=names))
    lines = text.removesuffix("\n").split("\n")
    assert [line for line in made if not line.startswith("VA Q1=5")] == lines and ("VA Q1=5" in made) is bool(names)


def test_a_program_whose_listing_was_lost_is_listed_again():
    desk, state = drive()
    stores(desk, "PG 1", "LB G1", "MR 100", "E", "PG")
    device, lost = desk.devices["!"], []
    execute = device.execute

    def loses_the_first(text, now, **how):
        if str(text).strip() == "L" and not lost:
            lost.append(text)
            return execute("", now, **how)
        return execute(text, now, **how)

    device.execute = loses_the_first
    held = desk.run(MCodeFamily(state).programs.read((), lambda done, total: None), state)
    assert lost and [line.text for line in held.lines] == ["LB G1", "MR 100", "E"]


@for_each("late", [False, True])
@pytest.mark.parametrize("em", [1, 2, 3])
def test_a_program_of_which_a_listed_line_was_damaged_is_listed_again(em, late):
    desk, state = one_drive(Bench, em=em, party=True, check=1)
    for line in ("PG 1", "LB G1", "MR 100", "E", "PG"):
        assert not desk.devices["a"].execute(line, desk.now).refused
    advance, held, damaged = desk.wire.advance, bytearray(), []

    def damages_a_line(now):
        held.extend(advance(now))
        if late and not damaged and b"L" in desk.written[-1][:2]:  # all of it comes with the mark after the list
            return b""
        if b"  MR 100" in held and not damaged:
            damaged.append(now)
            held[:] = held.replace(b"  MR 100", b"   MR 100")
        came = bytes(held)
        held.clear()
        return came

    desk.wire.advance = damages_a_line
    found = desk.run(MCodeFamily(state).programs.read((), lambda done, total: None), state)
    assert damaged and [line.text for line in found.lines] == ["LB G1", "MR 100", "E"]


@for_each("words", ["read", "typed"])
@pytest.mark.parametrize("em", [0, 1, 2, 3])
def test_without_a_checksum_a_line_with_what_no_drive_lists_is_damaged(em, words):
    """Another drive printed at the same time: two lines became one."""
    desk, state = one_drive(Bench, em=em, party=True)
    for line in ("PG 1", "LB G1", "MR 100", "E", "PG"):
        assert not desk.devices["a"].execute(line, desk.now).refused
    advance, held, damaged = desk.wire.advance, bytearray(), []

    def collides(now):
        held.extend(advance(now))
        if b"\r\n6  MR 100" in held and (words == "typed" or not damaged):
            damaged.append(now)
            held[:] = held.replace(b"\r\n6  MR 100", b"\x00\x10 MR 100")
        came = bytes(held)
        held.clear()
        return came

    desk.wire.advance = collides
    if words == "typed":
        with pytest.raises(NoAnswer, match="the list may be incomplete: its end or a line was damaged; ask again"):
            desk.type(state, "L")
        return
    found = desk.run(MCodeFamily(state).programs.read((), lambda done, total: None), state)
    assert damaged and [line.text for line in found.lines] == ["LB G1", "MR 100", "E"]


def test_two_lines_that_differ_in_a_long_program_of_lines_that_recur_are_two_differences():
    state = MCodeState(MCode(), "", "!", "LMDCM")
    body = [f"H {10 + number.bit_count() % 3}" for number in range(300)]
    sent = program_file.read("\n".join(["PG 100", *body, "E", "PG"]), "x")
    held, at = [], 100
    for number, text in enumerate([*body, "E"]):
        held.append(Stored(at, "H 99" if number in (2, 297) else text))
        at += listings.size(text, "LMDCM")
    found = MCodeFamily(state).programs.differences(sent, Held(tuple(held)), None)
    assert [(each.here, each.there) for each in found] == [(body[2], "H 99"), (body[297], "H 99")]
