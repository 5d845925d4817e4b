"""The tables of the manuals: each row has its cells under the right heads, and a word or number has one row."""

import csv

import pytest

from multidrop.base.files import rows
from tests.support.paths import ROOT

TABLES = sorted(each for room in ("dialects", "families", "simulator") for each in (ROOT / room).rglob("*.csv"))
PAIRS = (
    ["group", "number"],
    ["name", "each"],
    ["name", "asks"],
    ["word", "form"],
    ["word", "text"],
    ["topic", "text"],
    ["of", "value"],
    ["group", "point"],
    ["mode", "sign"],
)
"""The heads of the two cells that are the key of a row together."""


def test_a_row_may_leave_out_its_last_cells(tmp_path):
    (tmp_path / "a.csv").write_text('name,low,note\nA,1,"x, y"\nB\n', encoding="utf-8")
    found = list(rows(str(tmp_path / "reader.py"), "a.csv"))
    assert found == [{"name": "A", "low": "1", "note": "x, y"}, {"name": "B", "low": "", "note": ""}]


def test_the_tables_are_found():
    assert {"lexium.csv", "mdrive_plus.csv", "errors.csv", "commands.csv", "registers.csv"} <= {
        each.name for each in TABLES
    }


@pytest.mark.parametrize("table", TABLES, ids=lambda path: path.name)
def test_every_row_of_a_table_is_sound(table):
    with table.open(encoding="utf-8", newline="") as file:
        head, *found = csv.reader(file)
    assert len(set(head)) == len(head) and all(head)
    for row in found:
        assert 0 < len(row) <= len(head) and row[-1], row
        assert [cell for cell in row if cell != cell.strip() or "\n" in cell] == [], row
    keys = [tuple(row[:2]) if head[:2] in PAIRS else row[0] for row in found]
    assert len(set(keys)) == len(keys)
