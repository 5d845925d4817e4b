"""Help and editing of a language: what a family has that states only its words and its grammar."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects.editing import EditingLanguage, Offer, Span, Use, UserName, collected, last_line
from multidrop.dialects.language import Language, labelled, perhaps, remedied

MEANINGS = {"GO": "go to a place", "GONE": "whether it went", "STAY": "stay"}


class Few(Language):
    def names(self) -> list[str]:
        return ["GO", "STAY"]

    def offered(self, product: str, typed: str) -> Iterable[tuple[str, str]]:
        return MEANINGS.items()


def test_a_language_of_which_nothing_is_known_says_so() -> None:
    none = Language()
    assert (none.names(), none.knows("GO"), none.complete(""), none.hint("GO 5")) == ([], False, [], "")
    with pytest.raises(Diagnostic, match="^no help on GO; its drives have no help here$"):
        none.describe("GO")
    with pytest.raises(Diagnostic, match="^no error 5 is known; its drives have no help here$"):
        none.describe_error(5)


def test_completion_offers_the_words_that_begin_so() -> None:
    assert Few().complete(" go") == [("GO", "go to a place"), ("GONE", "whether it went")]
    assert [word for word, _ in Few().complete("")] == ["GO", "GONE", "STAY"] and Few().complete("x") == []
    assert Few().knows(" stay ") and not Few().knows("GONE")


@pytest.mark.parametrize(
    ("text", "word"), [("go", "go"), ("  G1 ", "G1"), ("GO 5", ""), ("GÖ", ""), ("", ""), ("?", "")]
)
def test_only_the_first_word_of_a_line_is_completed(text: str, word: str) -> None:
    assert Few().typing(text) == word


def test_each_fact_is_a_line_behind_its_label() -> None:
    assert labelled([("syntax", "GO X"), ("note", ""), ("in programs", "no")], 11) == [
        "  syntax      GO X",
        "  in programs no",
    ]
    assert remedied("error 5: it stands", "move it") == ["error 5: it stands", "  do         move it"]
    assert remedied("error 6: it moves", "") == ["error 6: it moves"]
    assert perhaps(["GO", "GONE"]) == "perhaps GO, GONE" and perhaps([]) == ""


class Places(EditingLanguage):
    """Lines such as `A: GO B ; remark`: the place A, and a word that goes to B. M is fixed; no name may be `X`."""

    def names(self, text: str) -> list[UserName]:
        lines = text.split("\n")

        def uses() -> Iterable[Use]:
            for at, line in enumerate(lines):
                for found in re.finditer(r"\b[A-Z]\b", line[: self.remark_at(line)]):
                    yield Use(found[0], "label", Span(at, *found.span()), line[found.end() :].startswith(":"))

        return collected(uses(), lambda at: self.remark(lines[at]))

    def remark_at(self, line: str) -> int:
        return len(line.partition(";")[0])

    def offered(self, begun: str, word: str, names: Iterable[UserName], product: str) -> Iterable[Offer]:
        yield from (each.offer for each in names)
        yield Offer("GO", "go to a place", "starts")

    def fixed(self, name: UserName) -> str:
        return "M is the middle" if name.word == "M" else ""

    def spelled(self, name: UserName, new: str, product: str) -> tuple[str, str]:
        return new.upper(), new.lower()

    def changed(self, text: str, renamed: Sequence[str], name: UserName, word: str) -> str:
        return f"line {name.places[-1].line + 1}" if word == "X" else ""


TEXT = "A: GO B ; the first\nM: GO A\nB: GO A"


def named(word: str) -> UserName:
    return next(each for each in Places().names(TEXT) if each.word == word)


def test_the_names_of_a_text_have_their_places_in_order() -> None:
    assert [each.word for each in Places().names(TEXT)] == ["A", "B", "M"]
    assert named("A") == UserName(
        "A", "label", (Span(0, 0, 1),), (Span(0, 0, 1), Span(1, 6, 7), Span(2, 6, 7)), "the first"
    )
    assert named("B").declared == (Span(2, 0, 1),) and named("B").remark == ""


@pytest.mark.parametrize(
    ("word", "new", "why"),
    [
        ("M", "C", "M is the middle"),
        ("A", "m", "M is in use already, in line 2; choose another name"),
        ("B", "a", "A is in use already, in line 1; choose another name"),
        ("A", "x", "line 3 would mean something else with X; choose another name"),
    ],
)
def test_another_name_is_refused_in_one_line(word: str, new: str, why: str) -> None:
    with pytest.raises(Diagnostic) as refused:
        Places().renamed(TEXT, named(word), new, "")
    assert str(refused.value) == why


def test_another_name_is_given_as_the_text_has_it() -> None:
    assert Places().renamed(TEXT, named("A"), "C", "") == "c"
    assert Places().renamed("X: GO X", Places().names("X: GO X")[0], "X", "") == "x", "it is the same name"


@pytest.mark.parametrize(
    ("before", "offered"),
    [("A: ", ["A", "B", "M", "GO"]), ("A: g", ["GO"]), ("A: GO b", ["B"]), ("A: ; g", []), ("A: GO Q", [])],
)
def test_what_begins_as_it_is_typed_is_offered_and_nothing_in_a_remark(before: str, offered: list[str]) -> None:
    assert [each.text for each in Places().offers(before, Places().names(TEXT), "")] == offered


def test_without_more_than_its_grammar_a_language_has_no_help_and_no_outline() -> None:
    made = Places()
    assert (made.words("A: GO B", ()), made.describe("GO", ""), made.outline(TEXT)) == ((), (), ())
    assert made.typing("A: GO_1") == "GO_1" and made.typing("A: GO ") == "" and made.typing("A: GO ; B") == ""


@pytest.mark.parametrize(("line", "last"), [(0, 3), (4, 4), (5, 8), (9, 12), (14, 14)])
def test_a_part_reaches_to_the_line_before_the_next_one(line: int, last: int) -> None:
    assert last_line(line, [0, 4, 5, 9], 12) == last
