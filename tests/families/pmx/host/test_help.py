"""Help on the controller's words: commands, words of programs, the bits of their values; what a refusal names."""

from __future__ import annotations

import csv
import re

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects.families import correct_in
from multidrop.families.pmx.host.family import PmxFamily
from multidrop.families.pmx.host.values import NAMES, base
from multidrop.families.pmx.manual import script_parser, table
from multidrop.families.pmx.manual.help import LANGUAGE
from multidrop.families.pmx.simulator.settings import REGISTERS, WINDOWS
from tests.support.cases import for_each
from tests.support.paths import FACTS

SCRIPT_WORDS = FACTS / "pmx-standalone-commands.csv"


@for_each("word", [*script_parser.WORDS, *script_parser.KEYWORDS])
def test_every_word_of_a_script_has_help(word: str) -> None:
    lines = LANGUAGE.describe(word)
    assert LANGUAGE.knows(word) and LANGUAGE.knows(word.lower())
    row = table.lookup(word)
    assert lines[0].startswith(f"{row.name if row else word}: ") and len(lines) > 1
    if word in script_parser.WORDS:
        use = script_parser.use(word)
        assert use and re.search(rf"in programs? +{use}$", "\n".join(lines), re.M), lines


@pytest.mark.skipif(not SCRIPT_WORDS.exists(), reason="the table of facts is not part of the product")
def test_every_word_of_the_manuals_table_has_help() -> None:
    with SCRIPT_WORDS.open(newline="") as file:
        rows = [row["command"] for row in csv.DictReader(file)]
    assert len(rows) > 50
    for row in rows:
        if row == ";":
            continue  # begins a remark
        stem = row.replace("[pos]", "1").replace("[position]", "1").replace("[axis]", "X").replace("[+/-]", "+")
        words = [re.sub(r"\[(\d+)-\d+\]", r"\1", stem)] if "[" in stem else stem.split()
        for word in re.sub(r"(PRG|SUB) (\d)", r"\1\2", " ".join(words)).split():
            assert LANGUAGE.describe(word), row


@pytest.mark.parametrize(
    ("word", "line"),
    [
        ("HOME", "HOMEX+: home at high speed on the home input"),
        ("jogx-", "  as command  JX-"),
        ("ECLEARX", "  as command  CLRX"),
        ("sub 31", "  syntax     SUB 0 to SUB 31"),
        ("GOSUB 2", "  use        in programs only"),
        ("HSPD", "  in program read and set"),
        ("MSTX", "  bit 7      128: plus limit error"),
        ("MSTX", "  bit 11     2048: communication time-out"),
        ("POLX", "  bit 0      1: pulse"),
        ("POLX", "  bits 8, 9  decoding of the encoder: 0 1X, 256 2X, 512 4X"),
        ("POLY", "  bit 13     8192: after SUB 31 a program goes on at line 0; 0: at the line that failed"),
        ("SLSX", "  9          error: too many corrections"),
        ("SASTAT", "  4          stopped by an error"),
    ],
)
def test_help_says(word: str, line: str) -> None:
    assert line in LANGUAGE.describe(word)


def test_the_bits_of_a_status_are_those_of_its_table_in_order() -> None:
    bits = [int(text.partition(":")[0]) for _, text in table.parts_of("MST")]
    assert bits == [1 << bit for bit in (0, 1, 2, 4, 5, 6, 7, 8, 9, 10, 11)]
    masks = sum(int(text.partition(":")[0]) for label, text in table.parts_of("POL") if label.startswith("bit "))
    assert masks | 0x300 == 0b11_1111_1110_0011


def test_an_unknown_word_is_no_word_of_a_script_by_its_beginning() -> None:
    for word in ("HOM", "WAI", "EC", "GO", "", "+", "X+"):
        assert not LANGUAGE.knows(word), word
    with pytest.raises(Diagnostic):
        LANGUAGE.describe("HOM")


@for_each("name", NAMES)
def test_the_range_in_the_help_is_that_of_the_setting(name: str) -> None:
    """The text, the range of a restore and the simulated register say one thing; 0 of an axis is the global value."""
    row = table.lookup(name)
    assert row is not None
    if name not in REGISTERS or base(name) == "SLR":
        return
    low, high = REGISTERS[name].low, REGISTERS[name].high
    least = 1 if name not in ("HSPD", "LSPD", "ACC", "DEC") and base(name) in ("HSPD", "LSPD", "ACC", "DEC") else low
    first = re.match(r"(-?\d+)", row.takes.removeprefix("the sum of its bits, "))
    assert first is not None and int(first[1]) == least, row.takes
    if base(name) not in ("HSPD", "LSPD", "ACC", "DEC", "SLR", "JV"):  # 0 is the global one, or other units and limits
        assert (row.low, row.high) == (low, high)
        assert str(high) in row.takes or high <= 5 or high == 2**31 - 1, row.takes


def test_the_least_low_speed_of_each_window_is_in_the_help() -> None:
    row = table.lookup("LSPD")
    assert row is not None
    for window in WINDOWS:
        assert f"{window.slowest}" in re.findall(r"\d+", row.note)
    for window in WINDOWS[1:-1]:
        assert f"{window.slowest} ({'up to ' * (window.slowest == 1)}{window.high})" in row.note


def test_a_limit_error_names_the_line_that_clears_it_and_blocks_its_axis_only() -> None:
    state = PmxFamily.new_state(PmxFamily.codec, "00")
    facts = {"MSTX": 0, "MSTY": 0x80, "SLSX": 12, "SLSY": 12, "EO": 3, "SLX": 0, "SLY": 0}
    one, other = PmxFamily(state).values.fold(facts)
    assert (one.clears, one.blocked, one.error) == ("", "", 0)
    assert (other.clears, other.blocked) == ("CLRY", "plus limit error: CLRY clears it")
    assert other.error_name == "error"  # 128 is a bit and no number that help knows
    one, _ = PmxFamily(state).values.fold({**facts, "SLX": 1, "SLSX": 9})
    assert one.blocked == "StepNLoop error: too many corrections: CLRX clears it"


def test_a_text_of_remarks_alone_is_no_other_language() -> None:
    for text in ("", "\n\n", "; only a remark\n", "' one\n"):
        assert correct_in(text, "pmx") == correct_in(text, "mcode") == correct_in(text, "tmcl") == ""
    assert correct_in("PRG 0\nX1000\nEND\n", "mcode") == "pmx"
