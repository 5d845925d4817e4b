"""Which TMCL lines need a confirmation before they are sent."""

import pytest

from dialects.families import FAMILIES
from dialects.tmcl.manual.guards import reason


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("STAP 4, 0", "EEPROM"),
        ("stap 4,0", "EEPROM"),
        ("7 4, 0, 0", "EEPROM"),
        ("STGP 66, 0", "EEPROM"),
        ("11 66, 0, 0", "EEPROM"),
        ("137 0, 0, 1234", "factory settings"),
        ("SGP 65, 0, 7", "baud rate"),
        (" SGP 66, 0, 5 ", "address"),
        ("9 66, 0, 5", "address"),
        ("RSGP 66, 0", "address"),
        ("242 0, 0, 0", "bootloader"),
    ],
)
def test_a_guarded_line_has_a_reason(text, part):
    assert part in FAMILIES["tmcl"].guarded(text)


@pytest.mark.parametrize("text", ["GAP 1, 0", "ROR 0, 1000", "SGP 75, 0, 5", "GGP 66, 0", "SGP 66", "", "MR 5", "/x"])
def test_other_lines_have_none(text):
    assert reason(text) == ""


def test_a_family_guards_nothing_unless_it_says_so():
    others = [family for name, family in FAMILIES.items() if name != "tmcl"]
    assert others and not any(family.guarded("STAP 4, 0") for family in others)
