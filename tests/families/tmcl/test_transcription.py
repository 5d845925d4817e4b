"""The numbers of the table of parameters, compared with a second transcription of what is public, made independently.

`facts/parameters.csv` has numbers, access, units, ranges and defaults only: `-` is none, `?` not public. A difference
is an error in one of the two: look it up in the firmware manual, and correct the wrong one.
"""

import csv

import pytest

from multidrop.families.tmcl.manual import parameters
from multidrop.families.tmcl.manual.parameters import GROUPS, INT32, Starts, TmclParameter, record
from tests.support.cases import for_each
from tests.support.paths import ROOT

with (ROOT / "tests" / "families" / "tmcl" / "facts" / "parameters.csv").open(encoding="utf-8", newline="") as file:
    FACTS = list(csv.DictReader(file))
with (ROOT / "families" / "tmcl" / "manual" / "parameters.csv").open(encoding="utf-8", newline="") as file:
    CELLS = list(csv.DictReader(file))
OF_CHIPS = {"of 2047"}


def said(row: TmclParameter, fact: dict[str, str]) -> dict[str, str]:
    found = {
        "group": fact["group"],
        "number": fact["number"],
        "access": "RW" if row.writable else "R",
        "unit": row.unit or "-",
        "low": str(row.limits[0]) if row.writable else "-",
        "high": str(row.limits[-1]) if row.writable else "-",
        "default": str(row.fresh) if row.writable else "-",
    }
    return {key: "?" if fact[key] == "?" else text for key, text in found.items()}


@for_each("fact", FACTS)
def test_a_parameter_has_the_access_unit_range_and_default_that_are_public(fact: dict[str, str]) -> None:
    assert fact == said(GROUPS[fact["group"]][int(fact["number"])], fact)


@pytest.mark.parametrize("group", ["axis", "chip", "global"])
def test_no_unit_is_left_out_of_the_transcription(group: str) -> None:
    told = {int(fact["number"]) for fact in FACTS if fact["group"] == group}
    assert {number for number, row in GROUPS[group].items() if row.unit} - told <= (
        {181} if group != "global" else set()
    )


def test_a_module_counts_in_units_of_its_chip_or_in_microsteps_and_never_in_both() -> None:
    assert {row.unit for row in GROUPS["chip"].values()} <= {"", *OF_CHIPS}
    assert not {row.unit for row in GROUPS["axis"].values()} & OF_CHIPS
    assert [number for number, row in GROUPS["axis"].items() if not row.known and row.limits != INT32] == []


@pytest.mark.parametrize("column", next(iter(CELLS)))
def test_a_row_with_an_empty_cell_is_refused_with_its_column(column: str) -> None:
    with pytest.raises(ValueError, match=f"says nothing of: {column}"):
        record({**CELLS[4], column: ""})


def test_a_row_for_some_modules_differs_only_in_units_range_and_default() -> None:
    """Code asks for the facts of a parameter whatever the module is."""
    for group, table in GROUPS.items():
        for number, row in table.items():
            shared = GROUPS["axis"].get(number, row) if group != "global" else row
            own = {"unit", "limits", "fresh", "known", "title"}
            assert {key: each for key, each in vars(row).items() if key not in own} == {
                key: each for key, each in vars(shared).items() if key not in own
            }, (group, number)


@for_each("cells", CELLS)
def test_the_cells_of_a_row_agree_with_each_other(cells: dict[str, str]) -> None:
    row = record(cells)
    assert (cells["restored"] == "-") == (not row.setting)
    assert (row.starts is not Starts.NOTHING) <= (row.writable and row.quantity is not None)
    assert row.wire <= (row.restored > 0) and bool(row.risk) <= row.setting and row.clears <= (not row.writable)
    assert cells["group"] != "global" or (row.starts, row.quantity, row.scale) == (Starts.NOTHING, None, 0)


def test_a_turn_is_given_once() -> None:
    assert [parameters.AXIS[number].scale for number in parameters.SCALES] == [*range(1, len(parameters.SCALES) + 1)]


@pytest.mark.parametrize("column", ["live", "starts", "quantity", "scale", "ramp", "restored", "wire", "clears"])
def test_a_cell_with_an_unknown_answer_is_refused(column: str) -> None:
    with pytest.raises((ValueError, KeyError)):
        record({**CELLS[4], column: "perhaps"})
