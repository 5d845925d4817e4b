"""Programs for an MDrivePlus become programs for a Lexium: each row of the table, and what no row is needed for."""

from __future__ import annotations

import re

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.families.lexium.manual.conversion import convert, source, worlds
from tests.support.cases import for_each

BEHIND = "\nPG 1\nLB SU\nE\nPG\n"


def converted(line: str, product: str = "LMDCM") -> tuple[str, list[str], list[str]]:
    """The first line of a converted program, the changes and what is refused."""
    found = convert(line + BEHIND, product)
    changes, refused = ([f"{each.what}; {each.hint}" for each in part] for part in (found.changes, found.refused))
    return found.text.split("\n")[0], changes, refused


@for_each(
    "line, new",
    [
        ("S1=0,0,0", "IS=1,0,0"),
        ("  s2 = 1,1  ' home", "  IS=2,1,1  ' home"),
        ("S4=11,0,1", "IS=4,11,0"),
        ("S3=17,1,0", "OS=3,17,1"),
        ("S5=9", "IS=5,9,0"),
        ("S5=10,1", "IS=5,10,1"),
        ("OL 0", "OT=0"),
        ("H 0", "H"),
        ("CP 1", "CP"),
        ("DN=65", 'DN="A"'),
        ('DN="66"', 'DN="B"'),
        ("DN a", 'DN="a"'),
        ("R1=I5", "R1=I5/4"),
        ("BR SU,I5>512", "BR SU,I5>2051"),
        ("BR SU,I5<=512", "BR SU,I5<=2051"),
        ("BR SU,I5<512", "BR SU,I5<2048"),
        ("CL SU,I5>=512", "CL SU,I5>=2048"),
        ("R1=IL", "R1=IN"),
        ('PR "IL ",IL', 'PR "IL ",IN'),
        ("VA AO=5", "VA A0=5"),
        ("LBRD", "LBR0"),
    ],
)
def test_a_line_is_converted_and_the_change_named(line: str, new: str) -> None:
    text, [change], refused = converted(line)
    assert (text, refused) == (new, [])
    assert change.startswith(f"{line.partition(chr(39))[0].strip()} is now {new.partition(chr(39))[0].strip()}; ")


@pytest.mark.parametrize("count", range(0, 1024, 31))
def test_a_threshold_of_the_analog_input_means_the_same_reading(count: int) -> None:
    """Each reading of 10 bits is four of 12 bits."""
    for sign, holds in {"<": int.__lt__, "<=": int.__le__, ">": int.__gt__, ">=": int.__ge__}.items():
        new = int(re.search(r"\d+$", converted(f"BR SU,I5{sign}{count}")[0])[0])
        for reading in range(max(count - 2, 0), count + 3):
            assert {holds(reading * 4 + more, new) for more in range(4)} == {holds(reading, count)}


@for_each(
    "line, why",
    [
        ("S4=16,1,0", "outputs 1 to 3"),
        ("O4=1", "outputs 1 to 3"),
        ("S9=0,0,0", "no such point or type"),
        ("S13=60,0", "IS=1,12"),
        ("S13=61,0", "OS=3,28"),
        ("EE=1", "4000 counts"),
        ("C2=5", "4000 counts"),
        ("R1=C2", "4000 counts"),
        ("SF=30", "4000 a turn"),
        ("PR I5", "read it into a variable"),
        ("BR SU,I5=5", "read it into a variable"),
        ("TI=9,SU", "inputs 1 to 4"),
        ("UG 2956102", "upgrade"),
        ("OL 13", "set up the outputs in the file"),
        ("OT=R2", "set up the outputs in the file"),
        ("CR=1.5", "no LMDCM has CR"),
        ("A=1500000000", "66 to 1100000000"),
        ("VM=3000000", "MS*10000, here 2560000"),
        ("MS=16\nSL -170000", "MS*10000, here 160000"),
        ("BR 57", "give that line a label"),
        ("TT=5,57", "give that line a label"),
        ("S1=16,1,0\nR1=I1", "cannot read its outputs"),
    ],
)
def test_what_cannot_be_converted_is_refused_and_stays(line: str, why: str) -> None:
    text, _, [refused] = converted(line)
    assert why in refused and text.split("\n")[0] in (line.split("\n")[0], "OS=1,16,1")


@for_each(
    "line",
    ["HT=0", "MT=50", "DE=0", "BR SU,IN=5", "PR C2", "BR SU,MP=1", "PR VR", "BR SU,ER=20"],
)
def test_what_stays_and_differs_is_named(line: str) -> None:
    text, [change], refused = converted(line)
    assert (text, refused) == (line, []) and change.startswith(f"{line} stays; ")


@for_each("line", ["EE=0", "C2=0", "P=0", "MR 100", "BR 1", "OE 0", "VM=2560000", "PR I1", "BD=96"])
def test_a_line_of_both_languages_is_left_alone(line: str) -> None:
    assert converted(line) == (line, [], [])


def test_a_drive_without_an_encoder_or_a_serial_port_lacks_their_words() -> None:
    assert "no LMDOM has HI" in converted("HI 1", "LMDOM")[2][0]
    assert "no LMDCE has BD" in converted("BD=96", "LMDCE")[2][0]


def test_outputs_that_the_file_does_not_set_up_are_not_switched() -> None:
    found = convert("S3=16,1,0\nOL=13\nOL=R1" + BEHIND, "LMDCM")
    assert found.text.splitlines()[:3] == ["OS=3,16,1", "OT=4", "OT=R1"] and found.refused == []
    assert "the bit of an input of the MDrivePlus switches an output" in found.changes[2].hint


def test_a_bare_number_needs_ne_before_the_program() -> None:
    found = convert("VM=5000\nPG 1\nMR 5\nH\n-5\nE\nPG\n", "LMDCM")
    assert found.text == "VM=5000\nNE=1\nPG 1\nMR 5\nH\n-5\nE\nPG\n" and found.inserted == 2
    assert convert("NE=0\nPG 1\n5\nE\nPG\n", "LMDCM").changes == []


def test_line_ends_stay() -> None:
    assert convert("S1=0,0\r\nPG 1\r\nE\r\nPG\r\n", "LMDCM").text == "IS=1,0,0\r\nPG 1\r\nE\r\nPG\r\n"


def test_the_product_is_the_simplest_that_has_all_words() -> None:
    assert [source(f"PG 1\n{line}\nE\nPG\n") for line in ("R1=IL", "EE=1", "OH=3")] == ["MDI", "MDIE", "MDIX"]
    with pytest.raises(Diagnostic, match="this is a program for LMD.*no MDIX has IS"):
        source("IS=1,0,0\nPG 1\nE\nPG\n")


def test_the_worlds_vary_each_input_and_the_reading_around_its_thresholds() -> None:
    found = list(worlds("S1=16,1,0\nS2=1,0,0\nS3=2,1,0\nS4=17,1,0\nPG 1\nLB SU\nBR SU,I5<300\nE\nPG\n"))
    assert len(found) == 24 == len({said for said, _, _ in found})
    assert {world["home"] for _, world, _ in found} == {-30000, 30000}
    assert {world["analog"][0][1] for _, world, _ in found} == {0, 299, 300, 301, 512, 1023}
    assert all(other["analog"][0][1] == world["analog"][0][1] * 4 + 2 for _, world, other in found)
