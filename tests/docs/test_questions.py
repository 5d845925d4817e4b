"""The fifteen questions: each is in the index, and its section begins with the answer."""

from __future__ import annotations

import re

import pytest

from tests.support.pages import PAGES

ASKED = re.findall(r"\(questions\.md#([\w-]+)\)", PAGES["docs/README.md"])
SECTIONS = dict(re.findall(r"^## ([^\n]+)\n\n(.*?)(?=\n\n|\Z)", PAGES["docs/questions.md"], re.S | re.M))
LONGEST = 60
"""Words that a person reads in some ten seconds or a little more, commands included."""


def test_the_index_asks_all_of_them() -> None:
    anchors = [re.sub(r"[^\w -]", "", each.lower()).replace(" ", "-") for each in SECTIONS]
    assert sorted(ASKED) == sorted(anchors) and len(ASKED) == 15


@pytest.mark.parametrize("question", SECTIONS)
def test_a_section_begins_with_the_answer(question: str) -> None:
    assert question.endswith("?")
    assert len(SECTIONS[question].split()) <= LONGEST and not SECTIONS[question].startswith(("|", "`" * 3))
