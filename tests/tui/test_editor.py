"""The languages of edited files: parts of lines, places to begin, and the alignment of a file with a drive's lines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import program_languages
from multidrop.dialects.program_files import LinePart
from multidrop.shell.programs.program_text import ProgramGrammar
from multidrop.shell.state.backups import Drafts
from multidrop.tui.editor import MacroGrammar, grammar_of
from multidrop.tui.screens.dialogs import Match
from multidrop.tui.screens.program_rows import UPLOAD, Finder, aligned, files_in
from multidrop.tui.texts import Texts

LINES = st.text(st.characters(min_codepoint=9, max_codepoint=0x17F, exclude_characters="\n\r"), max_size=40)
MCODE = [
    ("LB G1 ' home", [("LB", "word"), ("G1", "label"), ("' home", "remark")]),
    (" MR 51200", [("MR", "starts")]),
    ('PR "it\'s ",P', [("PR", "word"), ('"it\'s "', "text"), ("P", "word")]),
    ('PR "open', [("PR", "word"), ('"open', "wrong")]),
    ("BR K1,Q1<3", [("BR", "word")]),
    ("VA Q1=0", [("VA", "word"), ("Q1", "label")]),
]
SCRIPT = [
    ("PRG 0 ; the first", [("PRG", "label"), ("; the first", "remark")]),
    ("X1000Y-200", [("X1000Y", "starts")]),
    ("HOMEX+", [("HOMEX+", "starts")]),
    ("IF V1>3", [("IF", "word"), ("V1", "word")]),
    ("V1=PSX", [("V1", "word"), ("PSX", "word")]),
]
MACRO = [
    ("[[step]] # one", [("[[step]]", "label"), ("# one", "remark")]),
    ('line = "MR 5 # 1"', [("line", "word"), ('"MR 5 # 1"', "text")]),
]


@pytest.mark.parametrize(
    ("file", "line", "parts"),
    [(file, *row) for file, rows in (("a.mxt", MCODE), ("a.prg", SCRIPT), ("a.toml", MACRO)) for row in rows],
)
def test_the_parts_of_a_line(file: str, line: str, parts: list[tuple[str, str]]) -> None:
    assert [(line[part.start : part.stop], part.kind) for part in grammar_of(file).parts(line)] == parts


@given(LINES, st.sampled_from(["a.mxt", "a.prg", "a.toml"]))
def test_parts_are_in_the_line_one_after_the_other(line: str, file: str) -> None:
    parts = list(grammar_of(file).parts(line))
    places = [place for part in parts for place in (part.start, part.stop)]
    assert places == sorted(places) and all(0 <= place <= len(line) for place in places)


@given(st.lists(LINES, max_size=6))
def test_no_text_breaks_the_search_for_labels(lines: list[str]) -> None:
    for files in program_languages().values():
        for entry in files.language.entries("\n".join(lines)):
            runs_address = entry.start.startswith("129 1, 0, ")  # a TMCL program is run from an address
            assert (entry.name in entry.start or runs_address) and 1 <= entry.line <= len(lines)


def test_labels_are_those_of_programs_with_the_line_that_starts_them() -> None:
    text = "VA G9=1\nPG 1\nLB G1\nVA K1=0\n LB=g2\nE\nPG\nS\n"
    assert ProgramGrammar("a.mxt").entries(text) == [("G1", 3, "EX G1"), ("G2", 5, "EX G2")]
    assert ProgramGrammar("a.prg").entries("PRG 0\nEND\n; PRG 2\nPRG 1\nEND\n") == [
        ("0", 1, "SR0=1"),
        ("1", 4, "SR1=1"),
    ]


def test_a_program_is_checked_for_the_product_and_nothing_is_found_in_an_empty_text() -> None:
    grammar = ProgramGrammar("a.mxt")
    assert [each.line for each in grammar.check("PG 1\nMX 5\nE\nPG\n", "LMDCE")] == [2]
    assert grammar.check("PG 1\nPR 1\nE\nPG\n", "no such product") == []
    assert list(grammar.check(" \n", "LMDCM")) == []


def test_a_macro_is_checked_as_it_is_read() -> None:
    grammar = MacroGrammar("go.toml")
    assert not grammar.check('name = "go"\n[[step]]\nafter = 0.0\nline = "MR 5"\n', "")
    (problem,) = grammar.check('name = "go"\nname = "on"\n', "")
    assert problem.line == 2


def test_files_are_found_by_name_and_by_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old").mkdir()
    for name in ("gantry.mxt", "press.prg", "notes.md", "old/gantry.mxt"):
        (tmp_path / name).write_text("E\n")

    def keys(found: Sequence[Match]) -> list[str]:
        return [match.key for match in found]

    here = files_in("")
    assert {each.name for each in here} == {"gantry.mxt", "press.prg", "old/", "../"}
    finder = Finder(here, [], "press:a")
    assert UPLOAD in keys(finder("")) and keys(finder("gant"))[0] == "gantry.mxt"
    assert keys(finder("new.mxt"))[0] == "new.mxt" and keys(finder("old/")) == ["old/gantry.mxt", "old/../"]
    assert keys(Finder(files_in("old/"), [], "", "old/")("gantry.m"))[:1] == ["old/gantry.m"]
    assert keys(Finder(files_in("old/"), [], "", "old/")("gan")) == ["old/gantry.mxt", "old/gan"]
    assert files_in("nowhere/") == []


def no_parts(line: str) -> list[LinePart]:
    at = line.find("'")
    return [LinePart(at, len(line), "remark")] if at >= 0 else []


def test_a_program_is_found_in_its_file_whatever_its_remarks_and_blanks() -> None:
    text = "' head\nVM=5\nPG 1\nLB G1 ' go\n\n  ma=5\nE\nPG\nS\n"
    assert aligned(text, [(1, "LB G1"), (6, "MA 5"), (11, "E")], no_parts) == {1: 3, 6: 5, 11: 6}


@pytest.mark.parametrize(
    "rows", [[], [(1, "LB G1"), (6, "MA 6")], [(1, "E"), (2, "PG"), (3, "PG")], [(1, "H")], [(1, "H"), (3, "H")]]
)
def test_another_program_or_one_that_fits_twice_has_no_lines(rows: list[tuple[int, str]]) -> None:
    assert aligned("PG 1\nLB G1\nMA 5\nH\nE\nPG\nH\n", rows, no_parts) == {}


def test_a_text_stays_open_and_its_copy_follows_it(tmp_path: Path) -> None:
    path, drafts = tmp_path / "a.mxt", Drafts(tmp_path / "state")
    path.write_text("E\n")
    texts = Texts(drafts)
    text = texts.open(str(path))
    assert not texts.due(text) and texts.unsaved() == []
    text.text = "E ' mine\n"
    assert texts.open(str(path)) is text and texts.unsaved() == [text] and texts.flush() == []
    assert texts.flush() == [] and not texts.due(text)
    found = drafts.find(str(path))
    assert found is not None and found.text == "E ' mine\n"
    again = Texts(drafts)
    assert again.draft(again.open(str(path))) == found
    text.text = "E\n"
    assert texts.due(text)
    texts.keep(text)
    assert drafts.find(str(path)) is None
    texts.close(text)
    assert texts.current is None


def test_a_copy_that_cannot_be_kept_is_said_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.mxt"
    path.write_text("E\n")
    (tmp_path / "state").write_text("no folder")
    texts = Texts(Drafts(tmp_path / "state"))
    texts.open(str(path)).text = "x"
    (line,) = texts.flush()
    assert "no copy of the text can be kept" in line and "a.mxt" in line
    with pytest.raises(Diagnostic):
        texts.open(str(tmp_path))
