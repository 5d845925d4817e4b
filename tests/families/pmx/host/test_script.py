"""A-SCRIPT: what is read, what is told of what is wrong, compiled lines and back, and the canonical spelling."""

from __future__ import annotations

import csv
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects.program_files import errors
from multidrop.families.pmx.manual import program_file, script_checker
from multidrop.families.pmx.manual.program_file import canonical
from multidrop.families.pmx.manual.script_compiler import compile_
from multidrop.families.pmx.manual.script_parser import BLOCKS, WORDS, parse
from tests.support.cases import for_each
from tests.support.examples import examples
from tests.support.paths import FACTS
from tests.support.pmx_programs import EVERYTHING, EXAMPLES, THERE_AND_BACK, plain


@pytest.mark.parametrize("text", [*EXAMPLES, EVERYTHING])
def test_a_program_comes_back_from_its_lines(text: str) -> None:
    assert errors(script_checker.check(text)) == []
    made = script_checker.read(text, "x.prg")
    back = program_file.decompile(made.code)
    assert plain("\n".join(back)) == plain(text)
    assert tuple(script_checker.read("\n".join(back), "y").code) == made.code
    assert program_file.decompile([*made.code, "0", "0"]) == back


def test_known_tokens_are_the_publicly_known_ones() -> None:
    text = "PRG 0\nWHILE V1<10\nIF DI1=1\nV1=V2+1000\nELSE\nDELAY=5\nENDIF\nENDWHILE\nWAITX\nEND\nSUB 3\nENDSUB"
    made = script_checker.read(text, "x").code
    assert " ".join(made) == (
        "PS0 VR1 CV10 JW2$2 JR13 &DI1$0 CV1 JI3$2 JR6 CV1000 VR2 VR1 OX1 JO2 DD5 EI0 JM-13 WX0 XX SS3 SE"
    )


def test_every_compiled_line_names_its_line_in_the_file() -> None:
    made = script_checker.read(THERE_AND_BACK, "x")
    assert len(made.source) == len(made.code)
    assert (made.source[0], made.source[-1]) == (2, 10)


WRONG = [
    ("PRG 0\nX1000\n", (1, 1), "PRG is never ended", "END"),
    ("X1\nWAITX", (2, 1), "no END", ""),
    ("IF DI1=1\nX1\nEND", (1, 1), "IF is never ended", "ENDIF is missing"),
    ("  WHILE 1=1\nX1\nEND", (1, 3), "WHILE is never ended", "ENDWHILE is missing"),
    ("IF 1=1\nENDWHILE\nENDIF\nEND", (2, 1), "ENDWHILE without WHILE", ""),
    ("IF 1=1\nWHILE 1=1\nENDIF\nENDWHILE\nEND", (2, 1), "WHILE is never ended", ""),
    ("ENDIF\nEND", (1, 1), "ENDIF without IF", ""),
    ("IF 1=1\nELSE\nELSEIF 1=2\nENDIF\nEND", (3, 1), "ELSEIF after the ELSE", ""),
    ("IF 1=1\nELSE\nELSE\nENDIF\nEND", (3, 1), "ELSE after the ELSE", ""),
    ("GOSUB 4\nEND", (1, 7), "SUB 4 is not defined", ""),
    ("SUB 1\nSUB 2\nENDSUB\nEND", (2, 1), "SUB 2 inside of SUB 1", "ENDSUB"),
    ("SUB 1\nENDSUB\nSUB 1\nENDSUB\nEND", (3, 1), "there is a SUB 1 already, in line 1", ""),
    ("SUB 1\nEND", (2, 1), "ended by END", "ENDSUB"),
    ("END\nX1\nEND", (2, 1), "outside", ""),
    ("PRG 0\nEND\nX1\nWAITX", (3, 1), "outside", ""),
    ("PRG 2\nEND", (1, 5), "no PRG 2", ""),
    ("SUB 32\nENDSUB\nEND", (1, 5), "no SUB 32", ""),
    (" FROB\nEND", (1, 2), "unknown command FROB", ""),
    ("WATIX\nEND", (1, 1), "unknown command WATIX", "WAITX"),
    ("waitx\nEND", (1, 1), "not all in capitals", "WAITX"),
    ("V64=1\nEND", (1, 1), "no V64", ""),
    ("EO3=1\nEND", (1, 1), "no EO3", ""),
    ("JOGZ+\nEND", (1, 1), "no axis Z", ""),
    ("X1U2\nEND", (1, 3), "no axis U", ""),
    ("DO=256\nEND", (1, 4), "256 is out of range", "0 to 255"),
    ("V1=2147483648\nEND", (1, 4), "out of range", ""),
    (f"V1={'9' * 5000}\nEND", (1, 4), "out of range", ""),
    (f"PRG {'9' * 5000}\nEND", (1, 5), "no PRG", ""),
    ("V1=V2+V3+V4\nEND", (1, 4), "one operation", ""),
    ("DO=V1+1\nEND", (1, 4), "DO takes no operation", "V0=V1+1"),
    ("DO=DI\nEND", (1, 4), "DI is a register", "V0=DI"),
    ("V1=SSPDX\nEND", (1, 4), "cannot be read", ""),
    ("MSTX=1\nEND", (1, 1), "cannot be set", "only be read"),
    ("IF DI1\nENDIF\nEND", (1, 4), "needs a condition", ""),
    ("X1 WAITX\nEND", (1, 1), "", ""),
    ("V1=1 \u00b5\nEND", (1, 6), "no character", ""),
    ("; nothing\n\n", (1, 1), "holds no program", ""),
]


