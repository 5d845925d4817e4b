"""Warnings of `program check` on A-SCRIPT: what is never executed, and moves without WAIT."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.pmx.manual.program_file import check, formatted
from multidrop.families.pmx.manual.script_compiler import compile_
from multidrop.families.pmx.manual.script_parser import parse
from tests.support.cases import for_each
from tests.support.examples import examples
from tests.support.pmx_programs import EVERYTHING, EXAMPLES
from tests.support.sample_files import PMX


@for_each(
    "program, line, what",
    [
        ("WHILE 1=1\nDO1=1\nENDWHILE\nDO1=0\nDO2=0\nEND\n", 4, "DO1=0 is never executed"),
        ("IF 1=2\nDO1=1\nENDIF\nEND\n", 2, "DO1=1 is never executed"),
        ("IF 2>1\nDO1=1\nELSE\nDO2=1\nENDIF\nEND\n", 4, "DO2=1 is never executed"),
        ("WHILE 0=1\nDO1=1\nENDWHILE\nDO2=1\nEND\n", 2, "DO1=1 is never executed"),
        ("IF DI1=1\nWHILE 1=1\nENDWHILE\nDO1=1\nENDIF\nDO2=1\nEND\n", 4, "DO1=1 is never executed"),
        ("X5\nX0\nWAITX\nEND\n", 1, "X0 in line 2 does not wait for the end of this move"),
        ("X5Y5\nDO1=1\nY0\nWAITY\nEND\n", 1, "Y0 in line 3 does not wait for the end of this move"),
        ("HOMEX+\nPX=0\nEND\n", 1, "PX=0 in line 2 does not wait for the end of this move"),
        ("X5\nWAITY\nJOGX-\nEND\n", 1, "JOGX- in line 3 does not wait for the end of this move"),
        ("WHILE DI1=0\nX5\nENDWHILE\nEND\n", 2, "the next X5 begins before this one has ended"),
        ("X5\nIF DI1=1\nDO1=1\nENDIF\nX0\nEND\n", 1, "X0 in line 5 does not wait for the end of this move"),
        ("X5\nGOSUB 1\nX0\nEND\nSUB 1\nDO1=1\nENDSUB\n", 1, "X0 in line 3 does not wait for the end of this move"),
    ],
)
def test_a_warning_names_the_line(program: str, line: int, what: str) -> None:
    (only,) = check(program)
    assert (only.line, only.what, only.warning) == (line, what, True) and only.hint


@for_each(
    "program",
    [
        "X5\nWAITX\nX0\nEND\n",
        "X5Y5\nWAITX\nX0Y0\nWAITX\nEND\n",
        "X5\nY5\nWAITX\nWAITY\nEND\n",
        "X5\nDELAY=900\nX0\nEND\n",
        "X5\nSTOPX\nWAITX\nX0\nEND\n",
        "X5\nABORT\nX0\nEND\n",
        "X5\nWHILE MSTX!=0\nENDWHILE\nX0\nEND\n",
        "X5\nWHILE DI1=0\nENDWHILE\nX0\nEND\n",
        "X5\nV1=MSTX\nIF V1=0\nX0\nENDIF\nEND\n",
        "X5\nGOSUB 1\nX0\nGOSUB 1\nEND\nSUB 1\nWAITX\nENDSUB\n",
        "JOGX+\nSSPDX=500\nEND\n",
        "WHILE 1=1\nIF DI1=1\nX5\nWAITX\nELSEIF DI2=1\nX0\nWAITX\nELSE\nENDIF\nENDWHILE\nEND\n",
        "PRG 0\nWHILE 1=1\nENDWHILE\nEND\nPRG 1\nDO1=1\nEND\n",
        "DO1=1\nEND\nSUB 5\nX1\nENDSUB\n",  # a host may call it
    ],
)
def test_no_warning_on_what_people_mean(program: str) -> None:
    assert check(program) == []


def test_errors_and_warnings_are_reported_in_one_round() -> None:
    assert [(each.line, each.warning) for each in check("X5\nFOO\nWAITX\nX1\nX0\nEND\n")] == [(2, False), (4, True)]
    assert [each.line for each in check("X5\nX0\nIF DI1=1\nEND\n")] == [3]  # where a block ends, nothing is concluded


def test_programs_as_people_write_them_have_no_warnings() -> None:
    for text in (*EXAMPLES, *(file.read_text() for file in PMX)):
        assert check(text) == [], text


def test_a_formatted_program_has_its_remarks_and_the_same_lines() -> None:
    for text in (*EXAMPLES, EVERYTHING, *(file.read_text() for file in PMX if file.stem != "compiled")):
        spelled = formatted(text)
        assert formatted(spelled) == spelled
        assert compile_(parse(spelled)[0]).lines == compile_(parse(text)[0]).lines
        for old, new in zip(text.split("\n"), spelled.split("\n"), strict=True):
            assert old.partition(";")[2] == new.partition(";")[2]
    compiled = next(file.read_text() for file in PMX if file.stem == "compiled")
    assert formatted(compiled) == compiled


WORDS = st.sampled_from(
    ["PRG 0", "PRG 1", "END", "SUB 1", "ENDSUB", "IF DI1=1", "IF 1=2", "ELSEIF V1>2", "ELSE", "ENDIF", "WHILE 1=1"]
    + [
        "WHILE V1 < 3",
        "ENDWHILE",
        "X5",
        "X1Y2",
        "WAITX",
        "GOSUB 1",
        "GOSUB 2",
        "HOMEX+",
        "PX=0",
        "STOP",
        "foo",
        "V1=PX",
    ]
)


@examples(100, 3000)
@given(st.lists(WORDS, max_size=14))
def test_any_lines_are_checked_and_a_formatted_file_has_the_same_findings(lines: list[str]) -> None:
    text = "\n".join(lines)
    found = check(text)
    spelled = formatted(text)
    assert formatted(spelled) == spelled
    assert [(each.line, each.warning) for each in check(spelled)] == [(each.line, each.warning) for each in found]


@given(st.text(max_size=60))
def test_any_text_is_formatted_once(text: str) -> None:
    spelled = formatted(text)
    assert formatted(spelled) == spelled and check(text) is not None
