"""The tables of mnemonics and errors: complete against the facts, and right in the values looked up by hand."""

import csv
import re

import pytest

from multidrop.families.lexium.manual import errors
from multidrop.families.lexium.manual.groups import PRINTS_LINES
from multidrop.families.lexium.manual.mnemonic import LEXIUM, MDRIVE_PLUS, Mnemonic
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS, lookup, words
from tests.support.cases import for_each
from tests.support.paths import FACTS


def facts(name: str) -> list[dict[str, str]]:
    path = FACTS / name
    if not path.exists():
        pytest.skip(f"{path} is not here")
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def row(word: str) -> Mnemonic:
    found = lookup(word)
    assert found is not None, word
    return found


def expand(word: str) -> list[str]:
    """`D<1-4>`, `F1 — F8`, `O1, O2, O3`, `IS <1-4>` and `I7 - I13` as the names of their rows."""
    if word[:2] in ("IS", "OS"):
        return [word[:2]]
    if "," in word:
        return word.split(", ")
    span = re.fullmatch(r"([A-Z])<?(\d+)\s*[-—]\s*[A-Z]?(\d+)>?", word)
    return [f"{span[1]}{n}" for n in range(int(span[2]), int(span[3]) + 1)] if span else [word]


def test_every_mnemonic_and_operator_of_the_manuals_tables_has_a_row() -> None:
    names = [name for fact in facts("mcode-mnemonics.csv") for name in expand(fact["mnemonic"])]
    assert len(names) > 150
    assert [name for name in names if name not in MNEMONICS] == []


def test_every_command_of_section_5_has_a_row_that_names_its_section() -> None:
    for fact in facts("mcode-details.csv"):
        for name in expand(fact["mnemonic"]):
            said = row(name).section
            first, _, last = said.partition(" to ")
            numbers = [int(each.split(".")[2]) for each in (first, last or first)]
            assert numbers[0] <= int(fact["section"]) <= numbers[1], (name, said)


def test_there_is_no_row_but_those() -> None:
    assert set(MNEMONICS) == {name for fact in facts("mcode-mnemonics.csv") for name in expand(fact["mnemonic"])}


def test_access_is_the_summary_tables_but_for_the_rulings() -> None:
    ruled = {"MD": "RO", "IT": "RO", "OF": "RO", "ST": "RC", "OE": "RW", "RD": "RW", "AL": "RO", "UV": "RO", "VR": "RO"}
    for fact in facts("mcode-mnemonics.csv"):
        if fact["type"] in ("Variable", "Flag", "Keyword") and fact["access"] not in ("", "—"):
            for name in expand(fact["mnemonic"]):
                assert row(name).access == ruled.get(name, fact["access"].upper()), name
    assert {name: row(name).access for name in ruled} == ruled


PROGRAM_ONLY = {"RT", "CL", "LB", "H", "IV"}
IMMEDIATE_ONLY = {"EX", "CP", "L", "AL"}


def test_only_these_are_kept_to_one_mode() -> None:
    rows = [each for each in MNEMONICS.values() if each.kind != "reserved"]
    assert {each.name for each in rows if not each.immediate} == PROGRAM_ONLY
    assert {each.name for each in rows if not each.program} == IMMEDIATE_ONLY


@for_each(
    ("word", "low", "high", "default"),
    [
        ("A", 66, 1100000000, 1000000), ("D", 66, 1100000000, 1000000),
        ("VI", 1, 2559999, 1000), ("VM", 2, 2560000, 768000), ("SL", -5000000, 5000000, None),
        ("MA", -2147483648, 2147483647, None), ("MS", 1, 256, 256), ("MT", 0, 65535, 0), ("HT", 0, 65535, 500),
        ("HC", 0, 100, 5), ("RC", 1, 100, 25), ("P", -2147483648, 2147483647, 0), ("DB", 0, 65000, 1),
        ("SF", 0, 65000, 15), ("EM", 0, 3, 0), ("ES", 0, 3, 1), ("CE", 0, 2, 1), ("CK", 0, 2, 0), ("DG", 0, 1, 1),
        ("DE", 0, 1, 1), ("DN", None, None, "!"), ("BD", 11, 96, 96), ("AS", 0, 3, 0), ("CB", 0, 3, 1),
        ("LT", 2, 65535, 2000), ("LD", 0, 2147483647, 102400), ("MF", 92, 2560000, 768000), ("TQ", 1, 100, 25),
        ("TS", 46512, 2560000, 0), ("TE", 0, 127, 0), ("TA", 0, 31, 0), ("TT", 1, 65535, None),
        ("AO", 0, 4294967295, 0), ("CW", 0, 255, 10), ("D3", 0, 255, 0), ("D5", 0, 1000, 0), ("I5", 0, 4095, None),
        ("OT", 0, 7, None), ("OF", 0, 3, 0), ("LM", 1, 6, 1), ("WT", 0, 84, 80), ("IT", -20, 100, None),
        ("FS", -25600, 25600, 0), ("EL", 1, 2000, 1000), ("SA", 0.45, 5, 1.8), ("R4", -2147483648, 2147483647, 0),
        ("H", 1, 65000, None), ("RA", 0, 1, 1), ("PF", None, None, "10,6,0,0"), ("TD", 0, 1, 1), ("VF", 0, 1000, 0),
    ],
)  # fmt: skip
def test_range_and_default(word: str, low: float | None, high: float | None, default: object) -> None:
    found = row(word)
    assert (found.low, found.high, found.default) == (low, high, default)


