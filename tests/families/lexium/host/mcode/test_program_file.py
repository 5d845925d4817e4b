"""Program files: what is sent, what is left out, what is refused, and a file made of what is in a drive."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.base.files import program_text_of
from multidrop.dialects.families import program_language_of, program_languages
from multidrop.families.lexium.manual import program_file
from multidrop.families.lexium.manual.program_checker import check
from multidrop.families.lexium.manual.program_file import ProgramLine, read

PRESS = """\
'[VARIABLES]
VA Q1=25600\t\t' half a turn, isn't it
Vm = 400000     `fast

'[PROGRAMS]
PG 1            \\ program mode
  LB Ga
\tMR Q1
\tH
  PR "it's \\r`done`" ' print
  BR Ga,\tI1=1
  E
PG
S   'keep this line
'[END]
"""


def refusal(text: str) -> str:
    with pytest.raises(Diagnostic) as caught:
        read(text, "press.mxt")
    return str(caught.value)


def test_a_file_in_its_three_parts() -> None:
    assert read(PRESS, "press.mxt") == [
        ProgramLine(2, "VA Q1=25600", "variables"),
        ProgramLine(3, "Vm = 400000", "variables"),
        ProgramLine(6, "PG 1", "program"),
        ProgramLine(7, "LB Ga", "program"),
        ProgramLine(8, "MR Q1", "program"),
        ProgramLine(9, "H", "program"),
        ProgramLine(10, 'PR "it\'s \\r`done`"', "program"),
        ProgramLine(11, "BR Ga, I1=1", "program"),
        ProgramLine(12, "E", "program"),
        ProgramLine(13, "PG", "program"),
        ProgramLine(14, "S", "save"),
    ]


@pytest.mark.parametrize("end", ["\r\n", "\n", "\r"])
def test_every_line_end_counts_lines_alike(end: str) -> None:
    assert read(PRESS.replace("\n", end), "x") == read(PRESS, "x")


def test_several_programs_keep_what_stands_between_them_before_them() -> None:
    lines = read("PG 1\nE\npg\nVA Q2\nPG=200\nE\nPG\nS\nEX 200\n", "x")
    assert [line.section for line in lines] == ["program"] * 3 + ["variables"] + ["program"] * 3 + ["save"] * 2


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "press.mxt:1:1: nothing to send"),
        ("\n  ' only this\n", "press.mxt:1:1: nothing to send"),
        ("VM=5000\n MR 512\n", "press.mxt:2:2: no program, and MR 512 is not a setting"),
        ("VA Q1\nPG 1\nE\n", "press.mxt:2:1: PG is never ended"),
        ("PG 1\nE\nPG\nPG\n", "press.mxt:4:1: PG without an address"),
        ("PG 1\nE\nPG 100\nE\nPG\n", "press.mxt:3:1: PG 100 inside the program of line 1"),
        ("PG 1\n  PR\x07\nPG\n", "press.mxt:2:5: control character (U+0007)"),
        ('PG 1\nPR "20 °C"\nPG\n', "press.mxt:2:8: '°' cannot be sent"),
        ("PG 1\nPR “P”\nPG\nPG\n", "press.mxt:2:4: '“' cannot be sent (1 more: multidrop program check)"),
    ],
)
def test_what_cannot_be_sent_is_refused_with_its_place(text: str, complaint: str) -> None:
    assert refusal(text).startswith(complaint)


def test_a_line_of_64_characters_is_sent_and_one_of_65_is_not_remarks_not_counted() -> None:
    fits = f'PR "{"x" * 59}"'
    assert len(fits) == 64
    assert read(f"PG 1\n{fits}   ' a remark that is longer\nPG\n", "x")[1].text == fits
    assert refusal(f"PG 1\n{fits.replace('x', 'xx', 1)}\nPG\n").startswith(
        "press.mxt:2:65: 65 characters without the remark; a drive takes 64"
    )


def test_letters_of_any_script_in_a_remark_do_no_harm() -> None:
    assert [line.text for line in read("PG 1 ' 20 °C\t速\nE ` – “ok”\nPG\n\x1a", "x")] == ["PG 1", "E", "PG"]


