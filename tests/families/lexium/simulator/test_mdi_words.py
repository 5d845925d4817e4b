"""Every word of an MDrivePlus on each of its three personalities, over the port, against the facts.

The facts say what the maker's reference prints. Where the simulated unit does otherwise by ruling (docs/rulings.md),
that is one of the tables at the head of this file.
"""

from __future__ import annotations

import csv
import re

import pytest

from multidrop.families.lexium.manual.errors import TEXTS
from multidrop.families.lexium.manual.table import MDRIVE
from tests.support.cases import for_each
from tests.support.mdrive_unit import Unit
from tests.support.paths import FACTS

pytestmark = pytest.mark.slow

TABLE_OF_FACTS = FACTS / "mdi-mnemonics.csv"
UNITS = ("MDI", "MDIE", "MDIX")
PRINTS_ZERO = {"EE", "ST", "C2"}
"""Read as 0 without an encoder: a client for real units polls them, and waits for ever after an error."""
RULED_HERE = {"FC": UNITS, "VF": UNITS, "WT": UNITS, "IT": (), "S13": ("MDIX",)}
"""Marked for every product, or for another size: where they work here."""
OPERATORS = re.compile(r"[^A-Z0-9]+")
ELSEWHERE = {"ST", "TE", "TI", "TT", "DN", "ER"}
"""Their ranges have tests of their own."""
MODES = {"CK", "EM", "PY"}
"""They change how what follows is answered."""
PREPARED = {
    "VI": ["VM=5000000"],
    "VM": ["VI=1"],
    "HT": ["MT=0"],
    "MT": ["HT=0"],
    "OT": ["S1=16,0,0"],
    "OL": ["S1=16,0,0"],
    "OH": ["S9=16,0,0"],
    "TE": ["PG 1", "LB K1", "RT", "PG", "TI=1,K1", "TT=60000,K1", "TP=5,K1"],
    **{f"O{n}": [f"S{n}=16,0,0"] for n in (1, 2, 3, 4, 9, 10, 11, 12)},
}
"""Lines before a word can have all its values."""
RANGES = {
    "VI": (1, 4999999),
    "VM": (2, 5000000),
    "R1": (-2147483648, 2147483647),
    "R2": (-2147483648, 2147483647),
    "R3": (-2147483648, 2147483647),
    "R4": (-2147483648, 2147483647),
    "EL": (50, 6400),
    "OT": (0, 255),
}
"""Ranges that are no plain pair in the facts, or are ruled."""
BEYOND = {"BD": 61}
TYPED_TOO = {"E"}
"""For programs only as printed; clients of real units type it."""
STORED_TOO = {"PR", "R1", "R2", "R3", "R4"}
"""For immediate use only as printed; every sample has them in programs."""
NOT_RUNNING = {"CL": "CL K1", "H": "H 5"}
"""Typed while no program runs: 40."""


def facts() -> list[dict[str, str]]:
    if not TABLE_OF_FACTS.exists():
        pytest.skip(f"{TABLE_OF_FACTS} is not here")
    with TABLE_OF_FACTS.open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [{**row, "name": name} for row in rows for name in expand(row["mnemonic"])]


def expand(word: str) -> list[str]:
    """`O<1-4>` as the four words that it stands for."""
    span = re.fullmatch(r"([A-Z]+)<(\d+)-(\d+)>", word)
    return [f"{span[1]}{n}" for n in range(int(span[2]), int(span[3]) + 1)] if span else [word]


def words() -> list[dict[str, str]]:
    return [row for row in facts() if row["name"] != "<number>" and not OPERATORS.fullmatch(row["name"])]


def free(row: dict[str, str]) -> bool:
    """A word of the Hybrid, or of MForce."""
    return not set(row["products"]) & set("DXE-") and row["kind"] != "reserved"


def there(row: dict[str, str], personality: str) -> bool:
    """Whether the unit executes the word."""
    name, base = row["name"], row["base"]
    if name in RULED_HERE:
        return personality in RULED_HERE[name]
    if base == "odd" or base == "no":
        return personality == "MDIX"
    return base == "yes" or (base == "enc" and personality != "MDI")