@pytest.mark.parametrize(
    ("word", "low", "high", "default"),
    [
        ("A", 6, 44000000, 78125), ("D", 6, 44000000, 78125),
        ("VI", 1, 199999, 78), ("VM", 2, 200000, 60000), ("SL", -200000, 200000, None),
    ],
)  # fmt: skip
def test_range_and_default_in_encoder_counts(word: str, low: int, high: int, default: int | None) -> None:
    found = row(word)
    assert (*found.bounds(encoder=True), found.default_encoder) == (low, high, default)
    assert found.unit_encoder.startswith("counts")


def test_a_number_is_accepted_by_the_list_where_there_is_one_and_by_the_range_elsewhere() -> None:
    assert row("MS").accepts(25) and not row("MS").accepts(3)
    assert row("BD").accepts(11) and not row("BD").accepts(57)
    assert row("SA").accepts(0.72) and not row("SA").accepts(1)
    assert row("A").accepts(44000001) and not row("A").accepts(44000001, encoder=True)
    assert row("A").accepts(6, encoder=True) and not row("A").accepts(65)


@pytest.mark.parametrize(
    "word", ["d1", "D4", "D5", "i1", "I6", "I7", "I13", "O1", "o3", "F1", "f8", "R4", "is", " OS "]
)
def test_indexed_words_are_found_one_by_one_in_any_case(word: str) -> None:
    assert row(word).name == word.strip().upper()


@pytest.mark.parametrize("word", ["D6", "I14", "O0", "F9", "R5", "R0", "O5", "S6", "S14", "Q1", "", "M", "IS1"])
def test_words_that_do_not_exist_are_not_found(word: str) -> None:
    assert lookup(word) is None


def test_the_steps_kept_for_the_products_that_have_them() -> None:
    hmt = {"AF", "AS", "AV", "CB", "CF", "LD", "LG", "LL", "LR", "LT", "MF", "MU", "TD", "TQ", "TS", "VF", "TA", "SC"}
    assert {name for name, each in MNEMONICS.items() if each.products == {"LMDCM", "LMDCE"}} == hmt
    serial = {"BD", "CK", "DG", "DN", "PY", "QD"}
    assert {name for name, each in MNEMONICS.items() if each.products == {"LMDOM", "LMDCM", "LMM"}} == serial
    assert {name for name, each in MNEMONICS.items() if each.products == {"LMM"}} == {"EL", "PW", "SA"}
    for word in ("C2", "DB", "EE", "HI", "HF", "FS", "I6", "PM", "SF", "SM", "ST"):
        assert not row(word).products & {"LMDOM", "LMDOE"}, word


def test_firmware_6_words_and_is_and_os_are_free_names_on_mdriveplus_and_s1_to_s5_on_lexium() -> None:
    newer = ["DT", "AJ", "DJ", "BE", "BL", "BM", *(f"F{n}" for n in range(1, 9)), "FL", "FS", "HF", "LS", "PF"]
    for word in [*newer, "RA", "AV", "IS", "OS"]:
        assert lookup(word, "MDI") is None and lookup(word, "LMDCM") is row(word), word
    for n in range(1, 6):
        assert lookup(f"S{n}", "LMDCM") is None and lookup(f"S{n}", "MDI") is row(f"S{n}")


@pytest.mark.parametrize("product", ["MDI", "MDIE", "MDIX", "MDI-34"])
def test_an_mdriveplus_has_a_table_of_its_own(product: str) -> None:
    assert words(product) is MDRIVE and words("LMDCM") is words("") is MNEMONICS
    assert lookup("ol", product) is MDRIVE["OL"] is row("OL") and lookup("OL", "LMDCM") is None
    assert lookup("VM", product) is MDRIVE["VM"] is not row("VM") is MNEMONICS["VM"]
    assert lookup("RD", product) is None and lookup("AT", product) is MDRIVE["AT"]


def test_a_word_that_another_lexium_has_stays_reserved_but_pw_is_free() -> None:
    assert lookup("EL", "LMDCM") is row("EL") and "LMDCM" not in row("EL").products
    assert lookup("BD", "LMDCE") is row("BD") and "LMDCE" not in row("BD").products
    assert lookup("PW", "LMDCM") is None and lookup("PW", "LMM") is row("PW")


def test_words_that_print_lines() -> None:
    assert {"AL", "UV", "IS", "OS", "LS"} == PRINTS_LINES


def test_what_may_not_be_stepped_and_with_which_error() -> None:
    allowed = {"A", "D", "P", "C1", "C2", "VI", "VM", "HC", "RC", "HT", "MT", "R1", "F8", "D1"}
    assert {row(word).step for word in allowed} == {0}
    assert {row(word).step for word in ("MS", "EM", "LM", "EE", "AS", "BD", "TE", "O1", "IS")} == {26}
    assert {row(word).step for word in ("V", "MV", "I1", "BY", "VR", "PC", "MR")} == {25}


@for_each(
    ("family", "each"),
    [(LEXIUM, each) for each in MNEMONICS.values()] + [(MDRIVE_PLUS, each) for each in MDRIVE.values()],
)
def test_a_row_is_consistent(family: frozenset[str], each: Mnemonic) -> None:
    assert each.title and 0 < len(each.meaning) <= 90 and not each.meaning.endswith(".")
    assert each.access in {"RW", "RO", "WO", "RC", "-"} and each.products <= each.reserved_on <= family
    assert each.products or each.name == "IT"
    assert each.kind in {"variable", "flag", "instruction", "keyword", "math", "reserved"}
    assert each.section
    assert each.syntax or each.kind == "reserved"
    assert (each.low is None) == (each.high is None)
    assert all(each.accepts(value) for value in each.values)
    for encoder, default in ((False, each.default), (True, each.default_encoder)):
        low, high = each.bounds(encoder)
        if low is not None and high is not None:
            assert low <= high
            if isinstance(default, int | float) and each.name != "TS":  # 0 until it is set
                assert low <= default <= high


# Error numbers


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
