"""The facts of a word stand in its row: a row answers every question, and what it says is one thing everywhere."""

import csv

import pytest

from multidrop.dialects.codec import Started
from multidrop.dialects.families import FAMILIES
from multidrop.dialects.motions import MoveKind
from multidrop.families.lexium.host import classify, motions
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.motions import known_words
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.host.units import LexiumUnits
from multidrop.families.lexium.manual import groups, guards, program_checker, program_file
from multidrop.families.lexium.manual.mnemonic import (
    LEXIUM,
    MDRIVE_PLUS,
    FormKind,
    Leads,
    Mnemonic,
    MotionEffect,
    PositionEffect,
    PrintedValue,
    Retention,
)
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS, record, whole_row
from multidrop.families.lexium.manual.value_forms import FORMS
from tests.support.cases import for_each
from tests.support.paths import ROOT

MANUAL = ROOT / "families" / "lexium" / "manual"


def cells(name: str) -> dict[str, dict[str, str]]:
    with (MANUAL / name).open(encoding="utf-8", newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file, restval="")}


LEXIUM_CELLS, MDRIVE_CELLS = cells("lexium.csv"), cells("mdrive_plus.csv")


def drive(product: str) -> MCodeState:
    state = MCodeState(MCode())
    state.product = product
    return state


# A row answers every question


@pytest.mark.parametrize("column", next(iter(LEXIUM_CELLS.values())))
def test_a_row_with_an_empty_cell_is_refused_with_its_word_and_column(column: str) -> None:
    row = {**LEXIUM_CELLS["VM"], column: ""}
    with pytest.raises(ValueError, match=rf"the row of {'' if column == 'name' else 'VM'} says nothing of: {column}"):
        record(row, LEXIUM)


def test_a_word_that_no_lexium_has_answers_every_question_in_the_table_of_an_mdriveplus() -> None:
    own = [name for name, row in MDRIVE_CELLS.items() if row["own"]]
    assert {"CM", "IL", "S13"} <= set(own) and set(MDRIVE_CELLS) - set(LEXIUM_CELLS) <= set(own)
    for name in own:
        assert all(whole_row(MDRIVE_CELLS[name], {}).values()), name
    with pytest.raises(ValueError, match="the row of CM says nothing of: alone"):
        record(whole_row({**MDRIVE_CELLS["CM"], "alone": ""}, LEXIUM_CELLS), MDRIVE_PLUS)


def test_a_row_of_an_mdriveplus_takes_from_the_lexium_only_what_both_have() -> None:
    for column in ("section", "note", "products", "reserved_on", "zero_on"):
        with pytest.raises(ValueError, match=f"the row of VM says nothing of: {column}"):
            record(whole_row({**MDRIVE_CELLS["VM"], column: ""}, LEXIUM_CELLS), MDRIVE_PLUS)
    assert MDRIVE["VM"].meaning == MNEMONICS["VM"].meaning and MDRIVE["VM"].high != MNEMONICS["VM"].high


@pytest.mark.parametrize(
    "column",
    ["use", "joined", "leads", "variable", "prints", "setup", "kept", "wire", "quantity", "position", "starts"]
    + ["motion", "at_zero", "alone", "rest", "waiting", "sign", "memory", "restored", "read_back", "turns_at"],
)
def test_a_cell_with_an_unknown_answer_is_refused(column: str) -> None:
    with pytest.raises((ValueError, KeyError)):
        record({**LEXIUM_CELLS["VM"], column: "perhaps"}, LEXIUM)


@for_each("each", [*MNEMONICS.values(), *MDRIVE.values()])
def test_the_facts_of_a_word_agree_with_each_other(each: Mnemonic) -> None:
    assert (each.kept is Retention.NONE) == (not each.valued)
    assert (each.setup.form is FormKind.NONE) == (not each.valued)
    assert (each.restored is not None) == (each.kept in (Retention.SAVED, Retention.UNIT))
    assert each.restored is None or each.access == "RW"
    assert each.read_back is None or each.restored is not None
    assert (each.prints is PrintedValue.NOTHING) <= (each.access in ("WO", "-") or each.kind == "instruction")
    assert (each.setup.form is FormKind.LIST) <= each.lines
    assert (each.trip != 0) <= (each.leads is Leads.ROUTINE) and (each.place >= 0) == (
        each.leads not in (Leads.ON, Leads.RETURN, Leads.END)
    )
    moving = (
        MotionEffect.MOVE,
        MotionEffect.SLEW,
        MotionEffect.HOMING,
        MotionEffect.TEST,
        MotionEffect.PROGRAM,
        MotionEffect.RESUME,
        MotionEffect.RELEASE,
    )
    assert (each.motion in moving) <= each.starts and (each.turns_at is not None) <= each.starts
    assert (each.turn > 0) == (each.position is PositionEffect.SCALES)
    assert each.guard or not each.harmless


