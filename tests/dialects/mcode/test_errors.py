"""Error numbers and their texts."""

import csv

import pytest

from multidrop.dialects.mcode.manual import errors
from tests.support.paths import FACTS

TABLE_OF_FACTS = FACTS / "mcode-errors.csv"


def test_every_code_of_both_families_has_a_text_and_no_other() -> None:
    if not TABLE_OF_FACTS.exists():
        pytest.skip(f"{TABLE_OF_FACTS} is not here")
    with TABLE_OF_FACTS.open(encoding="utf-8", newline="") as file:
        facts = list(csv.DictReader(file))
    for family in ("LMD", "LMM"):
        assert set(errors.TEXTS[family]) == {int(fact["code"]) for fact in facts if fact["product"] == family}


@pytest.mark.parametrize(
    ("code", "family", "text"),
    [
        (0, "LMD", "no error"),
        (20, "LMD", "unknown variable or flag"),
        (21, "LMM", "value out of range or not allowed"),
        (104, "LMD", "locked rotor"),
        (104, "LMDCM", "locked rotor"),
        (104, "LMM", "unknown error"),
        (13, "LMM-15", "overcurrent in a motor phase"),
        (13, "LMD", "unknown error"),
        (78, "LMM", "unknown error"),
        (5, "LMD", "unknown error"),
        (-1, "LMD", "unknown error"),
        (30, "MDI", "no such label or user variable"),
    ],
)
def test_text(code: int, family: str, text: str) -> None:
    assert errors.text(code, family) == text


def test_texts_are_a_few_words_and_differ() -> None:
    for texts in errors.TEXTS.values():
        assert all(0 < len(text) <= 70 and not text.endswith(".") for text in texts.values())
        assert len(set(texts.values())) == len(texts)


@pytest.mark.parametrize("code", [20, 21, 24, 28, 30, 37, 41, 44, 73, 83, 84, 86, 94, 96, 104])
def test_common_errors_come_with_what_to_do(code: int) -> None:
    assert errors.hint(code)


def test_no_hint_where_nothing_helps_and_none_for_an_unknown_code() -> None:
    assert errors.hint(0) == errors.hint(65) == errors.hint(999) == ""
    known = {*errors.TEXTS["LMD"], *errors.TEXTS["LMM"]}
    assert all(code in known for code in range(112) if errors.hint(code))