def test_a_file_is_read_in_utf8_with_or_without_a_mark_and_in_latin1(tmp_path: Path) -> None:
    for data in (PRESS.encode(), b"\xef\xbb\xbf" + PRESS.encode(), PRESS.replace("fast", "größe").encode("latin-1")):
        path = tmp_path / "press.mxt"
        path.write_bytes(data)
        assert read(program_text_of(path), str(path)) == read(PRESS, "x")


def test_a_file_that_is_no_text_is_missing_or_a_folder_is_refused_by_name(tmp_path: Path) -> None:
    binary = tmp_path / "a.bin"
    binary.write_bytes(b"PG 1\0E")
    for path, reason in ((binary, "not a text"), (tmp_path / "gone", "No such file"), (tmp_path, "cannot be read")):
        with pytest.raises(Diagnostic, match=reason) as caught:
            read(program_text_of(path), str(path))
        assert caught.value.where == str(path)


PLAIN = st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="'`\\\""), max_size=20)
QUOTED = st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters='"'), max_size=20)


@given(PLAIN, QUOTED, st.sampled_from(["", " ' end", "`x", ' \\ a "b"']))
def test_what_is_in_quotation_marks_is_never_cut(before: str, quoted: str, remark: str) -> None:
    assert program_file.bare(f'{before}"{quoted}"{remark}') == f'{before}"{quoted}"'.strip(" ")


@given(st.text(st.sampled_from("PG 1E\"'`\\\t\r\n=S\x07é") | st.characters(), max_size=80))
def test_any_text_is_read_or_refused_with_a_diagnostic(text: str) -> None:
    try:
        lines = read(text, "x")
    except Diagnostic as error:
        assert error.where.startswith("x")
        return
    assert all(0 < len(line.text) <= 64 and line.text.isascii() and line.text.strip(" ") for line in lines)
    assert [line.number for line in lines] == sorted({line.number for line in lines})
    opened = [line for line in lines if line.section == "program"]
    assert opened or {line.section for line in lines} == {"variables"}
    assert not opened or opened[0].text.upper().startswith("PG") and opened[-1].text.upper().startswith("PG")


@given(st.binary(max_size=60))
def test_any_bytes_are_read_or_refused_with_a_diagnostic(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.mxt"
    path.write_bytes(b"PG 1\n" + data + b"\nPG\n")
    try:
        assert read(program_text_of(path), str(path))[0].text == "PG 1"
    except Diagnostic as error:
        assert error.where.startswith(str(path))


# What the text of a file tells


GOOD = "VA Q1=5\nPG 1\nLB K1\n  MR Q1 ' on\n  H\n  CL K2,Q1=5\n  BR K1,I1=1\nE\nLB K2\nRT\nPG\nS\n"


def test_a_file_that_is_right_has_no_problems() -> None:
    assert check(GOOD) == []


@pytest.mark.parametrize(
    ("text", "place", "what"),
    [
        (GOOD.replace("LB K2\nRT\n", ""), (6, 6), "no label K2"),
        (GOOD.replace("VA Q1=5\n", ""), (3, 6), "unknown name Q1"),
        (GOOD.replace("MR Q1", "MR ("), (4, 6), "does not belong here"),
        (GOOD.replace("MR Q1", "FOO 1"), (4, 3), "unknown name FOO"),
        (GOOD.replace("LB K2", "LB K1"), (6, 6), "no label K2"),
        (GOOD.replace("RT", "LB K1"), (10, 4), "LB K1 is already in line 3"),
        ("PG 1\nE\n", (1, 1), "PG is never ended"),
        ("PG 1\nPR \xb5\nPG\n", (2, 4), "cannot be sent"),
        ("", (1, 1), "nothing to send"),
    ],
)
def test_what_is_wrong_is_told_with_line_and_column(text: str, place: tuple[int, int], what: str) -> None:
    first = check(text)[0]
    assert (first.line, first.column) == place and what in first.what


def test_a_files_language_goes_by_its_name() -> None:
    assert [program_language_of(name) for name in ("a.prg", "b/A.ASC", "f.TMC", "c.mxt", "d.txt", "e")] == [
        "pmx",
        "pmx",
        "tmcl",
        "mcode",
        "mcode",
        "mcode",
    ]
    assert set(program_languages()) == {"mcode", "pmx", "tmcl"}
