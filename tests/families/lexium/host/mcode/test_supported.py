"""What one unit lacks of its product's commands, by the firmware and the part number that it reports."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.families import program_languages
from multidrop.families.lexium.manual.mnemonic import LEXIUM
from multidrop.families.lexium.manual.supported import firmware, lacks, unsupported
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS
from tests.support.examples import examples

OLD, NEW = "LMDCM 5.007, Hw: 3.2", "LMDCM 6.002, Hw: 3.2"
SMALL, LARGE = "LMDCM421", "LMDCM571"


def told(text: str, version: str = NEW, part: str = LARGE, product: str = "LMDCM") -> list[tuple[int, str]]:
    return [(each.line, each.what) for each in unsupported(text, product, version, part)]


@pytest.mark.parametrize(
    ("line", "version", "part", "what"),
    [
        ("LS=0,5,1", OLD, LARGE, "LS needs firmware 6, and this drive has 5.007"),
        ("HF 1", "LMDCE 5.010", LARGE, "HF needs firmware 6, and this drive has 5.010"),
        ("R1=AB R2", OLD, "", "AB needs firmware 6, and this drive has 5.007"),
        ("PR AV", OLD, "", "AV needs firmware 6, and this drive has 5.007"),
        ("IS=3,13,0", OLD, LARGE, "IS type 13 needs firmware 6, and this drive has 5.007"),
        ("O1=1", NEW, SMALL, "O1 is not on a NEMA 17 (LMDCM421)"),
        ("PR I4", NEW, SMALL, "I4 is not on a NEMA 17 (LMDCM421)"),
        ("IS=4,0,0", NEW, SMALL, "IS=4 is not on a NEMA 17 (LMDCM421): error 10"),
        ("IS=1,12,0", NEW, SMALL, "IS type 12 (capture) is not on a NEMA 17 (LMDCM421)"),
        ("OS=2,17,1", "", SMALL, "OS=2 is not on a NEMA 17 (LMDCM421): error 10"),
        ("TE=12", NEW, SMALL, "TE=12 enables the trip on capture, which is not on a NEMA 17 (LMDCM421)"),
        ("RD=1", OLD, LARGE, "RD may cause unintended MOTION with firmware 5.007"),
    ],
)
def test_a_command_that_a_unit_lacks_is_named_at_its_line(line: str, version: str, part: str, what: str) -> None:
    text = f"PG 1\nLB AA\n{line}\n{line}\nE\nPG\n"
    assert told(text, version, part)[0] == (3, what)
    assert told(text) == told(text, "", "") == told(text, version, part, "MDI") == []


@pytest.mark.parametrize("line", ["OS=3,17,1", "IS=3,0,0", "O3=1", "TE=3", "TI=3,AA", "PR RD", "VM=5", "IS=R1,0,0"])
def test_what_every_unit_has_is_not_named(line: str) -> None:
    assert told(f"PG 1\nLB AA\n{line}\nE\nPG\n", OLD, SMALL) == []


def test_each_word_is_named_once_and_a_users_name_is_no_word() -> None:
    assert [line for line, _ in told("VA PI=1\nPG 1\nPF=1\nPF=2\nPI=5\nE\nPG\n", OLD)] == [3]


def test_the_marks_of_the_table_are_those_of_a_lexium() -> None:
    newer = {name for name, row in MNEMONICS.items() if row.firmware}
    assert {"LS", "PF", "FM", "HF", "AV", "F8", "SI", "T_"} <= newer and not newer & {"HI", "SF", "IS", "P"}
    assert {name for name, row in MNEMONICS.items() if row.large} == {"D4", "FC", "I4", "O1", "O2", "TC"}
    assert not any(row.firmware or row.large for row in MDRIVE.values())
    assert "firmware" not in " ".join(row.note for row in MNEMONICS.values())


@pytest.mark.parametrize(
    ("version", "found"),
    [(NEW, (6, 2)), (OLD, (5, 7)), ("LMMCM 6.002", (6, 2)), ("3.010", None), ("", None), ("V128BL", None)],
)
def test_the_firmware_is_read_from_what_a_lexium_prints(version: str, found: tuple[int, int] | None) -> None:
    assert firmware(version) == found
    assert (lacks(MNEMONICS["LS"], version, "") != "") == (found is not None and found < (6, 0))


def test_families_without_such_facts_say_nothing() -> None:
    for name, files in program_languages().items():
        assert (files.unsupported("LS=0,5,1\n", "LMDCM", OLD, SMALL) != []) == (name == "mcode")


@examples(50, nightly=500)
@given(text=st.text(), version=st.text(), part=st.sampled_from([SMALL, LARGE, ""]))
def test_no_text_breaks_it(text: str, version: str, part: str) -> None:
    for product in (*LEXIUM, "MDI", "", "x"):
        unsupported(text, product, version, part)
