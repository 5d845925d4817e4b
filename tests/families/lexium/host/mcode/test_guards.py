"""Which lines of MCode need a person's yes, in every form in which a drive executes them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.families import FAMILIES
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState
from multidrop.families.lexium.manual import groups
from multidrop.families.lexium.manual.guards import NAMES
from multidrop.families.lexium.manual.modbus.registers import REGISTERS

FAMILY, MODBUS = FAMILIES["mcode"], FAMILIES["modbus"]
PARTY, ALONE = MCodeState(MCode(party=True), "a"), MCodeState(MCode())
EVERY = MCodeState(MCode(party=True), "*")
QUEUED = MCodeState(MCode(party=True), "^")

GUARDED = {
    "FD": ["FD", "fd", " FD ", "FD 'bye", "\tFD", "aFD", "!fd", "*FD"],
    "CP": ["CP", "cp 1", "CP 100", "CPG1", "CP 0,G1", "CP S", "CP\tG1", "CP=1", "CP,", 'CP "', "bCP 100"],
    "UG": ["UG 2956102", "ug", "UG2956102", "UG="],
    "IP": ["IP", "ip ", "IP=1", "cIP"],
    "AS": ["AS=3", "as 3", "AS3", "AS = 3.0", "AS=1+2", "AS=R1", "AS 3 'torque"],
    "BD": ["BD=19", "bd 96", "BD19"],
    "DN": ['DN="a"', "dn=a", 'DN "b"', "DN=65", 'DN="', "DN b"],
    "LK": ["LK=1", "lk 1", "LK1", "LK=R1"],
    "PR": [r'PR "\c"', r'pr P,"a\c"', r'PR "\\\c";', r'PR "a\c'],
    "PY": ["PY=0", "py 0", "PY0", "PY=R1", "PY=!1"],
}
FREE = [
    *(
        "PR FD",
        "PR CP",
        'PR "CP"',
        r'PR "\\c"',
        r'PR "\r\n\t"',
        r"PR P ' \c",
        "PR DN",
        "DN",
        "BD",
        "AS",
        "LK",
        "PY",
        "AS=0",
        "AS=2",
        "LK=0",
        "PY=1",
        "'CP",
        "",
        " ",
    ),
    *("MR 512", "S", "EX G1", "PG 100", "E", "SL 0", "ER=0", "EM=1", "CK=1", "PR AL", "VA Q1=5", "Q1=5", "L", "IS=1,2"),
]


def named(state, text):
    found = FAMILY(state).guard(text)
    return found.name if found else ""


def test_every_form_of_a_guarded_line_is_guarded():
    assert set(GUARDED) == {*groups.GUARDED, "PR"} == set(NAMES) - {"*"}
    for name, texts in GUARDED.items():
        for text in (*texts, *map(str.lower, texts)):
            assert named(PARTY, text) == name, text
            assert FAMILY.word_of(text) == name, text
            over = MODBUS(ModbusState(Modbus())).guard(text)
            assert (over.name if over else "") == (name if name in REGISTERS else ""), text


def test_what_a_line_does_is_said_with_the_line():
    assert FAMILY(ALONE).guard("cp 1 'all").what == "'cp 1' erases the program and every user variable"


@pytest.mark.parametrize(
    ("product", "line", "erased"),
    [
        ("", "CP", "the program"),
        ("LMDCM", "CP 0", "the program"),
        ("LMDCM", "CP S", "the program, and saves that"),
        ("LMDCM", "CP P1", "everything from P1 to the end of program memory"),
        ("LMDCM", "CP 0, P1", "everything from P1 to the end of program memory"),
        ("LMDCM", "aCP 1,P1", "everything from P1 to the end of program memory and every user variable"),
        ("LMDCM", "CP 0,100", "everything from address 100 to the end of program memory"),
        ("MDI", "CP 1", "everything from address 1 to the end of program memory"),
        ("MDI", "CP S", "everything from S to the end of program memory"),
        ("LMDCM", "CP P1,P2,P3", "the program"),
    ],
)
def test_the_question_says_all_that_cp_erases(product, line, erased):
    state = MCodeState(MCode(party=True), "a")
    state.identified(product, "")
    assert FAMILY(state).guard(line).what == f"'{line}' erases {erased}"


def test_other_lines_are_free():
    for text in FREE:
        assert named(PARTY, text) == named(ALONE, text) == "", text


def test_leaving_party_mode_is_guarded_on_a_party_line_only():
    assert (named(PARTY, "PY=0"), named(ALONE, "PY=0")) == ("PY", "")


def test_ctrl_c_in_a_print_is_guarded_on_a_party_line_only_and_is_never_a_mere_question():
    line = r'PR "\c"'
    assert (named(PARTY, line), named(ALONE, line), named(ALONE, "a" + line)) == ("PR", "", "PR")
    assert not FAMILY.only_reads(line) and FAMILY.only_reads("PR P")


def test_a_line_to_all_that_can_start_a_drive_is_guarded():
    for text in (
        "MA 0",
        "MR 5",
        "SL 500",
        "SL=R1",
        "HM 1",
        "HI 1",
        "EX G1",
        "RS",
        "JE=1",
        "TE=1",
        "AS=1",
        "FOO",
        "CA 1",
    ):
        for form in (text, text.lower()):
            assert named(EVERY, form) == named(QUEUED, form) == "*", form
            assert named(PARTY, form) == "", form
    assert named(EVERY, "CP") == "CP" and named(QUEUED, "AS=3") == "AS"


def test_a_typed_name_counts_as_the_address_that_it_is_on_the_wire():
    for text, name in {
        "*MR 5": "*",
        "^EX G1": "*",
        "*SL 0": "",
        "*S": "",
        "*PR P": "",
        "aMR 5": "",
        "aPY=0": "PY",
    }.items():
        assert named(ALONE, text) == named(ALONE, text.lower()) == name, text


def test_a_stop_to_all_is_never_guarded():
    for text in ("SL 0", "SL=0", "SL0", "sl 0 'stop", "SL -0", "E", "PS", "JE=0", "DE=0", "AS=0", "TQ 0", "PR P", "S"):
        assert named(EVERY, text) == named(EVERY, text.lower()) == "", text


@given(st.text(alphabet="CPFDASL=01\"', \t+a*\x1b\x00é", max_size=12))
def test_no_text_breaks_the_search(text):
    for state in (PARTY, ALONE, EVERY):
        assert named(state, text) in {*NAMES, ""}


@given(
    word=st.sampled_from(sorted(word for word, row in groups.GUARDED.items() if not row.valued)),
    tail=st.from_regex(r"[ =,]*('.*)?", fullmatch=True),
)
def test_nothing_after_an_instruction_hides_it(word, tail):
    assert named(PARTY, word + tail) == word
