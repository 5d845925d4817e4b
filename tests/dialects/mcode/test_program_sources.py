"""MCode program files: what their text tells of what is wrong, and one made of what is in a drive."""

from __future__ import annotations

import pytest

from multidrop.dialects.families import program_language_of, program_languages
from multidrop.dialects.mcode.manual.program_checker import check

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
    assert [program_language_of(name) for name in ("a.prg", "b/A.ASC", "c.mxt", "d.txt", "e")] == [
        "pmx",
        "pmx",
        "mcode",
        "mcode",
        "mcode",
    ]
    assert set(program_languages()) == {"mcode", "pmx"}
