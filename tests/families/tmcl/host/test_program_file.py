"""Files of TMCL programs: bytes of each word, faults with their lines, warnings, spelling, memory made into a file."""

from __future__ import annotations

import json
import subprocess
from struct import pack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.files import SourceLine
from multidrop.dialects.families import correct_in, program_language_of
from multidrop.dialects.program_files import errors
from multidrop.families.tmcl.manual import instructions, program_file
from multidrop.families.tmcl.manual.commands import TmclCall
from multidrop.families.tmcl.manual.editing import EDITING
from multidrop.families.tmcl.manual.program_file import assembled, check, compiled, disassembled, formatted
from tests.support.cases import for_each
from tests.support.examples import examples
from tests.support.foreign_python import TABLES_ONLY, foreign_python
from tests.support.sample_files import TMCL
from tests.support.until import PATIENCE

WORDS = [  # the worked examples of the TMCM-1290 manual, and each further word
    ("ROR 0, 51200", "01 00 00 00 00 C8 00"),
    ("MVP COORD, 0, 8", "04 02 00 00 00 00 08"),
    ("SAP 4, 0, 51200", "05 04 00 00 00 C8 00"),
    ("SGP 66, 0, 3", "09 42 00 00 00 00 03"),
    ("STGP 42, 2", "0B 2A 02 00 00 00 00"),
    ("RFS START, 0", "0D 00 00 00 00 00 00"),
    ("SIO 0, 2, 1", "0E 00 02 00 00 00 01"),
    ("GIO 0, 1", "0F 00 01 00 00 00 00"),
    ("CALC MUL, -5000", "13 02 00 FF FF EC 78"),
    ("COMP 1000", "14 00 00 00 00 03 E8"),
    ("JC GE, 10", "15 05 00 00 00 00 0A"),
    ("JC ESD, 10", "15 0C 00 00 00 00 0A"),
    ("JA 10", "16 00 00 00 00 00 0A"),
    ("CSUB 100", "17 00 00 00 00 00 64"),
    ("RSUB", "18 00 00 00 00 00 00"),
    ("EI 255", "19 FF 00 00 00 00 00"),
    ("DI 0", "1A 00 00 00 00 00 00"),
    ("WAIT POS, 0, 0", "1B 01 00 00 00 00 00"),
    ("WAIT TICKS, 0, -1", "1B 00 00 FF FF FF FF"),
    ("STOP", "1C 00 00 00 00 00 00"),
    ("SCO 1, 0, 1000", "1E 01 00 00 00 03 E8"),
    ("GCO 1, 0", "1F 01 00 00 00 00 00"),
    ("CCO 3, 0", "20 03 00 00 00 00 00"),
    ("CALCX SWAP", "21 0A 00 00 00 00 00"),
    ("AAP 0, 0", "22 00 00 00 00 00 00"),
    ("AGP 42, 2", "23 2A 02 00 00 00 00"),
    ("CLE ETO", "24 01 00 00 00 00 00"),
    ("VECT 0, 50", "25 00 00 00 00 00 32"),
    ("RETI", "26 00 00 00 00 00 00"),
    ("ACO 1, 0", "27 01 00 00 00 00 00"),
    ("CALCVV SUB, 65, 42", "28 01 41 00 00 00 2A"),
    ("CALCVA SUB, 27", "29 01 1B 00 00 00 00"),
    ("CALCAV SUB, 27", "2A 01 1B 00 00 00 00"),
    ("CALCVX SUB, 27", "2B 01 1B 00 00 00 00"),
    ("CALCXV COMP, 27", "2C 0B 1B 00 00 00 00"),
    ("CALCV SUB, 27, 5000", "2D 01 1B 00 00 13 88"),
    ("MVPA REL, 0", "2E 01 00 00 00 00 00"),
    ("RST 10", "30 00 00 00 00 00 0A"),
    ("DJNZ 42, 1", "31 2A 00 00 00 00 01"),
    ("ROLA 0", "32 00 00 00 00 00 00"),
    ("RORA 1", "33 00 01 00 00 00 00"),
    ("SIV 3", "37 00 00 00 00 00 03"),
    ("GIV", "38 00 00 00 00 00 00"),
    ("AIV", "39 00 00 00 00 00 00"),
    ("CALL LT, 100", "50 06 00 00 00 00 64"),
    ("64 1, 2, 3", "40 01 02 00 00 00 03"),
]