@for_each(("text", "place", "what", "hint"), WRONG)
def test_what_is_wrong_is_told_with_line_and_column(text: str, place: tuple[int, int], what: str, hint: str) -> None:
    first, *_ = script_checker.check(text)
    assert (first.line, first.column) == place
    assert what in first.what and hint in first.hint and not first.warning
    with pytest.raises(Diagnostic, match=rf"^a\.prg:{place[0]}:{place[1]}: "):
        script_checker.read(text, "a.prg")


def test_every_problem_of_a_file_is_told_and_each_once() -> None:
    problems = script_checker.check("PRG 0\nFOO\nIF DI1=1\nGOSUB 9\nX1000\nEND\nX5\nX6\n")
    assert [each.line for each in problems] == [2, 3, 4, 7]


FOLLOWING = [
    ("IF DI1\nX1\nELSE\nX2\nENDIF\nEND", [1]),
    ("PRG 0\nWHILE V1<\nIF V1=1=2\nX1\nENDIF\nENDWHILE\nEND", [2, 3]),
    ("PRG 0\nIF V1=1\nX1\nELSEIF\nX2\nENDIF\nEND", [4]),
    ("PRG 0\nWHILE V1<3\nX1\nENDWHLE\nEND", [4]),
    ("WHILE V1<3\nX1\nendwhile\nEND", [3]),
    ("while V1<3\nX1\nENDWHILE\nEND", [1]),
    ("PRG 2\nX1\nEND\nSUB 1\nENDSUB", [1]),
    ("PRG 0\nGOSUB 3\nEND\nSUB 33\nX1\nENDSUB", [4]),
    ("PRG 0\nGOSUB 3\nEND\nSUB 3 X1\nENDSUB", [4]),
    ("'*** a lamp\nPRG 0\nX1\nEND", [1]),
    ("'*** a lamp\nX1\nEND\nX2\nEND", [1, 4]),
    ("// a lamp\n# another\n` and one\nX1\nEND", [1, 2, 3]),
    ("IF DI1=1 ' on\nX1\nENDIF ' off\nEND ' all", [1, 3, 4]),
    ("FROB\nEND\nX5\nEND", [1, 3]),
    ("SUB 1\nENDSUB\nFROB\nEND", [3]),
    ("PRG 0\nEND\nFROB\nX1\nX2\nEND", [3, 4]),
]


@pytest.mark.parametrize(("text", "lines"), FOLLOWING)
def test_what_follows_from_an_error_that_was_told_is_not_told(text: str, lines: list[int]) -> None:
    assert [each.line for each in script_checker.check(text)] == lines


@pytest.mark.parametrize(
    ("line", "column", "sign"), [("'***x", 1, "'"), ("  X1 ' far", 6, "'"), ("//", 1, "//"), ("`", 1, "`")]
)
def test_a_remark_of_another_language_is_told_as_one(line: str, column: int, sign: str) -> None:
    (only,) = script_checker.check(f"PRG 0\n{line}\nEND")
    assert (only.line, only.column, only.what) == (2, column, f"{sign} begins no remark in A-SCRIPT")
    assert only.hint == "remarks begin with ;"


def test_an_end_after_the_last_endsub_is_accepted_and_compiles_to_nothing() -> None:
    plainly = "PRG 0\nGOSUB 1\nEND\nSUB 1\nX1\nENDSUB\n"
    assert script_checker.check(plainly + "\nEND ; all\n") == []
    assert script_checker.read(plainly + "END", "x").code == script_checker.read(plainly, "x").code
    (only,) = script_checker.check(plainly + "END\nSUB 2\nENDSUB")
    assert (only.line, only.what) == (7, "END without a PRG")
    assert [each.line for each in script_checker.check(plainly + "END\nEND")] == [7, 8]


def test_a_subroutine_that_calls_itself_is_a_warning() -> None:
    (only,) = script_checker.check("GOSUB 1\nEND\nSUB 1\nGOSUB 2\nENDSUB\nSUB 2\nGOSUB 1\nENDSUB")
    assert only.warning and only.line == 7 and "SUB 1" in only.what
    assert script_checker.read("GOSUB 1\nEND\nSUB 1\nGOSUB 1\nENDSUB", "x").warnings


def test_a_program_that_does_not_fit_is_told_with_the_line_where_the_memory_ends() -> None:
    fits = "X1\n" * 637 + "END\n"
    assert errors(script_checker.check(fits)) == []
    (only,) = errors(script_checker.check("X1\n" * 638 + "END\n"))
    assert "1277 lines compiled" in only.what and "1275" in only.what and only.line == 638


