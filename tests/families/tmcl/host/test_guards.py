"""Which TMCL lines need a person's yes."""

import pytest

from multidrop.dialects.families import FAMILIES
from multidrop.families.tmcl.host.codec import Tmcl, TmclState

FAMILY = FAMILIES["tmcl"]
ONE, EVERY = TmclState(Tmcl(), "1"), TmclState(Tmcl(), "*")


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
        ("132 0, 0, 0", "stores every command until 133"),
        ("SGP 77, 0, 1", "at each power-up"),
        ("RSGP 77, 0", "at each power-up"),
        ("SGP 67, 0, 1", "text mode"),
        ("9 255, 0, 1", "no more replies"),
        ("RSGP 255, 0", "no more replies"),
    ],
)
def test_a_guarded_line_has_a_reason(text, part):
    for form in (text, text.lower()):
        assert part in FAMILY(ONE).guard(form).what
        assert FAMILY.word_of(form) == FAMILY.word_of(form.upper())


@pytest.mark.parametrize(
    "text",
    ["GAP 1, 0", "ROR 0, 1000", "SGP 75, 0, 5", "GGP 66, 0", "SGP 66", "SGP 77, 0, 0", "", "MR 5", "/x"]
    + ["SGP 65, 2, 7", "RSGP 66, 2", "SGP 255, 2, 1", "SGP 67, 0, 0", "SGP 255, 0, 0"],
)
def test_other_lines_have_none(text):
    assert FAMILY(ONE).guard(text) is None


def test_a_line_to_all_that_can_start_is_guarded_and_a_stop_is_not():
    for text in ("ROR 0, 1000", "MVP ABS, 0, 0", "SAP 2, 0, 5", "RFS START, 0"):
        assert FAMILY(EVERY).guard(text).name == FAMILY(EVERY).guard(text.lower()).name == "*", text
    for text in ("ROR 0, 0", "ROL 0, 0", "MST 0", "RFS STOP, 0", "GAP 1, 0"):
        assert FAMILY(EVERY).guard(text) is None, text
