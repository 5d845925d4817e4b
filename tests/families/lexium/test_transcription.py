"""The numbers of the tables, compared with a second transcription of the manuals that was made independently of them.

`facts/` has names, ranges, units and defaults only, `-` where the manual gives none. A difference is an error in one of
the two: look the number up in the manual, and correct the wrong one. Where a manual contradicts itself, both follow the
rulings (docs/rulings).
"""

import csv

import pytest

from multidrop.families.lexium.manual.mnemonic import Mnemonic
from multidrop.families.lexium.manual.modbus.registers import ROWS
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS
from tests.support.cases import for_each
from tests.support.paths import ROOT

FACTS = ROOT / "tests" / "families" / "lexium" / "facts"
TABLES = {"mcode.csv": MNEMONICS, "mdrive_plus.csv": MDRIVE}


def facts(name: str) -> list[dict[str, str]]:
    with (FACTS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def said(value: object) -> str:
    return "-" if value in (None, "") else str(value)


@for_each(("table", "fact"), [(table, fact) for table in TABLES for fact in facts(table)])
def test_a_word_has_the_access_range_unit_and_default_of_the_manual(table: str, fact: dict[str, str]) -> None:
    row = TABLES[table][fact["name"]]
    assert fact == {
        "name": row.name,
        "access": row.access,
        "low": said(row.low),
        "high": said(row.high),
        "unit": said(row.unit),
        "default": said(row.default),
        "low_counts": said(row.low_encoder),
        "high_counts": said(row.high_encoder),
        "unit_counts": said(row.unit_encoder),
        "default_counts": said(row.default_encoder),
    }


@pytest.mark.parametrize("table", TABLES)
def test_no_word_that_holds_a_number_is_left_out_of_the_transcription(table: str) -> None:
    def holds(row: Mnemonic) -> bool:
        return row.kind in ("variable", "flag", "instruction", "keyword")

    assert {row.name for row in TABLES[table].values() if holds(row)} <= {fact["name"] for fact in facts(table)}


def test_the_register_map_is_that_of_the_manual_in_its_order() -> None:
    ours = [
        {
            "mnemonic": row.name,
            "address": f"0x{row.address:04X}",
            "registers": str(row.count),
            "bytes": str(row.width),
            "access": row.access,
            "range": row.limits or "-",
            "default": said(row.default),
        }
        for row in ROWS
    ]
    assert ours == facts("modbus.csv")