@pytest.mark.parametrize(
    "lines",
    [
        ["&12$5", "XX"],
        ["CV5", "XX"],
        ["AM", "XX"],
        ["CV1", "CV1", "JI3$2", "XX"],
        ["EI0"],
        ["JO5", "XX"],
        ["?"],
        ["VR2", "CV1000", "OX1", "VR1", "AM", "XX"],
        ["CV1", "CV2", "AM", "XX"],
        ["CV1", "&DI$0", "AM", "XX"],
        ["VR1", "VR2", "JW3$2", "JR2", "JM-4", "XX"],
        ["&84$250000", "XX"],
        ["WX0", "SE"],
        ["JR2", "XX", "XX"],
    ],
)
def test_lines_of_a_unit_are_not_taken_for_ours(lines: list[str]) -> None:
    with pytest.raises(program_file.Undecodable):
        program_file.decompile(lines)


@given(st.text(alphabet=" \nXYV0123456789=+-<>!;~&|IFELSENDWHTPRGOUBQ", max_size=80))
def test_no_text_makes_the_reader_fail(text: str) -> None:
    parse(text)
    script_checker.check(text)


TOKENS = [
    "CV1",
    "VR2",
    "AM",
    "OX1",
    "OX10",
    "JI3$2",
    "JW2$2",
    "JR2",
    "JR3",
    "JO2",
    "JM-2",
    "&ACC=$5",
    "EI0",
    "XX",
    "SE",
    "PS0",
    "SS1",
    "&DI$0",
    "&X$1",
    "&XY$2",
    "0",
    "DD5",
    "GS1",
]


@given(st.lists(st.sampled_from([*TOKENS, ""]), max_size=12))
def test_what_can_be_decompiled_compiles_to_the_same_lines(lines: list[str]) -> None:
    try:
        text = "\n".join(program_file.decompile(lines))
        made = script_checker.read(text, "x").code
    except (program_file.Undecodable, Diagnostic):
        return
    assert list(made) == lines[: len(made)] and set(lines[len(made) :]) <= {"0"}


@st.composite
def bodies(draw: st.DrawFn, depth: int = 3) -> list[str]:
    value = st.one_of(st.integers(-(2**31), 2**31 - 1).map(str), st.sampled_from(["V0", "V63", "DI1", "MSTX", "PY"]))
    simple = st.one_of(
        st.builds("V{}={}{}{}".format, st.integers(0, 63), value, st.sampled_from(["+", "-", ">>", "|", "%"]), value),
        st.builds("X{}YV{}".format, st.integers(-9, 9), st.integers(0, 63)),
        st.sampled_from([word for word, each in WORDS.items() if each.command]),
        st.sampled_from(["WAITX", "WAITY", "DELAY=V3", "DELAY=4294967295", "DO=V1", "V1=~DI"]),
    )
    lines: list[str] = []
    for _ in range(draw(st.integers(0, 4))):
        kind = draw(st.sampled_from("ssiw" if depth else "s"))
        condition = f"{draw(value)}{draw(st.sampled_from(['=', '<', '!=', '>=']))}{draw(value)}"
        if kind == "s":
            lines.append(draw(simple))
        elif kind == "w":
            lines += [f"WHILE {condition}", *draw(bodies(depth - 1)), "ENDWHILE"]
        else:
            lines += [f"IF {condition}", *draw(bodies(depth - 1))]
            for _ in range(draw(st.integers(0, 2))):
                lines += [f"ELSEIF {condition}", *draw(bodies(depth - 1))]
            if draw(st.booleans()):
                lines += ["ELSE", *draw(bodies(depth - 1))]
            lines.append("ENDIF")
    return lines


@pytest.mark.slow
@examples(15, nightly=300)
@given(bodies())
def test_any_program_comes_back_from_its_lines(body: list[str]) -> None:
    text = ["PRG 1", *body, "END"]
    made = script_checker.read("\n".join(text), "x").code
    assert [line.strip() for line in program_file.decompile(made)] == text


TABLE_OF_FACTS = FACTS / "pmx-standalone-commands.csv"


@pytest.mark.skipif(not TABLE_OF_FACTS.is_file(), reason="the facts are not here")
def test_every_command_of_the_manual_is_a_word() -> None:
    state = {*WORDS, *BLOCKS, "WAITX", "WAITY", "X", "Y", "XY", ";"}
    with open(TABLE_OF_FACTS, encoding="utf-8") as file:
        for row in csv.DictReader(file):
            for name in row["command"].split():
                name = name.replace("X[position]", "X").replace("Y[position]", "Y").replace("X[pos]Y[pos]", "XY")
                name = re.sub(r"\[(\d)-\d+\]", r"\1", name.replace("[axis]", "X").replace("[+/-]", "-"))
                assert name in state or name.isdigit(), row["command"]


# The canonical spelling


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
