"""The rulings: a chapter a file, each of them in the index, each ruling with what it rests on."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from multidrop.dialects.certifying import BYTES, DOES, FITS, MODE, NOTHING, Certifying
from multidrop.dialects.families import FAMILIES
from tests.support.paths import ROOT

DOCS = ROOT / "docs"
CHAPTERS = sorted((DOCS / "rulings").glob("*.md"))
KIND = r"(manual|client|firmware|program|unchecked|none)( \([^()]+\))?"
EVIDENCE = re.compile(f"{KIND}(, {KIND})*")


def rows(text: str) -> list[list[str]]:
    found = [line for line in text.splitlines() if line.startswith("|") and not line.startswith("|---")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in found]


def test_the_index_names_every_chapter_and_holds_no_ruling_itself() -> None:
    index = (DOCS / "rulings.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"\(rulings/([\w-]+\.md)\)", index)) == [path.name for path in CHAPTERS]
    assert not any(row[0] == "matter" for row in rows(index))


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda path: path.stem)
def test_every_ruling_says_what_it_rests_on(path: Path) -> None:
    head, *rulings = rows(path.read_text(encoding="utf-8"))
    assert head == ["matter", "what the sources say", "what we do", "evidence", "question"]
    for row in rulings:
        assert len(row) == 5 and EVIDENCE.fullmatch(row[3]), row


def tables() -> dict[str, Certifying]:
    made = {name: family(family.new_state(family.codec, "")).certifying for name, family in FAMILIES.items()}
    return {name: each for name, each in made.items() if each is not None}


def test_every_ruling_names_its_questions_or_why_none_decides_it_and_every_question_decides_one() -> None:
    index = rows((DOCS / "rulings.md").read_text(encoding="utf-8"))
    reasons = {row[0].strip("`") for row in index[index.index(["reason", "no question decides it, because"]) + 1 :]}
    known = {(name, each.name) for name, table in tables().items() for each in table.table()}
    own, named, used = {"modbus", "pmx", "tmcl"}, set(), set()
    for path in CHAPTERS:
        family = path.stem if path.stem in own else "mcode"
        for row in rows(path.read_text(encoding="utf-8"))[1:]:
            if row[4] in reasons:
                used.add(row[4])
                continue
            found = re.findall(r"`([\w-]+)`", row[4])
            assert ", ".join(f"`{name}`" for name in found) == row[4] and found, row
            named |= {(family, name) for name in found}
    assert (named, used) == (known, reasons)


@pytest.mark.parametrize("name", tables())
def test_no_question_is_guarded_stores_anything_or_changes_what_no_session_restores(name: str) -> None:
    family, table = FAMILIES[name], tables()[name]
    for question in table.table():
        assert question.does in DOES and question.shows in ("", BYTES, FITS)
        assert question.shows != FITS or question.ruled != ".*"
        assert not question.keeps or (family.repairs and question.does != NOTHING), question
        for line in question.lines:
            state = family.new_state(family.codec, "")
            assert family(state).guard(line) is None, line
            assert not re.match(r"(S|IP|CP|FD|PG|LK|STORE|ST[AG]P|UG|ER)\b", line), line
            if question.does in (NOTHING, MODE) and not line.startswith("/"):
                assert not family.codec.starts_motion(line), line


@pytest.mark.parametrize("path", [DOCS / "rulings.md", *CHAPTERS], ids=lambda path: path.stem)
def test_every_link_leads_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8")):
        assert (path.parent / target).exists(), target
