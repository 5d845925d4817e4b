"""Variables and names: declared, local, stepped, computed with."""

import pytest

from multidrop.simulator.lexium.device import MCodeDevice
from tests.support.lexium import at, drive, run, say


def test_a_variable_that_its_program_has_not_made_yet_cannot_be_stepped():
    device = drive(program="PG 1\nLB G1\nVA Q7=3\nDC Q7\nE\nPG")
    assert say(device, "DC Q7", "IC Q7", "DC Q8", "PR UV")[:3] == ["?25", "?25", "?25"]
    say(device, "EX G1")
    device.advance(1.0)
    assert say(device, "DC Q7", "PR Q7") == ["1"]


def codes(device: MCodeDevice, *lines: str) -> list[int]:
    """The error of each line, 0 for one that is taken; works in program mode too."""
    found = []
    for line in lines:
        refused = device.execute(line, device.now).refused
        found.append(int(device.memory.values["ER"]) if refused else 0)
        device.errors.clear()
    return found


def test_a_variable_is_not_executed() -> None:
    device = drive("VA Q1=1", program="PG 1\nLB G1\nPG")
    assert codes(device, "EX Q1", "EX VM", "EX Q2", "EX 5", "EX G1") == [34, 34, 30, 42, 0]


@pytest.mark.parametrize("name", ["SA", "AS", "TS", "MU", "CB", "F1"])
def test_a_variable_that_bears_a_word_of_other_products_is_only_a_variable(name):
    device = drive(f"VA {name}=3", personality="MDI")
    assert say(device, f"IC {name}", f"R1={name}", f"PR R1,{name}", "PR UV", "MS=128", "MR 100") == [
        "44",
        f"{name} = G 4",
        "",
    ]
    assert at(device, 2, "P", "V", "ER") == ["100", "0", "0"]
    say(device, "S", f"{name}=9", "IP")
    assert say(device, f"PR {name}", "FD", "PR UV") == ["4", ""]


def test_a_variable_of_0_with_another_products_word_harms_nothing():
    assert say(drive("VA SA", "VA AS", personality="MDIE"), "MS=128", "EE=1", "EE=0", "PR SA,AS,MS") == ["00128"]


def test_user_variables_tell_their_scope():
    device = drive("R1=8", "VA Q1=25", "EX G1", program="PG 1\nLB G1\nVA Q2=R1\nIC Q2\nE\nPG")
    device.advance(1)
    assert say(device, "PR UV") == ["G1 = 1", "Q1 = G 25", "Q2 = L 9", ""]
    refused = say(device, "VA Q1", "VA Q1=3", "VA G1", "VA VM=3", "VA 1Q", "VA QQQ", "VA I7", "VA", "VA Q5=ZZ", "PR Q5")
    assert refused == ["?28", "?28", "?28", "?29", "?24", "?24", "?24", "?24", "?30", "?35"]
    assert say(device, "PR Q1", "S", "Q1=3", "IP", "PR Q1", "UG 2956102") == ["25", "25", "?24"]


@pytest.mark.parametrize("word", ["FT", "PK", "I7", "I13"])
def test_a_reserved_word_is_illegal_as_a_variable_and_as_a_label(word):
    device = drive()
    lines = [f"{word}=5", f"VA {word}", f"R1={word}", f"IC {word}", f"EX {word}"]
    assert run(device, *lines, "PG 1", f"LB {word}", "PG") == ["?24"] * 6


def test_the_names_of_functions_are_free_where_there_are_none():
    device = drive(personality="MDI")
    assert run(device, "VA PI=7", "VA SI=3", "R1=PI", "PR R1", "R1=SI+1", "PR R1", "R1=SI -1", "PR R1") == [
        "7",
        "4",
        "2",
    ]
    assert run(device, "R1=SQ 4", "R1=2+AB R1") == ["?24", "?24"]


def test_set_ups_of_several_lines_are_no_numbers():
    device = drive("R1=7")
    assert say(device, "R1=LS", "R1=OS", "PR R1") == ["?35", "?35", "7"]


@pytest.mark.parametrize(("lines", "line"), [([], "VA 1Q"), ([], "VA Q1 5"), (["PG 1"], "LB 2A")])
def test_what_is_no_name_is_illegal_data(lines, line):
    device = drive(*lines)
    assert device.execute(line, 0.0).refused
    assert device.memory.values["ER"] == 24


def test_a_local_variable_begins_anew_with_each_program_and_leaves_a_global_one_alone():
    device = drive(program="PG 1\nLB G1\nVA Q1\nIC Q1\nPR Q1\nE\nPG")
    for t in (1.0, 2.0):
        say(device, "EX G1", f"R1={t:.0f}")
        device.advance(t)
    assert "".join(text for _, text in device.prints()).split() == ["1", "1"]
    device = drive(program="VA Q1=3\nPG 1\nLB G1\nIC Q1\nPR Q1\nE\nPG")
    for t in (1.0, 2.0):
        say(device, "EX G1")
        device.advance(t)
    assert "".join(text for _, text in device.prints()).split() == ["4", "5"]
