"""Compiled lines as the maker's compiler writes them: what each operand is, where loops go back to, what is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.pmx.manual import program_file, script_checker
from multidrop.families.pmx.manual.script_compiler import MEMORY_LINES, OPERATION, looks_compiled, split
from multidrop.families.pmx.manual.script_parser import WORDS
from multidrop.families.pmx.simulator.device import PmxDevice
from multidrop.families.pmx.simulator.programs import PmxInterpreter
from multidrop.simulator.cell.spec import DriveSpec

IDLE, RUNNING, ERROR = 0, 1, 4


def ran(*lines: str, until: float = 10.0, **variables: int) -> PmxInterpreter:
    """Program 0 of a controller whose memory holds these lines, after some seconds."""
    spec = DriveSpec(personality="PMX", name="00")
    made = PmxDevice(spec).programs
    made.memory.load(lines)
    for name, value in variables.items():
        made.variables[int(name[1:])] = value
    made.control(0, 1, 0.0)
    made.advance(until)
    return made


def code(text: str) -> str:
    return " ".join(script_checker.read(text, "x").code)


@pytest.mark.parametrize(
    ("statement", "lines"),
    [
        ("V10=V1*10", "CV10 VR1 VR10 OX3"),
        ("V10=10-V1", "VR1 CV10 VR10 OX2"),
        ("V2=MSTX&2048", "CV2048 &MSTX$0 VR2 OX8"),
        ("V3=~V4", "VR4 VR3 OX10"),
        ("V3=V4", "VR4 VR3 AM"),
        ("V3=-7", "CV-7 VR3 AM"),
        ("HSPD=250000", "&HSPD=$250000"),
        ("PX=-5", "&PX=$-5"),
        ("HSPD=V1", "VR1 &HSPD$0 AM"),
    ],
)
def test_each_statement_as_lines(statement: str, lines: str) -> None:
    assert code(f"{statement}\nEND") == f"{lines} XX"
    assert program_file.decompile([*lines.split(), "XX"]) == [statement, "END"]


@pytest.mark.parametrize(
    ("op", "gives"), [("+", 13), ("-", 7), ("*", 30), ("/", 3), ("%", 1), (">>", 1), ("<<", 80), ("&", 2), ("|", 11)]
)
def test_an_operation_takes_right_then_left_then_its_target(op: str, gives: int) -> None:
    made = ran("CV3", "VR1", "VR10", f"OX{OPERATION[op]}", "XX", V1=10)
    assert made.status(0) == IDLE and (made.variables[1], made.variables[10]) == (10, gives)


def test_endwhile_goes_back_to_the_jw_which_reads_its_two_values_anew() -> None:
    made = ran("VR1", "CV5", "JW2$2", "JR6", "CV1", "VR1", "VR1", "OX1", "JM-6", "CV99", "VR2", "AM", "XX")
    assert made.status(0) == IDLE and made.variables[1:3] == [5, 99]
    assert code("WHILE V1<5\nV1=V1+1\nENDWHILE\nV2=99\nEND") == (
        "VR1 CV5 JW2$2 JR6 CV1 VR1 VR1 OX1 JM-6 CV99 VR2 AM XX"
    )


def test_the_speed_is_one_line() -> None:
    made = ran("&HSPD=$250000", "&HSPD$0", "VR1", "AM", "XX")
    assert made.variables[1] == 250000


UNKNOWN = {
    "a unit's number for the speed": "&84$250000 <",
    "a value that nothing takes": "CV5 WX0 <",
    "a value that nothing takes before a register is set": "CV5 &DO=$1 <",
    "one value too many": "CV1 CV2 VR3 AM <",
    "an operation that leaves its result to AM": "VR2 CV1000 OX1 < VR1 AM",
    "an operation into a register": "CV1 CV2 &DO$0 OX1 <",
    "a loop that goes back to its first value": "VR1 VR2 JW3$2 JR2 JM-4 <",
    "a loop that goes back to an IF": "VR1 VR2 JI3$2 JR2 JM-2 <",
    "a loop that goes back to before the memory": "JM-5 <",
    "an operation with another number": "CV1 VR1 VR2 OX11 <",
    "a comparison with another number": "CV1 VR1 JI7$2 <",
    "a comparison of three": "CV1 VR1 JI1$3 <",
    "a number of 33 bits": "CV4294967296 < VR1 AM",
    "a jump to itself": "JR0 <",
    "a variable too many": "CV1 VR64 < AM",
    "another end of IF": "EI1 <",
}


@pytest.mark.parametrize("text", UNKNOWN.values(), ids=UNKNOWN)
def test_what_is_not_known_ends_in_an_error_that_names_its_line(text: str) -> None:
    wrong = text.split().index("<")
    lines = text.replace(" <", "").split()
    made = ran("EI0", *lines, "XX")
    (failure,) = made.failures
    assert made.status(0) == ERROR and not any(made.variables)
    assert made.failure(0).endswith(f" at line {wrong}") and 1 <= failure.line <= wrong
    with pytest.raises(program_file.Undecodable):
        program_file.decompile([*lines, "XX"])


def test_no_line_of_a_script_is_taken_for_a_compiled_one() -> None:
    lines = [name if word.command else f"{name}=1" for name, word in WORDS.items()]
    lines += ["X1000", "Y-5", "X1Y2", "XV1", "IF V1=1", "ENDIF", "END", "PRG 0", "SUB 31", "ENDSUB", "DELAY=5", "WAITX"]
    assert not any(looks_compiled(line) for line in lines)


TOKENS = st.one_of(
    st.sampled_from(
        ["CV1", "CV-3", "VR1", "VR2", "AM", "OX1", "OX2", "OX10", "JI3$2", "JW1$2", "JR1", "JR2", "JR5", "JO2", "JM-2",
         "JM-5", "EI0", "PS0", "PS1", "SS31", "SE", "GS31", "DD1", "DV1", "WX0", "WX1", "XX", "&DI$0", "&DO=$1",
         "&X$1", "&XY$2", "&STORE$0", "&84$5", "0"]
    ),
    st.from_regex(r"[A-Z&]{1,3}-?[0-9]{0,12}(\$[0-9]{1,3})?", fullmatch=True).filter(lambda token: len(token) <= 24),
)  # fmt: skip


@given(st.lists(TOKENS, max_size=14))
def test_any_lines_are_run_or_refused_and_read_as_what_they_are(lines: list[str]) -> None:
    ran(*lines, until=0.05)
    try:
        text = program_file.decompile(lines)
    except program_file.Undecodable:
        return
    if text:
        again = script_checker.read("\n".join(text), "x").code
        assert list(again) == lines[: len(again)] and set(lines[len(again) :]) <= {"0"}


# Files of bare lines.

BARE = "; copied from the maker's window\nPS0\n&HSPD=$5000 ; ours\n\nCV10\nVR1\nVR10\nOX3\nXX\n"


def test_lines_without_places_are_the_memory_from_its_beginning() -> None:
    assert program_file.memory(BARE, "a.prg") == ["PS0", "&HSPD=$5000", "CV10", "VR1", "VR10", "OX3", "XX"]
    assert program_file.compiled(program_file.read(BARE, "a.prg"))[1] == (3, 1, "&HSPD=$5000")
    assert program_file.check(BARE) == []


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("PS0\nX1000\nXX\n", 2, "'X1000' is not a compiled line, but others are"),
        ("PS0\nSA1=XX\nXX\n", 1, "'PS0' is not a compiled line, but others are"),
        ("CV10 VR1 VR10 OX3\nXX\nXX\n", 1, "is not a compiled line"),
        ("PS0\n" + "EI0\n" * MEMORY_LINES, MEMORY_LINES + 1, "1276 compiled lines, and the controller holds 1275"),
        (f"PS0\n&{'A' * 40}$1\nXX", 2, "40 printable characters at most"),
    ],
)
def test_what_is_wrong_with_bare_lines_is_told_by_line(text: str, line: int, says: str) -> None:
    first, *_ = program_file.check(text)
    assert first.line == line and says in first.what and not first.warning


def test_lines_that_only_a_unit_knows_are_a_warning_once() -> None:
    for text in ("PS0\n&84$250000\n&85$1\nXX\n", "SA0=PS0\nSA1=&84$250000\nSA2=&85$1\nSA3=XX\n"):
        (only,) = program_file.check(text)
        assert only.warning and only.line == 2
        assert only.what == "the simulated controller ends in an error at &84$250000, and at 1 more"
    assert program_file.check("SA0=XX\nSA1=\nSA2=XX0\nSA3=FF\n") == []


@given(st.integers(0, 63), st.integers(-(2**31), 2**31 - 1), st.sampled_from(sorted(OPERATION)))
def test_every_operation_of_a_variable_survives_its_lines(target: int, value: int, op: str) -> None:
    statement = f"V{target}=~{value}" if op == "~" else f"V{target}={value}{op}V1"
    made = script_checker.read(f"{statement}\nEND", "x").code
    assert all(split(token) for token in made)
    assert program_file.decompile(made) == [statement, "END"]
