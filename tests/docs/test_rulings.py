"""The rulings: a chapter a file, each of them in the index, each ruling with what it rests on."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

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
    assert head == ["matter", "what the sources say", "what we do", "evidence"]
    for row in rulings:
        assert len(row) == 4 and EVIDENCE.fullmatch(row[3]), row


@pytest.mark.parametrize("path", [DOCS / "rulings.md", *CHAPTERS], ids=lambda path: path.stem)
def test_every_link_leads_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8")):
        assert (path.parent / target).exists(), target
