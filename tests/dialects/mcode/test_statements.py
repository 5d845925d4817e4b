"""The canonical spelling of a line: one for each statement, the same statement, the same size in the drive."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.mcode.manual.grammar import LineError, Statement, parse
from multidrop.dialects.mcode.manual.statements import canonical, size_of
from multidrop.dialects.mcode.manual.table import MDRIVE, MNEMONICS
from tests.support.cases import for_each

NAMES = frozenset({"Q1", "K1", "GA", "AO"})


@for_each(
    "typed, spelled",
    [
        ("vm 5000", "VM=5000"),
        (" VM\t=  5000 ' fast", "VM=5000"),
        ("MR512", "MR 512"),
        ("mr -100,1 , 0", "MR -100,1,0"),
        ("SL=0", "SL 0"),
        ("hm=1", "HM 1"),
        ("pg=100", "PG 100"),
        ("Lb ga `start", "LB GA"),
        ("vaq1=25", "VA Q1=25"),
        ("Va Q1 = 25", "VA Q1=25"),
        ("q1 7", "Q1=7"),
        ("exk1", "EX K1"),
        ("br k1 , p < r1 + 100", "BR K1,P<R1+100"),
        ("BR K1, I5 =< 07", "BR K1,I5<=7"),
        ("r1=r2 - -3", "R1=R2--3"),
        ("r3 = ! r1", "R3=!R1"),
        ("f1 = si f2", "F1=SI F2"),
        ("f1=1e-300", "F1=1E-300"),
        ("ti 1, k1", "TI=1,K1"),
        ("is=1, 2 ,, 0", "IS=1,2,,0"),
        ("OE=K1", "OE K1"),
        ('pr "it\'s  1"p', 'PR "it\'s  1",P'),
        ("PR MV ST I1 ;", "PR MV,ST,I1;"),
        ("DN b", "DN=b"),
        ('dn "b"', 'DN="b"'),
        ("-100", "-100"),
        ("h", "H"),
        ("ao = 3", "AO=3"),
        ("  ' nothing", ""),
    ],
)
def test_a_statement_has_one_spelling(typed: str, spelled: str) -> None:
    assert canonical(typed, NAMES) == spelled
    assert canonical(spelled, NAMES) == spelled


@pytest.mark.parametrize("line", ["MR *5", 'PR "open', "P 5 6", "=5"])
def test_a_line_that_no_drive_accepts_stays_as_it_is(line: str) -> None:
    assert canonical(f" {line} ") == line


PARTS = st.sampled_from(
    [
        *MNEMONICS, *MDRIVE, "Q1", "K1", "Ga", "ao", "5", "-3", "07", "1.5", ".5", "2e3", "9" * 20, '"a b"',
        '"', "=", "<>", "=<", "=>", "<", "-", "+", "!", ",", ",", ";", "a", "'", "`", ".", "_",
    ]
)  # fmt: skip
BLANKS = st.sampled_from(["", "", " ", "\t", "  "])


def _parsed(line: str) -> Statement | None:
    try:
        return parse(line, NAMES)
    except LineError:
        return None


@given(st.sampled_from([*MNEMONICS, "Q1", "-5"]), st.lists(st.tuples(BLANKS, PARTS), max_size=8))
def test_the_spelling_is_the_statement_and_spells_itself(head: str, rest: list[tuple[str, str]]) -> None:
    line = head.lower() + "".join(blank + part for blank, part in rest)
    spelled, meant = canonical(line, NAMES), _parsed(line)
    assert canonical(spelled, NAMES) == spelled
    if meant is None:
        assert spelled == "" or _parsed(spelled) is None
        return
    again = _parsed(spelled)
    assert again is not None
    assert (again.word, again.arguments, again.quiet) == (meant.word, meant.arguments, meant.quiet)
    assert size_of(again) == size_of(meant)


@given(st.text(max_size=30))
def test_any_text_has_a_spelling(text: str) -> None:
    assert canonical(canonical(text)) == canonical(text)
