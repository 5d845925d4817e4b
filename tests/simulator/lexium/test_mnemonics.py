"""Every word of the language on every Lexium: read, written at its limits and beyond, refused where it is not."""

import pytest

from dialects.mcode.manual.table import MNEMONICS
from simulator.cell.spec import DriveSpec, WorldSpec
from simulator.lexium.device import MCodeDevice
from simulator.lexium.language.instructions import COMMANDS
from simulator.world import World


def drive(personality, *lines):
    device = MCodeDevice(DriveSpec(personality=personality), World(WorldSpec()))
    device.prints()
    for line in lines:
        assert not device.execute(line, 0.0).refused, line
    return device


def say(device, line):
    """What a line printed, or the code of its refusal as `?code`."""
    answer = device.execute(line, device.now)
    if answer.refused:
        return "?" + device.execute("PR ER", device.now).lines[0]
    return "|".join(answer.lines)


MCODE = ("LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM")
ROWS = [(product, name) for product in MCODE for name in MNEMONICS if name[0].isalpha()]
NUMBERS = [
    (product, row.name)
    for product in MCODE
    for row in MNEMONICS.values()
    if row.kind in ("variable", "flag") and product in row.products and row.access in ("RW", "WO")
    and (row.values or row.low is not None) and row.name not in COMMANDS
]  # fmt: skip
BEYOND = {"MF": 76, "BD": 61}
"""The codes of those that are not 21 out of range."""
PREPARED = {
    "VI": ["VM=2560000"],
    "VM": ["VI=1"],
    "MF": ["VM=2560000"],
    "HT": ["MT=0"],
    "MT": ["HT=0"],
    "FL": ["IS=3,13,0"],
    "TE": ["PG 1", "LB K1", "RT", "PG", "IS=1,12,0", "TI=1,K1", "TC=K1", "TT=60000,K1", "TP=5,K1", "TM=K1"],
}
HIGHEST = {"TE": 64 + 8 + 4 + 2 + 1}
"""Where not every sum is allowed: TP and TR exclude each other, and TA is not on all products."""


def prepared(product, name):
    """A drive on which a word can have all its values."""
    return drive(product, *PREPARED.get(name, []))


@pytest.mark.parametrize(("product", "name"), ROWS, ids=lambda each: each)
def test_a_word_can_be_printed_or_says_why_not(product, name):
    row, device = MNEMONICS[name], drive(product)
    found = say(device, f"PR {name}")
    if row.kind == "math":
        assert found == "?35"
    elif product not in row.reserved_on:
        assert found == "?35"  # a free name that nobody has declared
    elif product not in row.products:
        assert found == "?37"
    elif row.access in ("-", "WO") or row.kind in ("instruction", "reserved"):
        assert found == "?35"
    else:
        assert (found or name == "UV") and not found.startswith("?")


@pytest.mark.parametrize(("product", "name"), ROWS, ids=lambda each: each)
def test_a_word_that_may_not_be_written_says_why(product, name):
    row, device = MNEMONICS[name], drive(product)
    found = say(device, f"{name}=1")
    if product not in row.reserved_on:
        assert found == "?20"
    elif product not in row.products:
        assert found == "?37"
    elif row.kind == "variable" and row.access == "RO" or name in ("BY", "EF", "LR", "MP", "MV", "VC"):
        assert found == "?25"
    elif row.kind == "keyword":
        assert found in ("?25", "?60", "?24")
    elif row.kind in ("math", "reserved"):
        assert found == ("?60" if row.kind == "math" else "?24")


@pytest.mark.parametrize(("product", "name"), NUMBERS, ids=lambda each: each)
def test_a_number_is_taken_from_the_lowest_to_the_highest_and_not_beyond(product, name):
    row = MNEMONICS[name]
    low, high = (min(row.values), max(row.values)) if row.values else (row.low, HIGHEST.get(name, row.high))
    step = 1 if isinstance(low, int) else low
    for value in (low, high):
        device = prepared(product, name)
        assert say(device, f"{name}={value!r}") == "", value
        if row.access != "WO" and name not in ("TE", "FL"):
            assert float(say(device, f"PR {name}").split(",")[0]) == pytest.approx(value)
    if isinstance(row.default, float):
        return
    for value in (low - step, (row.high or high) + step):
        assert say(prepared(product, name), f"{name}={value!r}") == f"?{BEYOND.get(name, 21)}", value


@pytest.mark.parametrize(("product", "name"), ROWS, ids=lambda each: each)
def test_immediate_and_program_only_words_stand_where_they_may(product, name):
    row = MNEMONICS[name]
    if row.kind in ("math", "reserved", "keyword") or product not in row.products:
        return
    if not row.immediate:
        assert say(drive(product), f"{name} G1") == "?46"
    if not row.program:
        device = drive(product, "PG 1")
        assert device.execute(name, 0.0).refused
        assert [say(device, "PG"), say(device, "PR ER")] == ["", "24"]


@pytest.mark.parametrize(("product", "name"), ROWS, ids=lambda each: each)
def test_stepping_a_word_gives_the_code_of_its_kind(product, name):
    row = MNEMONICS[name]
    device = prepared(product, name)
    found = say(device, f"IC {name}")
    if product not in row.reserved_on or row.kind in ("math", "reserved"):
        assert found in ("?25", "?24")
    elif product not in row.products:
        assert found == "?37"
    elif row.step:
        assert found == f"?{row.step}"
    else:
        assert found in ("", "?21", "?23", "?22", "?76")


@pytest.mark.parametrize("product", MCODE)
def test_no_mnemonic_is_a_name_and_what_a_product_leaves_free_is_one(product):
    device = drive(product)
    for name, row in MNEMONICS.items():
        if not name[0].isalpha() or "_" in name or len(name) > 3:
            continue
        found = say(device, f"VA {name}")
        if product not in row.reserved_on:
            assert found == "", name
        else:
            assert found == ("?24" if row.kind == "reserved" else "?29"), name


@pytest.mark.parametrize("product", MCODE)
def test_firmware_is_not_replaced(product):
    assert say(drive(product), "UG 2956102") == "?24"


def test_an_mdrive_takes_f1_as_a_label_and_a_variable():
    device = drive("MDI", "PG 1", "LB F1", 'PR "f"', "E", "PG", "VA F2", "F2=3", "F2=F2/2*2")
    assert say(device, "PR F2") == "2"
    device.execute("EX F1", 0.0)
    device.advance(1.0)
    assert device.prints()[0][1] == "f\r\n"
    assert drive("MDI").execute("PR VR", 0.0).lines == ("3.010",)


@pytest.mark.parametrize("product", ["LMDCM", "LMDCE", "LMM"])
def test_the_encoder_has_its_own_range_and_values_of_motion(product):
    for name in ("A", "D", "VI", "VM"):
        row = MNEMONICS[name]
        low, high = row.bounds(encoder=True)
        for value, found in ((low, ""), (high, ""), (high + 1, "?21"), (low - 1, "?21")):
            device = drive(product, "EE=1", "VI=1", "VM=200000") if name != "VM" else drive(product, "EE=1", "VI=1")
            assert say(device, f"{name}={value}") == found, (name, value)
        device = drive(product, "EE=1")
        assert say(device, f"PR {name}") == str(row.default_encoder)
        assert say(device, "EE=0") == "" and say(device, f"PR {name}") == str(row.default)