def span(row: dict[str, str]) -> tuple[int, int] | None:
    if row["name"] in RANGES:
        return RANGES[row["name"]]
    if row["range"] == "0/1":
        return 0, 1
    found = re.match(r"(?:EE=0 )?(0 or )?(-?\d+)\.\.(\d+)\b", row["range"])
    return (0 if found[1] else int(found[2]), int(found[3])) if found else None


def default(row: dict[str, str]) -> str:
    """The first number or name of the facts' default; empty where none is printed."""
    found = re.match(r"[-\d.,!]+", row["default"])
    return found[0].rstrip(",") if found else ""


@pytest.mark.parametrize("personality", UNITS)
def test_what_a_word_is_on_a_unit(personality: str) -> None:
    wrong = []
    for row in words():
        name = row["name"]
        read, declared = Unit(personality).say(f"PR {name}", f"VA {name}")
        (written,) = Unit(personality).say(f"{name}=1")
        if free(row):
            expected = ["?35", "?20", ""]
            found = [read, written, declared]
        elif row["kind"] == "reserved":
            expected, found = ["?35", "?24", "?24"], [read, written, declared]
        elif not there(row, personality):
            expected = ["0" if name in PRINTS_ZERO else "?37", "?37", "?29"]
            found = [read, written, declared]
        else:
            expected, found = ["?29"], [declared]
            if row["rw"] in ("RO", "RW") and row["kind"] in ("variable", "flag"):
                expected, found = [*expected, True], [*found, not read.startswith("?")]
            if row["rw"] == "WO":
                expected, found = [*expected, "?35"], [*found, read]
            if row["rw"] == "RO" and row["kind"] in ("variable", "flag") and name != "IF":
                expected, found = [*expected, True], [*found, written in ("?25", "?24", "?60", "?20")]
        if expected != found:
            wrong.append((name, expected, found))
    assert wrong == []


@pytest.mark.parametrize("personality", UNITS)
def test_every_word_has_a_row_with_the_facts_access_and_usage(personality: str) -> None:
    for row in facts():
        if row["name"] == "<number>" or free(row):
            continue
        ours = MDRIVE[row["name"]]
        assert (personality in ours.products) is there(row, personality) or row["kind"] == "reserved", row["name"]
        if row["rw"] != "-":
            assert ours.access == row["rw"], row["name"]
        if row["use"] in ("I", "P", "I/P"):
            assert ours.immediate is ("I" in row["use"] or row["name"] in TYPED_TOO), row["name"]
            assert ours.program is ("P" in row["use"] or row["name"] in STORED_TOO), row["name"]
        if row["page"]:
            assert ours.section.partition(";")[0] in row["page"], row["name"]


@pytest.mark.parametrize("personality", UNITS)
def test_a_value_from_the_factory(personality: str) -> None:
    checked = []
    for row in words():
        name, wanted = row["name"], default(row)
        if free(row) or not there(row, personality) or row["rw"] not in ("RO", "RW", "-") or not wanted:
            continue
        if row["kind"] == "instruction" and not re.fullmatch(r"S\d+", name):
            continue
        said = Unit(personality).say(f"PR {name}")[0].strip('"').replace(" ", "")
        assert said == (f"{wanted},0" if name == "S13" else wanted), name
        checked.append(name)
    assert len(checked) > 40


@pytest.mark.parametrize("personality", UNITS)
def test_a_number_is_taken_from_the_lowest_to_the_highest_and_not_beyond(personality: str) -> None:
    checked = []
    for row in words():
        name, found = row["name"], span(row)
        settable = row["rw"] in ("RW", "WO") and row["kind"] in ("variable", "flag")
        if found is None or not settable or free(row) or not there(row, personality) or name in ELSEWHERE:
            continue
        low, high = found
        for value in (low, high):
            unit = Unit(personality, *PREPARED.get(name, []))
            assert unit.say(f"{name}={value}") == [""], (name, value)
            if row["rw"] == "RW" and name not in MODES:
                assert unit.say(f"PR {name}") == [str(value)], (name, value)
        for value in (low - 1, high + 1):
            unit = Unit(personality, *PREPARED.get(name, []))
            assert unit.say(f"{name}={value}") == [f"?{BEYOND.get(name, 21)}"], (name, value)
        checked.append(name)
    assert len(checked) > 38


