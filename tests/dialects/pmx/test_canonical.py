"""The canonical spelling of a line of A-SCRIPT."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.pmx.manual.program_file import canonical
from multidrop.dialects.pmx.manual.script_compiler import compile_
from multidrop.dialects.pmx.manual.script_parser import parse
from tests.support.cases import for_each
from tests.support.pmx_programs import EVERYTHING, EXAMPLES


@for_each(
    "typed, spelled",
    [
        ("  HSPD = 20000 ; pulses/s", "HSPD=20000"),
        ("WHILE  V1 <  010", "WHILE V1<10"),
        ("X 100 Y -200", "X100Y-200"),
        ("V1 = ~ DO", "V1=~DO"),
        ("V1=V2  >> 3", "V1=V2>>3"),
        ("GOSUB   07", "GOSUB 7"),
        ("WAITX  ", "WAITX"),
        ("DELAY = V4", "DELAY=V4"),
        ("; nothing", ""),
        (" SA0=PS0 ", "SA0=PS0"),
        (" hspd=5 ", "hspd=5"),
    ],
)
def test_a_statement_has_one_spelling(typed: str, spelled: str) -> None:
    assert canonical(typed) == spelled
    assert canonical(spelled) == spelled


def test_a_program_in_canonical_spelling_compiles_to_the_same_lines() -> None:
    for program in (*EXAMPLES, EVERYTHING):
        spelled = "\n".join(canonical(line) for line in program.splitlines())
        assert compile_(parse(spelled)[0]).lines == compile_(parse(program)[0]).lines


@given(st.text(max_size=30))
def test_any_text_has_a_spelling(text: str) -> None:
    assert canonical(canonical(text)) == canonical(text)
