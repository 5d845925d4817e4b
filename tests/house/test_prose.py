"""Help, messages, comments and pages get no new words that readers stumble over: `make prose`."""

from __future__ import annotations

from collections import Counter

import pytest

from tests.support import prose
from tests.support.prose import Avoided

WORDS = [Avoided("told(?! apart)|tells", "reported"), Avoided("of which", "that"), Avoided("beside", "next to")]


def found(name: str, text: str) -> list[tuple[int, str]]:
    return [(place.line, place.text) for place in prose.places(name, text, WORDS)]


@pytest.mark.slow
def test_no_file_has_more_words_to_avoid_than_are_accepted() -> None:
    new = prose.grown(prose.all_places(), prose.kept())
    assert not new, "some of these are new:\n" + "\n".join(map(str, new))


def test_each_word_says_what_to_use_instead() -> None:
    assert all(word.instead and word.compiled for word in prose.avoided())
    assert {pattern for _, pattern in prose.kept()} <= {word.pattern for word in prose.avoided()}


def test_a_page_is_searched_across_its_line_breaks() -> None:
    assert found("a.md", "A\nline of\nwhich it is told.\n") == [(2, "of\nwhich"), (3, "told")]


def test_whole_words_in_any_case_are_found() -> None:
    assert found("a.md", "Beside it, besides, told apart, retold, Tells") == [(1, "Beside"), (1, "Tells")]


def test_of_python_the_texts_and_the_comments_are_searched() -> None:
    text = 'told = beside()\n\n# it is of\n# which\nx = f"a {told} is told"\ny = """One.\n\nBeside it."""\nz = "told"\n'
    assert found("a.py", text) == [(3, "of\n# which"), (5, "told"), (8, "Beside")]


def test_a_place_names_its_file_its_line_and_what_to_use() -> None:
    assert [*map(str, prose.places("a.md", "\nof\nwhich", WORDS))] == ["a.md:2: 'of which': use that"]


def test_the_number_of_places_may_fall_and_move_but_not_grow() -> None:
    places = prose.places("a.md", "told beside told", WORDS)
    told, beside = WORDS[0].pattern, WORDS[2].pattern
    assert prose.grown(places, {("a.md", told): 2, ("a.md", beside): 1}) == []
    assert prose.grown(places, {("a.md", told): 3, ("a.md", beside): 1}) == []
    assert [place.text for place in prose.grown(places, {("a.md", told): 1, ("a.md", beside): 1})] == ["told", "told"]
    counts = prose.counted(places)
    assert prose.added(counts, Counter({("b.md", told): 2, ("a.md", beside): 1})) == []
    assert prose.added(counts, Counter({("a.md", told): 2})) == [beside]
