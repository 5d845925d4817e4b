"""A program file under editing: names, renaming, completion, the outline, and the spelling that changes no meaning."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.dialects.editing import Block, replaced
from multidrop.dialects.families import program_languages
from multidrop.families.lexium.manual.grammar import LineError, Statement, parse
from multidrop.families.lexium.manual.program_file import scan
from multidrop.families.lexium.manual.statements import canonical
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.pmx.manual.program_file import compiled
from multidrop.families.pmx.manual.program_file import read as read_script
from multidrop.shell.programs.program_text import ProgramGrammar, ProgramText, TextEdit
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World
from tests.support.program_texts import TEXTS
from tests.support.sample_files import MCODE, PMX, product_of

FILES = ("a.mxt", "a.prg")
PLACES = st.integers(0, 30)


def text_of(text: str, file: str = "a.mxt", product: str = "LMDCM") -> ProgramText:
    return ProgramText(text, ProgramGrammar(file), product)


def edited(text: ProgramText, edits: Sequence[TextEdit]) -> str:
    lines = text.lines
    for place, new in sorted(edits, reverse=True):
        lines = replaced(lines, [place], new)
    return "\n".join(lines)


@given(TEXTS, st.sampled_from(FILES), PLACES, PLACES)
def test_no_text_and_no_place_breaks_anything(text: str, file: str, line: int, column: int) -> None:
    tested = text_of(text, file)
    size = [len(each) for each in tested.lines]
    for name in tested.names:
        assert set(name.declared) <= set(name.places)
        for place in name.places:
            assert 0 <= place.start < place.stop <= size[place.line]
    tested.help_at(line, column)
    place, _ = tested.offers_at(line, column)
    assert place.start <= place.stop
    coloured = list(tested.coloured(0, len(size)))
    assert coloured == sorted(coloured)
    for one, other in zip(coloured, coloured[1:], strict=False):
        assert one.place.line < other.place.line or one.place.stop <= other.place.start
    assert all(0 <= fold.first < fold.last < len(size) for fold in tested.folds())
    assert all(_within(block, len(size)) for block in tested.outline)
    for new in ("Q7", "V9", "5", ""):
        try:
            tested.renamed_at(line, column, new)
        except Diagnostic as problem:
            assert problem.message


def test_blocks_that_are_nested_deeper_than_calls_may_be_are_folded() -> None:
    deep = 2 * sys.getrecursionlimit()
    assert len(list(text_of("IF V1=1\n" * deep + "ENDIF\n" * deep, "a.prg").folds())) == deep


def _within(block: Block, lines: int) -> bool:
    inside = [block.place.line <= part.place.line and part.last <= block.last for part in block.parts]
    return block.place.line <= block.last < lines and all(inside) and all(_within(each, lines) for each in block.parts)


@given(TEXTS, st.sampled_from(FILES), st.integers(0, 3))
def test_a_rename_keeps_every_other_token_and_can_be_taken_back(text: str, file: str, number: int) -> None:
    tested = text_of(text, file)
    if number >= len(tested.names):
        return
    name = tested.names[number]
    place, new = name.places[0], {"variable": "V9" if file == "a.prg" else "Zz", "label": "Zz"}.get(name.kind, "7")
    try:
        after = text_of(edited(tested, tested.renamed_at(place.line, place.start, new)), file)
    except Diagnostic:
        return
    assert [len(each.places) for each in after.names] == [len(each.places) for each in tested.names]
    again = after.names[number]
    old = tested.lines[place.line][place.start : place.stop]
    first = again.places[0]
    try:
        back = after.renamed_at(first.line, first.start, old)
    except Diagnostic:
        return  # a name that the product has as its own, or V7 of a text without it
    assert [line.upper() for line in text_of(edited(after, back), file).lines] == [
        line.upper() for line in tested.lines
    ]


# MCode

MOVES = 'VA Q1=5\nPG 1\nLB K1\nTI=1,K1\n BRk1,q1<3\nCL K1\nOE k1\nPR "k1",K1 \' K1\nDN "K"\nIC Q1\n q1 7\nE\nPG\n'


@pytest.mark.parametrize(
    ("at", "new", "after"),
    [
        ((2, 3), "Zz", 'VA Q1=5|PG 1|LB Zz|TI=1,Zz| BRZz,q1<3|CL Zz|OE Zz|PR "k1",Zz \' K1|DN "K"|IC Q1| q1 7|E|PG|'),
        ((9, 5), "b", 'VA b=5|PG 1|LB K1|TI=1,K1| BRk1,b<3|CL K1|OE k1|PR "k1",K1 \' K1|DN "K"|IC b| b 7|E|PG|'),
    ],
)
def test_a_name_is_renamed_in_all_its_uses(at: tuple[int, int], new: str, after: str) -> None:
    text = text_of(MOVES)
    assert edited(text, text.renamed_at(*at, new)).split("\n") == after.split("|")


@pytest.mark.parametrize("line", ["LB G1", "lb=g1", "LBG1", "VA G1", "va=G1=5", "vag1=G1", " VA G1=G1+1"])
def test_a_name_is_declared_once_in_a_line(line: str) -> None:
    (name,) = text_of(f"PG 1\n{line}\nE\nPG\n").names
    assert [place.start for place in name.declared] == [line.upper().index("G1")]


@pytest.mark.parametrize(
    ("at", "new", "why"),
    [
        ((0, 3), "MA", "MA is a word of the drive: Move absolute"),
        ((0, 3), "S1", "S1 is a word of MDI, MDIE, MDIX"),
        ((0, 3), "k1", "K1 is in use already, in line 3"),
        ((0, 3), "Q1x", "'Q1x' is not a name; a name is a letter, alone or with"),
        ((0, 3), "1Q", "'1Q' is not a name"),
        ((0, 3), "", "'' is not a name"),
        ((0, 3), "é", "'é' is not a name"),
        ((0, 0), "Zz", "only a label, a variable or a subroutine of this file"),
        ((7, 5), "Zz", "only a label"),
        ((50, 0), "Zz", "only a label"),
    ],
)
def test_a_wrong_name_is_refused_with_the_reason(at: tuple[int, int], new: str, why: str) -> None:
    with pytest.raises(Diagnostic) as refused:
        text_of(MOVES).renamed_at(*at, new)
    assert str(refused.value).startswith(why)


@pytest.mark.parametrize(
    ("text", "new", "why"),
    [
        ("PG 1\nLB SU\nE\nPG\n", "K1", "SU is the label of the program that runs at power-up"),
        ("VA Q=5\nPG 1\nH5\nE\nPG\n", "H5", "H5 is in use already, in line 3"),
        (
            "VA Q=5\nPG 1\nH 5\nR1=1" + "+Q" * 28 + "+1\nE\nPG\n",
            "Z12",
            "line 4 would have 118 characters; a drive takes 64",
        ),
    ],
)
def test_a_rename_that_changes_the_program_is_refused(text: str, new: str, why: str) -> None:
    tested = text_of(text)
    place = tested.names[0].places[0]
    with pytest.raises(Diagnostic, match=why):
        tested.renamed_at(place.line, place.start, new)


@pytest.mark.parametrize(
    ("before", "some", "none"),
    [
        ("BR ", {"K1"}, {"Q1", "P", "MR"}),
        ("TI=1,", {"K1"}, {"Q1", "P"}),
        ("BR K1,", {"Q1", "P", "I1"}, {"K1", "MR"}),
        ("PR ", {"K1", "Q1", "P", "UV"}, {"MR", "CP"}),
        ("LB ", set(), {"K1", "Q1", "P"}),
        ("VA Z=", {"P"}, {"K1", "MR"}),
        ("", {"Q1", "MR", "VM"}, {"K1", "SI", "I1"}),
        ("R1=", {"Q1", "P", "SI"}, {"MR"}),
        ("' ", set(), {"Q1", "MR"}),
        ('PR "', set(), {"Q1", "P"}),
    ],
)
def test_completion_fits_the_place(before: str, some: set[str], none: set[str]) -> None:
    text = text_of(MOVES + before)
    _, offers = text.offers_at(13, len(before))
    offered = {each.text for each in offers}
    assert some <= offered and not none & offered


# The spelling


def _statements(text: str) -> list[Statement | str]:
    lines = scan(text)[0]
    names = frozenset(line.declares for line in lines if line.declares)
    found: list[Statement | str] = []
    for line in lines:
        try:
            statement = parse(line.text, names)
        except LineError:
            found.append(line.text.rstrip("\t "))
        else:
            if statement is not None:
                found.append(Statement(statement.word, statement.arguments, False, statement.quiet))
    return found


@given(TEXTS)
def test_the_spelling_of_any_mcode_keeps_its_statements(text: str) -> None:
    text = text.replace("\x1a", "")  # within a file it is an error, at its end it is none
    language = program_languages()["mcode"].language
    spelled = language.formatted(text)
    assert _statements(spelled) == _statements(text) and language.formatted(spelled) == spelled
    assert len(split_lines(spelled)) == len(split_lines(text))


def _memory(text: str, product: str) -> list[tuple[str, str]]:
    """What a drive lists after a download: the addresses, and the statements however they are spelled."""
    device = MCodeDevice(DriveSpec(personality=product), World(WorldSpec()))
    lines = scan(text)[0]
    for line in lines:
        device.execute(line.text, 0.0)
    names = frozenset(line.declares for line in lines if line.declares)
    listed = [line.partition("  ") for line in device.execute("L", 0.0).lines]
    return [(address, canonical(line, names)) for address, _, line in listed]


@pytest.mark.parametrize("file", MCODE, ids=lambda file: file.stem)
def test_a_formatted_program_is_the_same_in_the_drive(file: Path) -> None:
    source = file.read_text()
    text = text_of(source.lower(), product=product_of(file))
    if any(not problem.warning for problem in text.problems):  # a text that is not the same in small letters
        text = text_of(source, product=product_of(file))
    after = edited(text, text.formatted(0, len(text.lines)))
    assert _memory(after, product_of(file)) == _memory("\n".join(text.lines), product_of(file))
    again = text_of(after, product=product_of(file))
    assert again.formatted(0, len(again.lines)) == []


@pytest.mark.parametrize("file", PMX, ids=lambda file: file.stem)
def test_a_formatted_script_compiles_to_the_same_lines(file: Path) -> None:
    source = file.read_text()
    if "SA0" not in source:
        source = re.sub("(?<![<>!])=", " = ", source)
    text = text_of(source, file.name, "PMX")
    after = edited(text, text.formatted(0, len(text.lines)))
    assert compiled(read_script(after, "a")) == compiled(read_script(source, "a"))


def test_a_text_with_errors_is_not_formatted() -> None:
    text = text_of("pg1\nmr *\nmx 5\npg\n")
    with pytest.raises(Diagnostic, match="not formatted: 2 errors, the first in line 2: "):
        text.formatted(0, 9)


# A-SCRIPT

SCRIPT = "PRG 0\n V1=0 ; count\n IF V1<3\n  GOSUB 3\n ENDIF\n XV1YV2\nEND\nSUB 03 ; lamp\nENDSUB\nSUB 31\nENDSUB\n"


def test_the_outline_of_a_script_has_its_blocks() -> None:
    program, lamp, handler = text_of(SCRIPT, "a.prg").outline
    assert (program.name, program.last, [part.name for part in program.parts]) == ("PRG 0", 6, ["IF V1<3"])
    assert (lamp.name, lamp.detail, lamp.place.line, lamp.last) == ("SUB 3", "lamp", 7, 8)
    assert handler.name == "SUB 31"
    (bare,) = text_of("V1=5\nWHILE V1=1\nEND\n", "a.prg").outline
    assert (bare.name, bare.last, bare.parts[0].last) == ("PRG 0", 2, 2)


@pytest.mark.parametrize(
    ("at", "new", "after"),
    [
        ((1, 1), "V9", "PRG 0| V9=0 ; count| IF V9<3|  GOSUB 3| ENDIF| XV9YV2|END|SUB 03 ; lamp|ENDSUB|SUB 31|ENDSUB|"),
        ((7, 5), "4", "PRG 0| V1=0 ; count| IF V1<3|  GOSUB 4| ENDIF| XV1YV2|END|SUB 4 ; lamp|ENDSUB|SUB 31|ENDSUB|"),
    ],
)
def test_a_number_of_a_script_is_changed_in_all_its_uses(at: tuple[int, int], new: str, after: str) -> None:
    text = text_of(SCRIPT, "a.prg")
    assert edited(text, text.renamed_at(*at, new)).split("\n") == after.split("|")


@pytest.mark.parametrize(
    ("line", "after"),
    [
        ("XV1YV2", "XV9YV2"),
        (" X V1Y2", " X V9Y2"),
        ("X V2 YV1 ; V1", "X V2 YV9 ; V1"),
        ("Y V1", "Y V9"),
        ("V12=V1+V1", "V12=V9+V9"),
        ("V1=~V1", "V9=~V9"),
        ("V2=V1>>V11", "V2=V9>>V11"),
        ("DELAY = V1", "DELAY = V9"),
        ("IF V1>=-1", "IF V9>=-1"),
        ("WHILE AI1<V1", "WHILE AI1<V9"),
        ("HSPDX=V1", "HSPDX=V9"),
    ],
)
def test_a_variable_is_renamed_wherever_a_statement_has_one(line: str, after: str) -> None:
    end = {"I": "\nENDIF", "W": "\nENDWHILE"}.get(line[0], "")
    text = text_of(f"V1=5\n{line}{end}\nEND\n", "a.prg")
    assert edited(text, text.renamed_at(0, 1, "V9")) == f"V9=5\n{after}{end}\nEND\n"


@pytest.mark.parametrize(
    ("at", "new", "why"),
    [
        ((0, 4), "1", "the host starts PRG 0 by its number (SR0=1)"),
        ((9, 4), "5", "SUB 31 is the subroutine that runs after an error"),
        ((7, 5), "31", "SUB 31 is the subroutine that runs after an error"),
        ((7, 5), "32", "'32' is not a subroutine; subroutines are 0 to 31"),
        ((1, 1), "V2", "V2 is in use already, in line 6"),
        ((1, 1), "V64", "'V64' is not a variable; variables are V0 to V63"),
        ((1, 1), "V32", "STORE keeps V32 and does not keep V1; V0 to V31 are 0 at each start, V32 to V63 are kept"),
    ],
)
def test_a_wrong_number_of_a_script_is_refused(at: tuple[int, int], new: str, why: str) -> None:
    with pytest.raises(Diagnostic) as refused:
        text_of(SCRIPT, "a.prg").renamed_at(*at, new)
    assert str(refused.value).startswith(why)


@pytest.mark.parametrize(
    ("before", "some", "none"),
    [
        ("", {"IF", "HSPD", "V1", "ABORT", "HOMEX+", "WAITX"}, {"DI1", "PSX"}),
        ("GOSUB ", {"3", "31"}, {"V1", "IF"}),
        ("IF ", {"DI1", "PSX", "V1"}, {"IF", "ABORT"}),
        ("V2=", {"AI1", "V1"}, {"WHILE"}),
        ("ho", {"HOMEX+"}, {"IF"}),
        ("SUB ", set(), {"3"}),
        ("; ", set(), {"IF"}),
    ],
)
def test_completion_of_a_script_fits_the_place(before: str, some: set[str], none: set[str]) -> None:
    _, offers = text_of(SCRIPT + before, "a.prg").offers_at(11, len(before))
    offered = {each.text for each in offers}
    assert some <= offered and not none & offered
