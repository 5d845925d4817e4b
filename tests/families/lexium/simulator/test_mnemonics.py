"""Every word of the language on every Lexium: read, written at its limits and beyond, refused where it is not."""

import pytest

from multidrop.families.lexium.manual.table import MNEMONICS
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World

pytestmark = pytest.mark.slow


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


COMMANDS = frozenset(drive("LMDCM").language.commands)
MCODE = ("LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM")
LETTERS = ("A-D", "E-H", "I-L", "M-P", "Q-T", "U-Z")
on_every_product = pytest.mark.parametrize(("product", "letters"), [(p, each) for p in MCODE for each in LETTERS])


def words(letters):
    """The words of a range of letters, each with its row."""
    return [(name, row) for name, row in MNEMONICS.items() if letters[0] <= name[0] <= letters[-1]]


def is_number(row, product):
    """Whether a row has limits, and can be written on a product."""
    writable = row.kind in ("variable", "flag") and product in row.products and row.access in ("RW", "WO")
    return writable and (row.values or row.low is not None) and row.name not in COMMANDS


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


def printed_as_its_kind(row, product, found):
    """Whether PR of a word gives a value where it has one, and else the error that says why not."""
    if row.kind == "math" or product not in row.reserved_on:  # a free name that nobody has declared
        return found == "?35"
    if product not in row.products:
        return found == "?37"
    if row.access in ("-", "WO") or row.kind in ("instruction", "reserved"):
        return found == "?35"
    return (found or row.name == "UV") and not found.startswith("?")


@on_every_product
def test_a_word_can_be_printed_or_says_why_not(product, letters):
    device = drive(product)  # PR changes nothing but the error
    for name, row in words(letters):
        found = say(device, f"PR {name}")
        assert printed_as_its_kind(row, product, found), (name, found)


def refusals_of_writing(row, product):
    """The errors one of which `word=1` gives; empty where it may be written."""
    if product not in row.reserved_on:
        return ("?20",)
    if product not in row.products:
        return ("?37",)
    if row.kind == "variable" and row.access == "RO" or row.name in ("BY", "EF", "LR", "MP", "MV", "VC"):
        return ("?25",)
    return {"keyword": ("?25", "?60", "?24"), "math": ("?60",), "reserved": ("?24",)}.get(row.kind, ())


@on_every_product
def test_a_word_that_may_not_be_written_says_why(product, letters):
    for name, row in words(letters):
        found, codes = say(drive(product), f"{name}=1"), refusals_of_writing(row, product)
        assert not codes or found in codes, (name, found)


@on_every_product
def test_a_number_is_taken_from_the_lowest_to_the_highest_and_not_beyond(product, letters):
    for name, row in words(letters):
        if is_number(row, product):
            _holds_from_lowest_to_highest(product, name, row)


def _holds_from_lowest_to_highest(product, name, row):
    low, high = (min(row.values), max(row.values)) if row.values else (row.low, HIGHEST.get(name, row.high))
    step = 1 if isinstance(low, int) else low
    device = prepared(product, name)
    for value in (low, high):
        assert say(device, f"{name}={value!r}") == "", (name, value)
        if row.access != "WO" and name not in ("TE", "FL"):
            assert float(say(device, f"PR {name}").split(",")[0]) == pytest.approx(value), name
    if isinstance(row.default, float):
        return
    for value in (low - step, (row.high or high) + step):
        assert say(device, f"{name}={value!r}") == f"?{BEYOND.get(name, 21)}", (name, value)


@on_every_product
def test_immediate_and_program_only_words_stand_where_they_may(product, letters):
    for name, row in words(letters):
        if row.kind in ("math", "reserved", "keyword") or product not in row.products:
            continue
        if not row.immediate:
            assert say(drive(product), f"{name} G1") == "?46", name
        if not row.program:
            device = drive(product, "PG 1")
            assert device.execute(name, 0.0).refused, name
            assert [say(device, "PG"), say(device, "PR ER")] == ["", "24"], name


def answers_to_stepping(row, product):
    """What `IC word` may give."""
    if product not in row.reserved_on or row.kind in ("math", "reserved"):
        return ("?25", "?24")
    if product not in row.products:
        return ("?37",)
    return (f"?{row.step}",) if row.step else ("", "?21", "?23", "?22", "?76")


@on_every_product
def test_stepping_a_word_gives_the_code_of_its_kind(product, letters):
    for name, row in words(letters):
        found = say(prepared(product, name), f"IC {name}")
        assert found in answers_to_stepping(row, product), (name, found)


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