def test_a_turn_and_the_bit_of_a_trip_are_given_once() -> None:
    orders = [row.restored for row in groups.ROWS if row.restored]
    assert sorted(orders) == list(range(1, len(orders) + 1)) and len(groups.RESTORED_LAST) == len(orders)
    assert [1 << n for n in range(7)] == list(groups.TRIPS.values())
    assert [row.turn for row in sorted(groups.ROWS, key=lambda row: row.turn) if row.turn] == [1, 2, 3, 4, 5, 6]


def test_what_counts_as_one_thing_in_both_tables_is_one_thing() -> None:
    """A group serves every product, so a word in it means the same on each that has it."""
    for column in ("leads", "variable", "setup", "wire", "quantity", "position", "motion", "alone", "sign", "memory"):
        for name in MDRIVE_CELLS.keys() & LEXIUM_CELLS.keys():
            if not MDRIVE_CELLS[name]["own"]:
                assert MDRIVE_CELLS[name][column] in ("", LEXIUM_CELLS[name][column]), (name, column)


# What a Lexium's manual says of words of which one part of the product knew less than another


@pytest.mark.parametrize("text", ["EL=750", "SA=0.9", "MS=64", "RD=1", "C1=0", "EE=1"])
def test_a_setting_that_changes_a_count_makes_the_place_of_a_drive_unknown(text: str) -> None:
    """(5.1.38, 5.1.114): steps or counts have another length after it."""
    assert classify.may_displace(text)
    assert motions.effect(drive("LMM"), text).unknown == motions.ONLY
    assert list(LexiumUnits(drive("LMM")).disturbs(text)) == [""]


@pytest.mark.parametrize("text", ["HM 1", "HI 3", "HF 1"])
def test_every_homing_is_one(text: str) -> None:
    """(5.1.52 to 5.1.54.)"""
    referencing = FAMILIES["mcode"](drive("LMDCM")).referencing(text)
    assert referencing is not None and referencing.homing
    assert classify.started(text) == Started(None, program=False, lasts=False)
    assert [move.kind for move in motions.effect(drive("LMDCM"), text).begins] == [MoveKind.HOMING]


def test_the_clock_of_an_mdriveplus_moves_it_without_a_line_and_cm_is_a_free_name_elsewhere() -> None:
    """(5-13 of the reference of 2012.)"""
    assert [move.kind for move in motions.effect(drive("MDIX"), "CM=1").begins] == [MoveKind.VELOCITY]
    assert motions.effect(drive("MDIX"), "CM=0").frees
    assert not motions.effect(drive("LMDCM"), "CM=1").begins
    assert known_words("MDIX", motions.FREE) == ["TE", "JE", "CM"]
    assert known_words("LMDCM", motions.FREE) == ["TE", "JE", "FL"]


@pytest.mark.parametrize("text", ["SL 0", "JE=0", "FL=0", "CM=0"])
def test_a_line_that_only_ends_a_motion_needs_no_agreement_even_to_all(text: str) -> None:
    """(5.1.46, 5.1.69, 5.1.117.)"""
    assert guards.only_ends(text)
    assert guards.find(text, address="*", party=True, product="", starts=lambda _: True) is None


def test_every_instruction_with_which_the_motor_turns_is_shown_as_one() -> None:
    """SC turns the shaft (5.1.115); CF switches the bridges on (5.1.20)."""
    for line in ("MA 5", "MR 5", "SL 5", "HM 1", "HI 1", "HF 1", "SC 1", "CF"):
        assert program_file.parts(line)[0].kind == "starts", line
    for line in ("EX G1", "PS", "A=5", "CP"):
        assert program_file.parts(line)[0].kind == "word", line


@for_each(
    ("line", "label"),
    [("BR Q7", "Q7"), ("CL Q7", "Q7"), ("OE Q7", "Q7"), ("TI=1,Q7", "Q7"), ("TP=5,Q7", "Q7"), ("TC=Q7", "Q7")]
    + [("TA=4,Q7", "Q7"), ("TM=Q7", "Q7"), ("TT=5,Q7", "Q7"), ("TR=5,Q7", "Q7"), ("TI=1,MV", "MV")],
)
def test_a_missing_place_is_reported_as_a_label_wherever_a_word_takes_one(line: str, label: str) -> None:
    found = [each for each in program_checker.check(f"PG 1\nLB G1\n{line}\nE\nPG\n") if not each.warning]
    assert [(each.what, each.hint) for each in found] == [(f"no label {label}", f"LB {label} is missing")]


@for_each("each", groups.ROWS)
def test_the_form_of_every_value_has_a_class_that_checks_it(each: Mnemonic) -> None:
    assert (each.setup.form in FORMS) == each.valued
    assert (each.setup.form in (FormKind.FIELDS, FormKind.LIST, FormKind.TRIP)) == bool(each.setup.numbers)
    if each.setup.form is FormKind.FIELDS and len(each.setup.numbers) > 1:
        assert len(each.setup.numbers) == 1 + each.setup.numbers[0]
    assert (each.setup.repeated or each.setup.removable) <= (each.setup.form is FormKind.TRIP)