@pytest.mark.parametrize("personality", UNITS)
def test_an_error_may_be_set_to_any_code_and_its_flag_only_read(personality: str) -> None:
    unit = Unit(personality)
    assert unit.write("ER=109\r")[-1] == "?" and unit.say("PR ER", "PR EF", "PR ER") == ["109", "0", "0"]
    assert unit.say("ER=110", "ER=-1", "EF=0", "IF=1", "IF=0") == ["?21", "?21", "?25", "?21", ""]


def test_trips_are_of_the_points_and_the_positions_that_a_unit_has() -> None:
    for personality, numbers in (("MDI", (1, 2, 3, 4)), ("MDIX", (1, 2, 3, 4, 9, 10, 11, 12))):
        unit = Unit(personality, "PG 1", "LB K1", "RT", "PG", "TT=1,K1", "TT=65535,K1", "TP=-5,K1")
        for n in range(15):
            assert unit.say(f"TI={n},K1") == ["" if n in numbers else "?10"], n
        assert unit.say("TT=0,K1", "TT=65536,K1", "TE=11", "TE=64", "TE=-1", "TE=4") == [
            *("?21", "?21", "", "?21", "?21", "?27"),
        ]


@pytest.mark.parametrize("personality", ["MDIE", "MDIX"])
@pytest.mark.parametrize(
    ("name", "low", "high", "preset"),
    [("A", 91, 61035160, 40000), ("D", 91, 61035160, 40000), ("VI", 1, 199999, 40), ("VM", 2, 200000, 30720)],
)
def test_motion_in_counts_has_ranges_and_values_of_its_own(
    personality: str, name: str, low: int, high: int, preset: int
) -> None:
    prepared = ["VI=1"] if name == "VM" else ["VM=200000"]
    assert Unit(personality, "EE=1").say(f"PR {name}") == [str(preset)]
    for value, said in ((low, ""), (high, ""), (low - 1, "?21"), (high + 1, "?21")):
        assert Unit(personality, "EE=1", *prepared).say(f"{name}={value}") == [said], value
    assert Unit(personality, "EE=1", "EE=0").say(f"PR {name}") == [str(MDRIVE[name].default)]
    assert Unit(personality, "EE=1").say("SL 200001", "SL -200000") == ["?21", ""]


@pytest.mark.parametrize("personality", UNITS)
def test_a_word_stands_only_where_it_may(personality: str) -> None:
    for row in words():
        name = row["name"]
        if row["use"] not in ("I", "P", "I/P") or free(row) or not there(row, personality):
            continue
        if row["use"] == "P" and name not in TYPED_TOO and name != "SU":
            assert Unit(personality).say(f"{name} K1") == ["?46"], name
        if row["use"] == "I" and name not in STORED_TOO | {"CP", "L", "EX", "PG"}:
            unit = Unit(personality, "PG 1")
            assert unit.write(f"{name} 1\rPG\r")[-1] == "?" and unit.say("PR ER") == ["24"], name
    for line in NOT_RUNNING.values():
        assert Unit(personality).say(line) == ["?40"], line


@pytest.mark.parametrize("personality", UNITS)
def test_operators_work_and_functions_are_names(personality: str) -> None:
    unit = Unit(personality, "R1=25", "R2=30")
    for line, value in (("R1+R2", 55), ("R1-R2", -5), ("R1*R2", 750), ("R2/R1", 1), ("R1&R2", 24), ("R1|R2", 31),
                        ("R1^R2", 7), ("!R1", -26)):  # fmt: skip
        assert unit.say(f"R3={line}", "PR R3") == ["", str(value)], line
    for word in ("AB", "CS", "LO", "PI", "SI", "SQ", "TG", "F1", "F8", "PF", "RA"):
        assert Unit(personality).say(f"VA {word}=7", f"R1={word}+1", "PR R1") == ["", "", "8"], word


