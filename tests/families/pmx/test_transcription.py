"""The numbers of the table of commands, compared with a second transcription of the manual, made independently of it.

`facts/commands.csv` has names, access, ranges and units only, `-` where the manual gives none. A difference is an error
in one of the two: look it up in the manual, and correct the wrong one. Both follow the rulings (docs/rulings/pmx.md).
"""

import csv

import pytest

from multidrop.families.pmx.manual.table import COMMANDS, PmxRetention, record
from tests.support.cases import for_each
from tests.support.paths import ROOT

with (ROOT / "tests" / "families" / "pmx" / "facts" / "commands.csv").open(encoding="utf-8", newline="") as file:
    FACTS = list(csv.DictReader(file))
with (ROOT / "families" / "pmx" / "manual" / "commands.csv").open(encoding="utf-8", newline="") as file:
    CELLS = {row["name"]: row for row in csv.DictReader(file)}


def said(value: object) -> str:
    return "-" if value in (None, "") else str(value)


@for_each("fact", FACTS)
def test_a_command_has_the_access_range_and_unit_of_the_manual(fact: dict[str, str]) -> None:
    row = COMMANDS[fact["name"]]
    assert fact == {
        "name": row.name,
        "access": row.access,
        "low": said(row.low),
        "high": said(row.high),
        "unit": said(row.unit),
    }


def test_no_command_is_left_out_of_the_transcription_but_those_of_the_manuals_text() -> None:
    assert set(COMMANDS) - {fact["name"] for fact in FACTS} == {"X", "Y", "I", "CLRS"}


@pytest.mark.parametrize("column", next(iter(CELLS.values())))
def test_a_row_with_an_empty_cell_is_refused_with_its_column(column: str) -> None:
    with pytest.raises(ValueError, match=f"says nothing of: {column}"):
        record({**CELLS["HSPD"], column: ""})


@pytest.mark.parametrize("column", ["starts", "motion", "kept", "position", "corrects"])
def test_a_cell_with_an_unknown_answer_is_refused(column: str) -> None:
    with pytest.raises((ValueError, KeyError)):
        record({**CELLS["HSPD"], column: "perhaps"})


def test_the_facts_of_a_command_agree_with_each_other() -> None:
    for row in COMMANDS.values():
        assert (row.kept is not PmxRetention.NONE) == (row.access == "RW"), row.name
        assert (row.low is None) == (row.high is None) and (row.low is None or row.kept is not PmxRetention.NONE), (
            row.name
        )
        assert not row.quiet or row.starts, row.name
