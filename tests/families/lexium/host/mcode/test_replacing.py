"""A file over a program that is in the drive: edit, download, run, as often as one likes, and nothing goes unsaid."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import NoAnswer, Refused
from multidrop.dialects.program_files import Held, Stored
from multidrop.families.lexium.host.mcode.download import plan
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.program_readout import GLOBAL, LABEL, LOCAL
from multidrop.families.lexium.manual import program_file
from tests.support.mcode_drives import one_drive

MODES = [(em, party, check) for em in range(4) for party in (False, True) for check in (0, 1)]
PROGRAM = """
VA Q1=25
VA Q2
VM=400000
PG 1
LB G1
  VA K1=3
  R1=Q1+K1
  BR G2
LB G2
E
PG
S
"""


def download(desk, state, text, **how):
    lines = program_file.read(text, "x.mxt")
    desk.run(MCodeFamily(state).programs.download(lines, None, lambda done, total: None), state, **how)


def only_reads(desk, since):
    return all(data.startswith((b"aPR ", b"aL")) for data in desk.written[since:])


def holding(names):
    """What a drive holds that has these names."""
    return Held(names=tuple(f"{name} = {'' if is_a == LABEL else is_a} 1" for name, is_a in names.items()))


def listed(desk, state):
    return [line.split(None, 1)[1].upper() for line in desk.type(state, "L")]


@pytest.mark.wide
@pytest.mark.parametrize(("em", "party", "check"), MODES)
@pytest.mark.parametrize("first", ["", "CP\n", "CP S\n", "CP 1\n"])
def test_an_edited_file_is_downloaded_over_itself_again_and_again(bench, em, party, check, first):
    desk, state = one_drive(bench, em, party, check)
    device = next(iter(desk.devices.values()))
    for value in range(30, 34):
        edited = PROGRAM.replace("25", str(value)).replace("K1=3", f"K1={value}").replace("G2", f"B{value}")
        download(desk, state, first + edited)
        assert desk.type(state, "PR Q1") == (str(value),) and not device.memory.error_flag
        assert listed(desk, state)[:2] == ["LB G1", f"VA K1={value}"]
        assert listed(desk, state)[-2:] == [f"LB B{value}", "E"]
        desk.type(state, "EX G1")
        desk.wait(0.5)
        assert desk.type(state, "PR R1") == (str(2 * value),)
        desk.type(state, "Q1=1")
        desk.type(state, "Q2=7")
    assert (state.codec.em, state.programming, state.restore) == (em, False, None)
    device.reset(device.now)
    assert device.memory.echo_mode == em and device.program.labels.keys() == {"G1", "B33"}


def test_a_drive_without_the_files_names_keeps_its_other_programs(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, PROGRAM)
    download(desk, state, "PG 500\nLB X9\nE\nPG\n")
    assert desk.devices["a"].program.labels.keys() == {"G1", "G2", "X9"}
    assert not any("cleared" in note for note in desk.notes)


def test_a_program_at_another_address_stays(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, PROGRAM)
    for _ in range(2):
        download(desk, state, "PG 60\nLB X9\n  P=5\nE\nPG\nPG 500\nLB X8\nE\nPG\n")
    download(desk, state, PROGRAM)
    assert desk.notes[-1] == "a: the program at 1 was cleared (CP); stored again: the program at 60, 500"
    listing = desk.devices["a"].program.listing()
    assert listing[-5:] == ["60  LB X9", "65  P=5", "69  E", "500  LB X8", "505  E"] and listing[-6].endswith("E")


def test_a_shorter_program_leaves_nothing_of_a_longer_one(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, PROGRAM)
    download(desk, state, "PG 1\nLB X9\nE\nPG\n")
    cleared = "a: the program at 1 was cleared (CP)"
    assert f"{cleared}; labels that the file does not have went with it: G1, G2" in desk.notes
    assert desk.devices["a"].program.listing() == ["1  LB X9", "6  E"]


def test_a_program_whose_label_is_given_again_elsewhere_is_replaced(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, "PG 1\nLB G1\nE\nPG\n")
    download(desk, state, "PG 100\nLB G1\nE\nPG\n")
    assert desk.devices["a"].program.listing() == ["100  LB G1", "105  E"]


def test_lines_inside_a_program_change_a_part_of_it(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, "PG 1\nLB G1\nP=100\nH\nE\nPG\n")
    download(desk, state, "PG 6\nP=111\nPG\n")
    assert desk.devices["a"].program.listing() == ["1  LB G1", "6  P=111", "10  H", "12  E"] and not desk.notes


def test_a_file_that_clears_the_drive_itself_is_sent_as_it_is(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, "PG 500\nLB X9\nE\nPG\n")
    download(desk, state, f"CP\n{PROGRAM}")
    assert desk.devices["a"].program.labels.keys() == {"G1", "G2"} and not desk.notes


def test_a_program_that_stays_is_named_where_it_cannot_be_stored_again(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, PROGRAM)
    download(desk, state, "PG 500\nLB X9\nE\nPG\n")

    def goes(desk):
        if desk.written[-1].startswith(b"aLB X9"):
            desk.devices["a"].power(False, desk.now)

    with pytest.raises(NoAnswer, match="^the program that stays: 'LB X9': .*no line of the program is stored$"):
        download(desk, state, PROGRAM, at=goes)


@pytest.mark.parametrize("line", ["VA Q1", "VA Q1=5", "LB Q1"])
def test_a_global_variable_in_the_way_is_told_before_anything_is_sent(bench, line):
    desk, state = one_drive(bench, 1, True, 1)
    desk.type(state, "VA Q1=5")
    desk.type(state, "VA Q2=6")
    download(desk, state, "PG 1\nLB G1\nE\nPG\n")
    sent = len(desk.written)
    with pytest.raises(Refused, match="^line 4: .*global variable Q1 already; CP 1 or FD deletes it"):
        download(desk, state, f"VM=400000\nPG 1\nLB G1\n{line}\nE\nPG\n")
    assert only_reads(desk, sent)
    assert listed(desk, state) == ["LB G1", "E"] and desk.type(state, "PR VM") != ("400000",)
    desk.type(state, "CP 1")
    download(desk, state, f"PG 1\nLB G1\n{line}\nE\nPG\n")


def test_a_label_that_was_a_local_variable_is_made_room_for(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, "PG 1\nVA K1\nE\nPG\n")
    desk.type(state, "EX 1")
    desk.wait(0.2)
    assert desk.type(state, "PR UV") == ("K1 = L 0",)
    download(desk, state, "PG 1\nLB K1\nE\nPG\n")
    assert listed(desk, state) == ["LB K1", "E"]


def test_a_locked_program_is_not_erased_by_a_download(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, PROGRAM)
    desk.type(state, "LK=1")
    with pytest.raises(Refused, match="locked"):
        download(desk, state, PROGRAM)
    assert desk.devices["a"].program.labels.keys() == {"G1", "G2"}


@pytest.mark.parametrize("slip", ["XYZZY 7", "BR G9", "R1=Q9", "LB G1"])
def test_a_program_is_not_erased_for_a_file_with_a_slip(bench, slip):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, PROGRAM)
    desk.type(state, "VA Z1")
    sent = len(desk.written)
    with pytest.raises(Refused, match=r"^line 4: .*\(nothing was sent\)$") as refused:
        download(desk, state, f"PG 1\nLB G1\nZ1=5\n{slip}\nE\nPG\n")
    assert only_reads(desk, sent), refused
    assert desk.devices["a"].program.labels.keys() == {"G1", "G2"}


def test_while_the_motor_moves_the_program_in_it_stays(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, PROGRAM)
    desk.type(state, "SL 5000")
    with pytest.raises(Refused, match="error 74"):
        download(desk, state, PROGRAM)
    assert desk.devices["a"].program.labels.keys() == {"G1", "G2"}


def test_what_was_uploaded_can_be_downloaded_again(bench):
    desk, state = one_drive(bench, 1, True, 1)
    download(desk, state, PROGRAM)
    desk.type(state, "EX G1")
    desk.wait(0.2)
    kept = desk.run(MCodeFamily(state).programs.upload(raw=False), state)
    assert kept[:3] == ("VA Q1=25", "VA Q2=0", "PG 1")
    for _ in range(3):
        download(desk, state, "\n".join(kept))
    assert desk.run(MCodeFamily(state).programs.upload(raw=False), state) == kept


def test_factory_defaults_in_a_file_make_every_name_free():
    lines = program_file.read("FD\nVA Q1=5\nPG 1\nLB G1\nE\nPG\n", "x")
    made = plan(lines, holding({"Q1": GLOBAL, "G1": LABEL}), "a")
    assert [line.text for line in made.lines] == [line.text for line in lines] and made.in_the_way == []


@given(
    st.dictionaries(st.sampled_from(["Q1", "G1", "K1", "X9"]), st.sampled_from([GLOBAL, LOCAL, LABEL])),
    st.lists(st.sampled_from(["VA Q1", "VAX9=5", "va g1 = -3", "VM=5"]), unique=True),
    st.lists(st.sampled_from(["LB G1", "VA K1", "lb q1", "MR 5", "R1=K1"]), unique=True),
)
def test_no_name_that_the_drive_has_is_given_once_more(names, before, inside):
    lines = program_file.read("\n".join([*before, "PG 1", *inside, "PG"]), "x")
    try:
        made = plan(lines, holding(names), "a")
    except Refused as refused:
        assert "nothing was sent" in str(refused) and GLOBAL in names.values()
        return
    assert [line.number for line in made.lines] == [line.number for line in lines]
    held = {name for name, is_a in names.items() if is_a == GLOBAL or (is_a == LABEL and not made.in_the_way)}
    named = [text[2:].strip()[:2] for line in made.lines if (text := line.text.upper())[:2] in ("VA", "LB")]
    given_by_file = [line.text.upper()[2:].strip()[:2] for line in lines if line.text.upper()[:2] in ("VA", "LB")]
    assert not [name for name in named if name in held and given_by_file.count(name) == 1]


@pytest.mark.parametrize(
    ("product", "clear", "first"),
    [
        ("LMDCM", "CP 1", "VA Q1=5"),
        ("MDI", "CP 1", "Q1=5"),
        ("LMDCM", "CP 100", "Q1=5"),
        ("LMDCM", "CP", "Q1=5"),
        ("MDI", "FD", "VA Q1=5"),
    ],
)
def test_a_file_that_clears_declares_what_that_deletes_and_assigns_the_rest(product, clear, first):
    lines = program_file.read(f"{clear}\nVA Q1=5\nPG 1\nLB G1\nE\nPG\n", "x.mxt")
    assert plan(lines, Held((), ("Q1 = G 3",)), "a", product).lines[1].text == first


def test_a_program_with_a_local_name_goes_where_the_file_makes_that_name_a_global():
    held = Held((Stored(37, "LB G2"), Stored(42, "VA Q1=3"), Stored(50, "E")), ("G2 = 37", "Q1 = L 3"))
    text = "VA Q1=5\nPG 1\nLB G1\nE\nPG\n"
    assert plan(program_file.read(text, "x.mxt"), held, "a", "LMDCM").replaced
    inside = "PG 1\nVA Q1=5\nE\nPG\n"
    assert not plan(program_file.read(inside, "x.mxt"), held, "a", "LMDCM").clears