LEXIUM_ONLY = [
    *("AJ", "AO", "BE", "BL", "BM", "DJ", "DT", "F1", "FL", "FS", "HF", "IS"),
    *("LS", "OF", "OS", "PF", "PK", "PW", "RA", "RD", "SA", "TM", "VT"),
]
HYBRID_ONLY = [
    *("AF", "AS", "CA", "CB", "CC", "CF", "CT", "LD", "LG", "LL"),
    *("LR", "LT", "MF", "MU", "SC", "SS", "TA", "TD", "TQ", "TS"),
]


@pytest.mark.parametrize("personality", UNITS)
def test_a_word_of_other_products_is_a_label_and_a_variable(personality: str) -> None:
    for word in (*LEXIUM_ONLY, *HYBRID_ONLY):
        _is_a_label_and_a_variable(personality, word)


def _is_a_label_and_a_variable(personality: str, word: str) -> None:
    name = word[0] + word[1].lower()
    unit = Unit(personality, f"VA {name}", f"{name}=5", f"IC {word}")
    assert unit.say(f"PR {name}", f"R1={name}*2", "PR R1", f"DC {name}", f"PR {word}") == ["6", "", "12", "", "5"], word
    program = ("BR Z9", f"LB {name}", "IC R1", "RT", "LB Z9", f"CL {word}", "BR K1,R1=1", "E", "LB K1", 'PR "ok"', "E")
    unit = Unit(personality, "PG 1", *program, "PG")
    assert unit.say("EX 1") == [""]
    assert "ok\r\n" in unit.told(1.0), word


EXPANDED_LINES = [
    *("S7=33,0", "S8=33,0", "S9=0,0,0", "S12=16,0,0", "S13=60,0", "OH=1", "D9=5", "D12=5", "EL=500", "CW=5", "FM=3"),
    *("CM=1", "CR=0.5", "O9=1", "TC=1", "TR=5,0", "PR IH", "PR I9", "PR I12", "PR PC", "PR TC", "PR TR", "IC D9"),
]


@for_each("personality", ["MDI", "MDIE"])
@for_each("line", EXPANDED_LINES)
def test_expanded_words_are_known_and_not_there_on_a_base_unit(personality: str, line: str) -> None:
    assert Unit(personality).say(line) == ["?37"]


@pytest.mark.parametrize("line", [each for each in EXPANDED_LINES if each not in ("OH=1", "O9=1", "TC=1")])
def test_they_are_there_with_expanded_io(line: str) -> None:
    assert not Unit("MDIX", "S9=16,0,0").say(line)[0].startswith("?"), line


@pytest.mark.parametrize(
    "line",
    ["PR DB", "DB=5", "EE=1", "HI 1", "PR I6", "PM=1", "SF=20", "SM=1", "PR SM", "ST=0", "EE=0", "IC SF", "C2=0"],
)
def test_encoder_words_need_the_encoder(line: str) -> None:
    assert Unit("MDI").say(line) == ["?37"]
    assert not Unit("MDIE").say(line)[0].startswith("?") and not Unit("MDIX").say(line)[0].startswith("?")


@pytest.mark.parametrize("personality", UNITS)
def test_no_code_comes_that_the_firmware_does_not_have(personality: str) -> None:
    """Unknown words, bare numbers, wrong lines: 20 or another code of its section 9, never a Lexium's."""
    lines = [
        *("XX", "XX=1", "PR XX", "Q1", "AO=1", "5+5", "?", "(", "R15", "!", "VM", "MR", "LB", "VA 1", "VA ABC", "PS"),
        *("RS", "RT", "CP X", "EX XX", "VM=0", "VI=768000", "TE=1", "MR x", "HM 1", "S1=12,0,0", "FL=1", "MU=1"),
    ]
    for line in lines:
        (said,) = Unit(personality).say(line)
        code = int(said.removeprefix("?"))
        assert said.startswith("?") and code in TEXTS["MDI"] and code != 60, (line, said)
    assert Unit(personality).say("XX", "XX=1", "Q1", "AO=1") == ["?20"] * 4
