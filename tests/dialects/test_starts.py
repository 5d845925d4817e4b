"""Which typed lines can start motion or a program, in each family: reads never, what is not known always."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects import Started
from multidrop.dialects.families import FAMILIES
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.modbus.codec import Modbus
from multidrop.families.lexium.manual.table import MDRIVE, MNEMONICS
from multidrop.families.pmx.host.codec import Pmx
from multidrop.families.pmx.manual.table import ROWS
from multidrop.families.tmcl.host.codec import Tmcl
from tests.support.cases import for_each

STARTS = {
    MCode(): (
        *("MR 100", "mr100", "MA -5", "SL 0", "HM 1", "HI 2", "HF 3", "EX G1", "EX 1,2", "JE=1", "RS", "SC 1", "AS=3"),
        *("FL=1", "PM=1", "DE=1", "CF", "TS=60000", "TE=1", "TI=1,G1", "OE G1", "IP", "IS=1,4,1", "S1=4,0", "BR G1"),
        *("100", "-51200", "G1", "Q1=5", "XX", "MR", "MR 5,,", 'PR "not closed', "\x07"),
    ),
    Modbus(): ("MR 100", "SL 5", "EX G1", "JE=1", "TE=1", "HM 1", "PM=1", "IP", "XX", "SL", "MR 5,,"),
    Pmx(): (
        *("X1000", "Y-5", "X1Y2", "I1:2", "TX5", "JX+", "J-", "HX+", "LY-", "ZHX+", "ZX-", "HLY+", "SR0=1", "SR1=3"),
        *("GS3", "JO", "SLX=1", "PX=5", "EY=0", "EO=3", "CLRX", "foo", "XX"),
    ),
}
STARTS_NOTHING = {
    MCode(): (
        *("PR P", "pr V", 'PR P,"a ",V', "PR AL", "PR ER", "", "' a remark", "L", "L G1", "E", "PG", "PG 100", "PS"),
        *("S", "CP", "VM=500000", "A=1000", "P=0", "R1=5", "EM=1", 'DN="a"', "O1=1", "VA Q1", "IC R1", "ER=0", "LB G1"),
    ),
    Modbus(): (
        *("PR P", "  pr V", "PR P,V", "SL 0", "JE=0", "TE=0", "VM=5", "P=0", "R1=5", "V1=5", "E", "RC=200", "IC R1"),
        *("S", "O1=1", "", "' a remark"),
    ),
    Pmx(): ("PX", "MSTX", "ID", "SLX", "EO", "SASTAT0", "STOP", "ABORTX", "ABS", "INC", "HSPD=500", "DO1=1", "V5=1"),
}


@for_each(("codec", "text"), [(each, text) for each, lines in STARTS.items() for text in lines])
def test_what_can_start_something(codec, text):
    assert codec.starts_motion(text)


@for_each(("codec", "text"), [(d, text) for d, lines in STARTS_NOTHING.items() for text in lines])
def test_what_starts_nothing(codec, text):
    assert not codec.starts_motion(text)


MOTION, PROGRAM, ANYTHING = Started(None, False, False), Started(None, True, False), Started()
WHAT = {
    MCode(): ({"EX G1": PROGRAM, "ex g1": PROGRAM, "EX 1,2": PROGRAM, "hm 1": MOTION, "MR 5": MOTION, "SL 5": MOTION},),
    Modbus(): ({"EX G1": PROGRAM, "ex g1": PROGRAM, "hi 2": MOTION, "MA 5": MOTION},),
    Pmx(): (
        {"SR0=1": PROGRAM, "SR1=3": PROGRAM, "GS3": PROGRAM, "I1:2": MOTION},
        {"X5": Started(frozenset("x"), False, False), "X1Y2": Started(frozenset("xy"), False, False)},
        {"JO": Started(None, False, True), "SLX=1": Started(frozenset("x"), False, True)},
    ),
    Tmcl(): (
        {
            "129 0, 0, 0": ANYTHING,
            "200 0, 0, 0": ANYTHING,
            "MVP COORD, 0, 5": MOTION,
            "RFS START, 2": Started(frozenset("2"), False, False),
        },
    ),
}
"""What a stop of an early end must end: axes, a program, and what moves the drive again after it was at rest."""


@for_each(
    ("codec", "text", "what"),
    [
        *((codec, text, what) for codec, tables in WHAT.items() for each in tables for text, what in each.items()),
        *((codec, text, ANYTHING) for codec in WHAT for text in ("XX", "foo 1")),
        *((codec, text, ANYTHING) for codec in (MCode(), Modbus()) for text in ("JE=1", "TE=1", "PM=1")),
    ],
)
def test_what_a_line_starts(codec, text, what):
    assert codec.started(text) == what


@given(*[st.builds(Started, st.sampled_from([None, frozenset("x"), frozenset("y")]), *[st.booleans()] * 2)] * 2)
def test_two_lines_have_started_what_either_has(one, two):
    both = one | two
    assert (both.program, both.lasts) == (one.program or two.program, one.lasts or two.lasts)
    assert both.axes == (None if None in (one.axes, two.axes) else one.axes | two.axes)


@for_each(
    ("name", "text", "ends"),
    [
        *[(name, text, True) for name in ("mcode", "modbus") for text in ("SL 0", "sl=0", "JE 0")],
        *[(name, text, False) for name in ("mcode", "modbus") for text in ("SL 5", "MR 0", "SL R1", "DE=0", "XX", "")],
        *[("pmx", text, text in ("SR0=0", "SR1=2")) for text in ("SR0=0", "SR1=2", "SR0=1", "X0", "EO=0", "JX+")],
        *[("tmcl", text, text == "ROR 0, 0") for text in ("ROR 0, 0", "ROR 0, 5", "MVP ABS, 0, 0", "?")],
    ],
)
def test_what_can_only_end_motion(name, text, ends):
    assert FAMILIES[name].only_ends(text) is ends


@given(st.sampled_from([word for word in (*MNEMONICS, *MDRIVE) if word[0].isalpha()]))
def test_no_print_of_mcode_counts(word):
    assert not MCode().starts_motion(f"PR {word}")


@given(st.sampled_from([(row, word) for row in ROWS for word in row.words() if "R" in row.access]))
def test_no_read_of_the_pmx_counts(found):
    row, word = found
    assert not Pmx().starts_motion(word)
    assert Pmx().starts_motion(f"{word}=1") is row.starts


@given(st.text(max_size=30))
def test_any_text_is_judged(text):
    for codec in (MCode(), Modbus(), Pmx()):
        assert codec.starts_motion(text) in (True, False)
    assert MCode().starts_motion(f"MR {text}")


@pytest.mark.parametrize(
    ("escape", "sure", "data", "hears"),
    [
        (1, True, b"\x1b", True),
        (1, True, b"b\x1b\n", True),
        (0, True, b"b\x1b\n", False),
        (0, True, b"\x05", True),
        (3, True, b"b\x1bc\x1b\n", False),
        (3, True, b"b\x1ba\x1b\n", True),
        (2, True, b"a\x1b\n", False),
        (2, True, b"a\x05\n", True),
        (3, False, b"b\x05\n", True),
        (None, True, b"b\x05\n", True),
    ],
)
def test_which_drives_hear_another_ones_stop(escape, sure, data, hears):
    assert MCode(party=True, escape=escape).hears_stop(data, "a", sure) is hears


def test_a_pmx_hears_a_stop_with_its_own_number():
    assert not Pmx().hears_stop(b"@00ABORT\r", "01") and Pmx().hears_stop(b"@00ABORT\r", "00")
    assert Pmx(addressed=False).hears_stop(b"ABORT\r", "") and Modbus().hears_stop(b"", "")