def only(text: str) -> TmclCall:
    (line,) = assembled([SourceLine(1, text)]).lines
    return line.call


@for_each("text, stored", WORDS)
def test_the_seven_bytes_of_a_line_and_the_line_of_seven_bytes(text: str, stored: str) -> None:
    call = only(text)
    assert pack(">BBBi", call.command, call.type, call.motor, call.value) == bytes.fromhex(stored)
    assert instructions.spelled(call) == text
    assert only(text.lower()) == call


def test_every_word_of_the_table_has_its_bytes_here() -> None:
    direct = {"ROL", "MST", "GAP", "STAP", "RSAP", "GGP", "RSGP"}
    assert {text.split()[0] for text, _ in WORDS} | direct == {*instructions.WORDS, "64"}


@pytest.mark.process
def test_the_numbers_are_those_of_the_maker_s_library() -> None:
    python = foreign_python(*TABLES_ONLY)
    names = [*instructions.WORDS]
    script = f"from pytrinamic.tmcl import TMCLCommand as C; print([int(getattr(C, name)) for name in {names}])"
    done = subprocess.run([str(python), "-c", script], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [row.number for row in instructions.WORDS.values()]


def test_labels_constants_and_remarks() -> None:
    text = "Far = 0x64 // a place\nAlso = far\nLoop: MVP ABS, 0, Far\n\n  wait pos, 0, 0 ; there\n  JA loop\n"
    text += "  MVP ABS,0,ALSO\n"
    lines = compiled(program_file.read(text, "a.tmc"))
    move = TmclCall(4, 0, 0, 100)
    assert [each.call for each in lines] == [move, TmclCall(27, 1), TmclCall(22, value=0), move]
    assert [each.source for each in lines] == [3, 5, 6, 7]


@for_each(
    "text, line, what, hint",
    [
        ("Loop MVP ABS, 0, 1", 1, "no command 'Loop'", "a label ends with a colon: Loop:"),
        ("STOPP", 1, "no command 'STOPP'", "is STOP meant?"),
        ("STOP\nMVP ABSO, 0, 1", 2, "type cannot be 'ABSO'", "valid: ABS, REL, COORD"),
        ("WAIT POS, 0", 1, "WAIT takes 3 fields", "write WAIT TICKS|POS|REFSW|LIMSW|RFS, motor, ticks"),
        ("JA Lop\nLoop: STOP", 1, "no label Lop", "is LOOP meant? (in any letters)"),
        ("JA 2048", 1, "label cannot be '2048'", "valid: a label, or 0 to 2047"),
        ("CALC ADD, 99999999999", 1, "value cannot be '99999999999'", "valid: -2147483648 to 2147483647"),
        ("SAP 300, 0, 1", 1, "type cannot be '300'", "valid: 0 to 255"),
        ("SAP 4,, 1", 1, "motor is missing", "valid: 0 to 255"),
        (
            "CALCX COMP",
            1,
            "operation cannot be 'COMP'",
            "valid: ADD, SUB, MUL, DIV, MOD, AND, OR, XOR, NOT, LOAD, SWAP",
        ),
        ("STOP 1", 1, "STOP takes no field", "write STOP"),
        ("128 0, 0, 0", 1, "128 is a control command, which no program holds", "valid: a word, or a number below 128"),
        (
            "137 0, 0, 1234",
            1,
            "137 is a control command, which no program holds",
            "valid: a word, or a number below 128",
        ),
        ("#include TMCLParam.tmc", 1, "#include is not supported", "copy the lines of that file into this one"),
        ("A: STOP\na: STOP", 2, "a is already in line 1", "choose another name"),
        ("Stop = 4\nSTOP", 1, "Stop is a command", "choose another name"),
        ("X = Y\nSTOP", 1, "a constant cannot be 'Y'", "valid: a number, or a constant of a line before"),
        ("STOP\x0bMVP ABS, 0, 5", 1, "vertical tab (U+000B)", "lines end at LF or CR LF"),
        ("STOP\n" * 2049, 2049, "there are 2049 lines, and a module holds 2048", "the memory ends at this line"),
    ],
)
def test_a_fault_has_one_line(text: str, line: int, what: str, hint: str) -> None:
    (found,) = errors(check(text))
    assert (found.line, found.what, found.hint) == (line, what, hint)


@for_each(
    "text, line, what",
    [
        ("STOP\nMST 0\nSTOP", 2, "this line is never executed"),
        ("MST 0", 1, "the program runs on past this line, its last one"),
        ("STAP 4, 0\nSTOP", 1, "STAP 4, 0 writes to the EEPROM, which wears out, each time that it is executed"),
        ("JA 5", 1, "the program has no line 5"),
        ("Again: CSUB Again\nRSUB", 1, "subroutines are nested more than 8 deep, or one calls itself"),
    ],
)
def test_a_warning_names_the_line(text: str, line: int, what: str) -> None:
    (found,) = check(text)
    assert found.warning and found.line == line and found.what.startswith(what)


@for_each("file", TMCL)
def test_programs_as_people_write_them_are_right_and_formatting_changes_no_line_of_the_memory(file: object) -> None:
    text = file.read_text()  # type: ignore[attr-defined]
    assert check(text) == []
    again = formatted(text)
    calls = [each.call for each in compiled(program_file.read(again, "a.tmc"))]
    assert calls == [each.call for each in compiled(program_file.read(text, "a.tmc"))]
    assert formatted(again) == again


def test_canonical_spelling() -> None:
    text = "loop:  mvp  abs,0 ,Far// go\n\tja loop\nFar=5\n"
    assert formatted(text) == "loop: MVP ABS, 0, Far// go\n\tJA loop\nFar = 5\n"


def calls() -> st.SearchStrategy[TmclCall]:
    """Lines of a memory: any seven bytes, and such as a word gives."""
    byte, value = st.integers(0, 255), st.integers(-(2**31), 2**31 - 1)
    known = st.sampled_from(sorted(instructions.ROWS))
    number = st.integers(1, 127)
    small = st.integers(-1, 20)
    return st.builds(TmclCall, number | known, byte | st.integers(0, 12), byte | st.just(0), value | small)


@examples(100, nightly=2000)
@given(st.lists(calls(), max_size=30))
def test_the_file_of_a_memory_gives_the_same_memory(memory: list[TmclCall]) -> None:
    text = "\n".join(disassembled(dict(enumerate(memory))))
    assert not errors(check(text))
    assert [
        each.call for each in assembled([SourceLine(*row) for row in enumerate(text.split("\n"), 1)]).lines
    ] == memory


LETTERS = st.text(alphabet=st.sampled_from("JAWITPOSMVRE019,:;=/x _-#\t\u0663é"), max_size=20)


@examples(100, nightly=2000)
@given(st.lists(LETTERS | st.text(max_size=10) | st.sampled_from([text for text, _ in WORDS]), max_size=8))
def test_no_text_breaks_the_language_or_its_editor(lines: list[str]) -> None:
    text = "\n".join(lines)
    found = check(text)
    if not errors(found):
        formatted(text)
        program_file.measure(text)
    program_file.entries(text)
    EDITING.outline(text)
    named = EDITING.names(text)
    for line in lines:
        program_file.parts(line)
        EDITING.words(line, ())
        EDITING.offers(line, named, "")


def test_the_editor_knows_labels_constants_and_fields() -> None:
    text = "Far = 5 // a place\nLoop: MVP ABS, 0, Far\n JA loop\n"
    named = {each.word: each for each in EDITING.names(text)}
    assert [(each.kind, len(each.places)) for each in named.values()] == [("constant", 2), ("label", 2)]
    assert named["Far"].remark == "a place"
    assert EDITING.renamed(text, named["Loop"], "Round", "") == "Round"
    assert [each.text for each in EDITING.offers("  JA Lo", named.values(), "")] == ["Loop"]
    assert "ABS" in [each.text for each in EDITING.offers("  MVP ", named.values(), "")]
    assert [each.text for each in EDITING.offers("  DJ", named.values(), "")] == ["DJNZ"]
    assert EDITING.describe("DJNZ", "")[1].endswith("DJNZ variable, label")
    assert [each.name for each in program_file.entries(text)] == ["0", "Loop"]


# A minus before a constant


def test_a_minus_before_a_constant_gives_the_opposite_number() -> None:
    text = "Dist = 1000\nBack = -Dist\nROR 0, -dist\nMVP REL, 0, - Back\nMVP ABS, 0, Back\nSAP 194, 0, -5\nSTOP\n"
    assert check(text) == []
    assert [each.call.value for each in compiled(program_file.read(text, "x"))] == [-1000, 1000, -1000, -5, 0]


@given(st.integers(-(2**31) + 1, 2**31 - 1), st.booleans())
def test_any_constant_may_be_negated(number: int, hexadecimal: bool) -> None:
    written = f"0x{number:X}" if hexadecimal and number >= 0 else str(number)
    text = f"N = {written}\nM = -N\nROR 0, -N\nROR 0, M\nROR 0, -M\nSTOP\n"
    assert errors(check(text)) == []
    assert [each.call.value for each in compiled(program_file.read(text, "x"))] == [-number, -number, number, 0]


@pytest.mark.parametrize(
    ("text", "line", "what", "hint"),
    [
        ("ROR 0, -Speed\nSTOP", 1, "value cannot be '-Speed'", "no constant Speed"),
        ("N = 5\nMVP ABS, -N, 1\nSTOP", 2, "motor cannot be '-N'", "valid: 0 to 255"),
        ("N = -2147483648\nM = -N\nSTOP", 2, "a constant cannot be '-N'", "valid: a number, or a constant of a line"),
        ("M = -N\nN = 5\nSTOP", 1, "a constant cannot be '-N'", "valid: a number, or a constant of a line before"),
        ("L: JA -L", 1, "label cannot be '-L'", "no constant L"),
        ("N = 5\nROR 0, --N\nSTOP", 2, "value cannot be '--N'", "valid: "),
    ],
)
def test_what_a_minus_cannot_precede(text: str, line: int, what: str, hint: str) -> None:
    first = errors(check(text))[0]
    assert (first.line, first.what) == (line, what) and first.hint.startswith(hint), first


def test_a_constant_is_renamed_behind_a_minus_too() -> None:
    text = "Dist = 10\nROR 0, -Dist ; -Dist\nROR 0, Dist\nSTOP\n"
    (name,) = EDITING.names(text)
    assert [(place.line, place.start, place.stop) for place in name.places] == [(0, 0, 4), (1, 8, 12), (2, 7, 11)]
    assert EDITING.renamed(text, name, "Far", "") == "Far"


# Whose language a text is


WHOLE = "Dist = 1000\nLoop: MVP ABS, 0, Dist\nWAIT POS, 0, 0\n  JA Loop // on\n"


def test_a_file_whose_lines_are_all_tmcl_is_named_as_such_even_with_errors() -> None:
    for text in (WHOLE, WHOLE.replace("JA Loop", "JA Lop"), WHOLE.replace("ABS, 0", "ABS, 999"), "MVP ABS, 0, Foo\n"):
        assert correct_in(text, "mcode") == correct_in(text, "pmx") == "tmcl"
    assert correct_in(WHOLE + "JUMP Loop\n", "mcode") == ""  # a line that is none
    assert correct_in("PRG 0\nX1000\nWAITZ\nJOGX+\nEND\n", "mcode") == "pmx"


def test_a_text_of_its_own_language_stays_that_with_errors() -> None:
    assert correct_in(WHOLE.replace("JA Loop", "JA Lop"), "tmcl") == ""
    assert correct_in("STOP\n", "pmx") == "tmcl"  # correct in both; asked only where it is wrong in its own
    assert correct_in("PG 1\nLB K1\nMR 5\nBR K2\nE\nPG\n", "mcode") == ""


@pytest.mark.parametrize("ending", [".tmc", ".tmcl", ".TMCL"])
def test_the_endings_of_a_file(ending: str) -> None:
    assert program_language_of("shuttle" + ending) == "tmcl"
