"""MCode lines: tokens, statements, and the canonical spelling of each."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.lexium.manual.grammar import (
    BinaryTerm,
    Compare,
    LineError,
    NameTerm,
    Number,
    Statement,
    Text,
    UnaryTerm,
    is_name,
    parse,
    strip,
    tokens,
)
from multidrop.families.lexium.manual.statements import canonical, size_of
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS
from tests.support.cases import for_each


@for_each(
    ("line", "statement"),
    [
        ("VM 5", Statement("VM", (Number(5),))),
        ("vm=5", Statement("VM", (Number(5),), equals=True)),
        ("MR512", Statement("MR", (Number(512),))),
        ("MA -51200,1", Statement("MA", (Number(-51200), Number(1)))),
        ("H", Statement("H")),
        ("H20", Statement("H", (Number(20),))),
        ("CL Kb,I1=1", Statement("CL", (NameTerm("KB"), Compare("=", NameTerm("I1"), Number(1))))),
        ("CL K0,R1 = 0", Statement("CL", (NameTerm("K0"), Compare("=", NameTerm("R1"), Number(0))))),
        ("CL Q5, I5=<2048", Statement("CL", (NameTerm("Q5"), Compare("<=", NameTerm("I5"), Number(2048))))),
        ("BR M0, V >=0", Statement("BR", (NameTerm("M0"), Compare(">=", NameTerm("V"), Number(0))))),
        ("BR L5, IN=07", Statement("BR", (NameTerm("L5"), Compare("=", NameTerm("IN"), Number(7))))),
        ("R1=R1 & 7", Statement("R1", (BinaryTerm("&", NameTerm("R1"), Number(7)),), equals=True)),
        ("MR R1*51200", Statement("MR", (BinaryTerm("*", NameTerm("R1"), Number(51200)),))),
        ("R3=!R1", Statement("R3", (UnaryTerm("!", NameTerm("R1")),), equals=True)),
        ("F2=CS R3", Statement("F2", (UnaryTerm("CS", NameTerm("R3")),), equals=True)),
        ("F1=L_ F2", Statement("F1", (UnaryTerm("L_", NameTerm("F2")),), equals=True)),
        ("VA C0 = 51200", Statement("VA", (Compare("=", NameTerm("C0"), Number(51200)),))),
        ("VAQ1=25", Statement("VA", (Compare("=", NameTerm("Q1"), Number(25)),))),
        ("Tp=51200,Kb", Statement("TP", (Number(51200), NameTerm("KB")), equals=True)),
        ("Is =1,0,0", Statement("IS", (Number(1), Number(0), Number(0)), equals=True)),
        ('DN="a"', Statement("DN", (Text("a"),), equals=True)),
        ("EX G1, 2", Statement("EX", (NameTerm("G1"), Number(2)))),
        ("MA 5,,1", Statement("MA", (Number(5), None, Number(1)))),
        ("-100", Statement("", (Number(-100),))),
        ("BR G1 `back, `again", Statement("BR", (NameTerm("G1"),))),
    ],
)
def test_a_statement_is_taken_apart(line, statement):
    assert parse(line) == statement


@pytest.mark.parametrize(
    ("line", "arguments", "quiet"),
    [
        ('PR "V3="V3', (Text("V3="), NameTerm("V3")), False),
        ('PR "a", P, "b"', (Text("a"), NameTerm("P"), Text("b")), False),
        ("PR MV ST I1", (NameTerm("MV"), NameTerm("ST"), NameTerm("I1")), False),
        ('PR "it\'s",P;', (Text("it's"), NameTerm("P")), True),
        ("PR", (), False),
        ("PRP", (NameTerm("P"),), False),
    ],
)
def test_prints_take_their_items_with_and_without_commas(line, arguments, quiet):
    assert parse(line) == Statement("PR", arguments, quiet=quiet)


def test_operators_are_carried_out_from_left_to_right():
    inner = BinaryTerm("+", NameTerm("Q1"), NameTerm("Q2"))
    assert parse("R1=Q1+Q2*Q3") == Statement("R1", (BinaryTerm("*", inner, NameTerm("Q3")),), equals=True)


@pytest.mark.parametrize("line", ["", "   ", "' remark", "`PG 1", "\t"])
def test_a_line_without_a_statement_is_none(line):
    assert parse(line) is None


@pytest.mark.parametrize("line", ["R15", "O11", "D15", "F12", "I15"])
def test_a_numbered_word_is_not_split_into_itself_and_a_digit(line):
    assert parse(line) == Statement(line)


def test_a_users_name_is_not_split():
    assert parse("H20 5", {"H20"}) == Statement("H20", (Number(5),))


@pytest.mark.parametrize(
    ("line", "code", "column"),
    [
        ("IS=1 0 0", 38, 5),
        ("MA 5)", 24, 4),
        ("R1=R2+", 24, 6),
        ('PR "abc', 24, 3),
        ("?5", 60, 0),
        ("MA 1e999", 24, 3),
        ("BR G1 <", 24, 7),
        ("VM=5000,", 24, 7),
        ("IS=1,1,", 24, 6),
        ('DN="a', 21, 3),
        ("PR ,P", 24, 3),
        ("PR P,", 24, 5),
        ('PR P,,"a"', 24, 5),
        ("PR P,;", 24, 5),
    ],
)
def test_an_illegal_line_says_its_code_and_column(line, code, column):
    with pytest.raises(LineError) as caught:
        parse(line)
    assert (caught.value.code, caught.value.column) == (code, column)


def test_a_remark_sign_in_a_text_is_text():
    assert strip("PR \"don't\" 'why") == 'PR "don\'t"'


@pytest.mark.parametrize(
    ("word", "good"), [("Q", 1), ("q1", 1), ("QQ", 1), ("Q12", 1), ("Q1A", 0), ("1Q", 0), ("QQQ", 0)]
)
def test_the_form_of_a_name(word, good):
    assert is_name(word) == bool(good)


@given(st.text())
def test_tokens_leave_out_nothing_but_spaces(line):
    at = 0
    for token in tokens(line):
        assert not line[at : token.start].strip(" \t\r\n\x0b\x0c")
        assert line[token.start : token.stop] == token.text
        at = token.stop
    assert not line[at:].strip(" \t\r\n\x0b\x0c")


@given(st.text(alphabet="MRAPBCLEXVIS0123456789=,<>+-*/&|^!\"'` ;.ab_", max_size=80))
def test_any_text_parses_or_is_a_line_error(line):
    try:
        parse(line)
    except LineError as error:
        assert error.code in (24, 38, 60) and error.why


# The canonical spelling


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
