"""Conditions beyond the manual's one comparison: one reading, the same in checker, simulator and help."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.lexium.manual.grammar import parse
from multidrop.families.lexium.manual.help import LANGUAGE
from multidrop.families.lexium.manual.program_checker import check
from multidrop.families.lexium.manual.statements import condition_of, condition_reading, is_mixed
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World
from tests.support.cases import for_each

FORMS = [
    ("R1=1&MV", "(R1=1)&MV"),
    ("KF & 12 = 12", "(KF&12)=12"),
    ("I1=1&I2=1", "((I1=1)&I2)=1"),
    ("I1=1|I2=1|I3=1", "((((I1=1)|I2)=1)|I3)=1"),
    ("P<R1+100&MV", "(P<(R1+100))&MV"),
    ("P<R1*2-1^I1", "(P<((R1*2)-1))^I1"),
    ("R1=1&MV+2", "((R1=1)&MV)+2"),
    ("R1>5=R2<>1", "((R1>5)=R2)<>1"),
    ("R1&R2|R3=<7+1", "((R1&R2)|R3)<=(7+1)"),
    ("!I1=1", "(!I1)=1"),
    ("-R1=5&!R2", "(-R1=5)&(!R2)"),
    ("F1>2.5&CS R1=1", "((F1>2.5)&CS R1)=1"),
]
PLAIN = ["R1=1", "P<R1+100", "P<R1*2-1", "R1+R2*3>=4", "AF&2", "MV", "R1|R2^7", "!R1", "V >=0", "R1=-5"]


def mixed(form: str) -> str | None:
    statement = parse(f"BR X1,{form}")
    assert statement is not None
    condition = condition_of(statement)
    assert condition is not None
    return condition_reading(condition) if is_mixed(condition) else None


@pytest.mark.parametrize(("form", "read"), FORMS)
def test_a_mixed_condition_is_read_from_left_to_right(form: str, read: str) -> None:
    assert mixed(form) == read


@pytest.mark.parametrize("form", PLAIN)
def test_what_the_manual_shows_is_not_mixed(form: str) -> None:
    assert mixed(form) is None


@for_each("word", ["BR", "CL"])
@for_each(("form", "read"), FORMS)
def test_check_warns_on_each_mixed_form_and_says_how_it_is_read(form: str, read: str, word: str) -> None:
    (told,) = check(f"VA KF\nPG 1\nLB K1\n {word} K1,{form}\nE\nPG\n")
    assert told.warning and told.line == 4 and f" is read as {read}" in told.what


@pytest.mark.parametrize("form", PLAIN)
def test_check_says_nothing_of_what_the_manual_shows(form: str) -> None:
    assert check(f"PG 1\nLB K1\nBR K1,{form}\nE\nPG\n") == []


def test_help_says_the_same_while_the_line_is_typed() -> None:
    assert [LANGUAGE.hint(f"CL K1,{form}") for form, _ in FORMS] == [f"read as {read}" for _, read in FORMS]
    assert LANGUAGE.hint("BR K1,P<R1+100").startswith("BR <label/address>[,<condition>]")
    for product in ("", "LMDCM", "MDI", "MDIX"):
        for word in ("BR", "CL"):
            assert any("R1=1&MV as (R1=1)&MV" in line for line in LANGUAGE.describe(word, product)), (word, product)


# -- the simulated drive


def holds(form: str, values: dict[str, int], personality: str = "LMDCM") -> bool:
    """Whether a drive whose variables have these values goes where BR says."""
    spec = DriveSpec(personality=personality, world=WorldSpec())
    device = MCodeDevice(spec, World(spec.world))
    device.prints()
    setting = [f"{name}={value}" for name, value in values.items()]
    for line in (*setting, "PG 1", f"BR X1,{form}", 'PR "no"', "E", "LB X1", 'PR "yes"', "E", "PG", "EX 1"):
        assert not device.execute(line, 0.0).refused, line
    device.advance(1.0)
    return [text for _, text in device.prints()] == ["yes\r\n"]


@for_each("personality", ["LMDCM", "LMM", "MDI"])
@for_each(
    ("form", "values", "so"),
    [
        ("R1=1&R2", {"R1": 1, "R2": 1}, True),
        ("R1=1&R2", {"R1": 1, "R2": 2}, False),  # (R1=1)&2
        ("R1=1&R2", {"R1": 3, "R2": 3}, False),
        ("R1=1&R2", {"R1": 0, "R2": 2}, False),  # not R1=(1&2)
        ("R1&12=12", {"R1": 13}, True),
        ("R1&12=12", {"R1": 8}, False),
        ("R1=1&R2=1", {"R1": 1, "R2": 1}, True),
        ("R1=1&R2=1", {"R1": 0, "R2": 1}, False),
        ("R1=1|R2=1", {"R1": 5, "R2": 1}, True),
        ("R1<R2+100&R3", {"R1": 101, "R2": 2, "R3": 1}, True),
        ("R1<R2+100&R3", {"R1": 102, "R2": 2, "R3": 1}, False),
        ("R1=1^R2", {"R1": 1, "R2": 1}, False),
    ],
)
def test_a_drive_does_what_the_reading_says(form: str, values: dict[str, int], so: bool, personality: str) -> None:
    assert holds(form, values, personality) is so


def test_each_side_of_a_comparison_has_its_own_arithmetic() -> None:
    assert holds("F1=2.5&R1", {"R1": 1}) is False
    assert holds("7/2=3&R1", {"R1": 1}) is True
    assert holds("F1+7/2=3.5&R1", {"R1": 1}) is True


@pytest.mark.parametrize("line", ["R1=R2=1&R3", "MR R1=1&2", "PR R1=1&R2", "R1=R2>1", "SL R1=1|1"])
def test_a_comparison_outside_of_a_condition_is_illegal(line: str) -> None:
    device = MCodeDevice(DriveSpec(), World(WorldSpec()))
    for _ in range(2):
        assert device.execute(line, 0.0).refused and device.memory.values["ER"] == 24
        device.execute("PG 1", 0.0)


def test_the_value_of_va_is_an_expression_and_no_condition() -> None:
    device = MCodeDevice(DriveSpec(), World(WorldSpec()))
    assert device.execute("VA Q1=7&3", 0.0).lines == () and device.execute("PR Q1", 0.0).lines == ("3",)


REGISTERS = ("R1", "R2", "R3", "R4")
OPERATOR = st.sampled_from(["+", "-", "*", "/", "&", "|", "^", "=", "<>", "<", "<=", ">", ">="])
OPERAND = st.sampled_from(REGISTERS) | st.integers(0, 9).map(str)
SMALL = st.integers(-3, 12)


@st.composite
def chains(draw: st.DrawFn) -> str:
    parts = [draw(st.sampled_from(["", "-", "!"])) + draw(OPERAND)]
    for _ in range(draw(st.integers(1, 6))):
        parts += [draw(OPERATOR), draw(st.sampled_from(["", "", "!"])) + draw(OPERAND)]
    return draw(st.sampled_from(["", " "])).join(parts)


def wrapped(value: int) -> int:
    return (value + 2**31) % 2**32 - 2**31


class Brackets:
    """A bracketed reading, worked out by its brackets alone: each pair holds one operation. Division drops the rest."""

    def __init__(self, text: str, values: dict[str, int]) -> None:
        self.found, self.values = re.findall(r"<>|<=|>=|\d+|R\d|\S", text), values

    def operation(self) -> int:
        value = self.operand()
        if self.found and self.found[0] != ")":
            value = self.applied(self.found.pop(0), value, self.operand())
        assert not self.found or self.found[0] == ")", "more than one operation in a pair of brackets"
        return value

    def operand(self) -> int:
        head = self.found.pop(0)
        if head == "(":
            value = self.operation()
            assert self.found.pop(0) == ")"
            return value
        if head in "-!":
            value = self.operand()
            return wrapped(-value) if head == "-" else ~value
        return self.values[head] if head in self.values else int(head)

    def applied(self, op: str, left: int, right: int) -> int:
        if op == "/":
            whole = abs(left) // abs(right)
            return wrapped(-whole if (left < 0) != (right < 0) else whole)
        compared = {"=": "==", "<>": "!="}.get(op, op)
        return wrapped(int(eval(f"({left}) {compared} ({right})")))


@given(chains(), st.tuples(SMALL, SMALL, SMALL, SMALL))
def test_the_bracketed_reading_comes_to_the_same_as_the_flat_form(form: str, given: tuple[int, ...]) -> None:
    values = dict(zip(REGISTERS, given, strict=True))
    statement = parse(f"BR X1,{form}")
    condition = condition_of(statement) if statement else None
    assert condition is not None
    try:
        expected = Brackets(condition_reading(condition), values).operation() != 0
    except ZeroDivisionError:
        return
    assert holds(form, values) is expected
